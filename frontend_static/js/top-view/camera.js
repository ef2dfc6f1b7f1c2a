/** Which part of the floor a canvas shows: metres to pixels and back; y is up in the world, down on the canvas. */
const LEAST_SCALE = 2;
const MOST_SCALE = 800;
const LEAST_SHARE = 0.75;

export class MapCamera {
  /** Middle of the canvas in the world [m], pixels a metre, and the size of the canvas [px]. */
  x = 0;
  y = 0;
  scale = 40;
  width = 1;
  height = 1;

  toScreen([x, y]) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toWorld([u, v]) {
    return [this.x + (u - this.width / 2) / this.scale, this.y - (v - this.height / 2) / this.scale];
  }

  /** Show all of a rectangle. */
  fit([left, low], [right, high]) {
    this.x = (left + right) / 2;
    this.y = (low + high) / 2;
    const fitting = Math.min(this.width / (right - left || 1), this.height / (high - low || 1));
    this.scale = clamp(0.94 * fitting);
  }

  /** Whether a rectangle fills the canvas well: all of it is in sight, and it is not small. */
  fits([left, low], [right, high]) {
    const [[u, bottom], [end, v]] = [this.toScreen([left, low]), this.toScreen([right, high])];
    const inside = u >= 0 && v >= 0 && end <= this.width && bottom <= this.height;
    return inside && Math.max((end - u) / this.width, (bottom - v) / this.height) > LEAST_SHARE;
  }

  pan(du, dv) {
    this.x -= du / this.scale;
    this.y += dv / this.scale;
  }

  /** Enlarge by `factor`; what lies at canvas position `at` stays there. */
  zoom(factor, at = [this.width / 2, this.height / 2]) {
    const before = this.toWorld(at);
    this.scale = clamp(this.scale * factor);
    const after = this.toWorld(at);
    this.x += before[0] - after[0];
    this.y += before[1] - after[1];
  }
}

const clamp = (scale) => Math.min(MOST_SCALE, Math.max(LEAST_SCALE, scale));
