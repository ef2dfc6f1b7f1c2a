/** Drawing in metres on a canvas: what every layer of the map from above is made of. */

/** Prepares `canvas` for one drawing; null when it has no size. Colours are custom properties of `--NAME`. */
export function penFor(canvas, camera) {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (width < 20 || height < 20) return null;
  const ratio = devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  [camera.width, camera.height] = [width, height];
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  return new Pen(context, camera, getComputedStyle(canvas));
}

class Pen {
  constructor(context, camera, style) {
    this.context = context;
    this.camera = camera;
    this.style = style;
  }

  colour(name) {
    return this.style.getPropertyValue(`--${name}`);
  }

  image(image, [left, low], [right, high]) {
    const [u, v] = this.camera.toScreen([left, high]);
    const { scale } = this.camera;
    this.context.imageSmoothingEnabled = (right - left) * scale < image.width * 2;
    this.context.drawImage(image, u, v, (right - left) * scale, (high - low) * scale);
  }

  /** A path through `points` [m]. */
  trace(points, closed = false) {
    const { context } = this;
    context.beginPath();
    points.forEach((point, k) => {
      const [u, v] = this.camera.toScreen(point);
      if (k) context.lineTo(u, v);
      else context.moveTo(u, v);
    });
    if (closed) context.closePath();
  }

  /** A line with a rim, so that it shows on any ground. */
  line(points, { colour, width = 2, dash = [], closed = false, rim = "map-rim" }) {
    if (points.length < 2) return;
    const { context } = this;
    context.lineJoin = "round";
    context.lineCap = "round";
    this.trace(points, closed);
    context.setLineDash([]);
    context.strokeStyle = this.colour(rim);
    context.lineWidth = width + 2;
    if (dash.length === 0) context.stroke();
    context.setLineDash(dash);
    context.strokeStyle = this.colour(colour);
    context.lineWidth = width;
    context.stroke();
    context.setLineDash([]);
  }

  /** A round, square or crossed mark of `size` pixels at a place [m]. */
  mark(point, { shape, size, colour, filled = true }) {
    const { context } = this;
    const [u, v] = this.camera.toScreen(point);
    context.beginPath();
    if (shape === "disc") context.arc(u, v, size, 0, 2 * Math.PI);
    else if (shape === "square") context.rect(u - size, v - size, 2 * size, 2 * size);
    else if (shape === "diamond") corners(context, u, v, [[0, -size], [size, 0], [0, size], [-size, 0]]);
    else cross(context, u, v, size);
    if (filled && shape !== "cross") {
      context.fillStyle = this.colour(colour);
      context.fill();
    }
    context.strokeStyle = this.colour("map-rim");
    context.lineWidth = filled ? 1.5 : 4;
    context.stroke();
    if (!filled || shape === "cross") {
      context.strokeStyle = this.colour(colour);
      context.lineWidth = 1.75;
      context.stroke();
    }
  }

  /** Words on a plate beside a place [m], inside the canvas. */
  label(text, point, { colour = "ink", shift = [0, -14] } = {}) {
    const { context, camera } = this;
    context.font = `600 11.5px ${this.style.fontFamily}`;
    const width = context.measureText(text).width + 10;
    let [u, v] = camera.toScreen(point);
    u = Math.min(camera.width - width / 2 - 2, Math.max(width / 2 + 2, u + shift[0]));
    v = Math.min(camera.height - 12, Math.max(12, v + shift[1]));
    context.fillStyle = this.colour("map-plate");
    context.beginPath();
    context.roundRect(u - width / 2, v - 9, width, 18, 4);
    context.fill();
    context.fillStyle = this.colour(colour);
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, u, v);
  }

  /** A cone from a pose: what a camera there looks at, as far as `reach` metres. */
  cone({ x_m: x, y_m: y, yaw_deg: yaw }, openingDeg, reach, colour) {
    const { context } = this;
    const [u, v] = this.camera.toScreen([x, y]);
    const middle = (-yaw * Math.PI) / 180;
    const half = (openingDeg * Math.PI) / 360;
    context.beginPath();
    context.moveTo(u, v);
    context.arc(u, v, reach * this.camera.scale, middle - half, middle + half);
    context.closePath();
    context.globalAlpha = 0.22;
    context.fillStyle = this.colour(colour);
    context.fill();
    context.globalAlpha = 1;
  }

  /** Fill a polygon with slanted lines: seen as "keep out" without any colour. */
  hatch(corners, colour) {
    const { context, camera } = this;
    context.save();
    this.trace(corners, true);
    context.clip();
    context.globalAlpha = 0.18;
    context.fillStyle = this.colour(colour);
    context.fill();
    context.globalAlpha = 0.75;
    context.strokeStyle = this.colour(colour);
    context.lineWidth = 1.5;
    const places = corners.map((corner) => camera.toScreen(corner));
    const left = Math.min(...places.map(([u]) => u));
    const right = Math.max(...places.map(([u]) => u));
    const high = Math.min(...places.map(([, v]) => v));
    const low = Math.max(...places.map(([, v]) => v));
    context.beginPath();
    for (let u = left - (low - high); u < right; u += 9) {
      context.moveTo(u, low);
      context.lineTo(u + (low - high), high);
    }
    context.stroke();
    context.restore();
  }

  /** Darken everything outside a polygon. */
  dimOutside(corners) {
    const { context, camera } = this;
    this.trace(corners, true);
    context.rect(0, 0, camera.width, camera.height);
    context.globalAlpha = 0.4;
    context.fillStyle = this.colour("map-dim");
    context.fill("evenodd");
    context.globalAlpha = 1;
  }
}

function corners(context, u, v, shifts) {
  shifts.forEach(([du, dv], k) => (k ? context.lineTo(u + du, v + dv) : context.moveTo(u + du, v + dv)));
  context.closePath();
}

function cross(context, u, v, size) {
  context.moveTo(u - size, v - size);
  context.lineTo(u + size, v + size);
  context.moveTo(u + size, v - size);
  context.lineTo(u - size, v + size);
}
