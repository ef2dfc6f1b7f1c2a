/** The newest images side by side: camera, map from the same pose, depth, quality gain. */
import { imageUrl } from "../api.js";
import { element } from "../format.js";
import { store, watch } from "../store.js";

const IMAGES = [
  ["observed", "Observed", "camera"],
  ["rendered", "Rendered", "from the map"],
  ["depth", "Depth", ["0.3", "5 m"], "reversed"],
  ["quality", "Quality gain", ["low", "high"], ""],
];
const INTERVAL_MS = 1000;

class ImageGrid extends HTMLElement {
  connectedCallback() {
    this.tags = {};
    this.images = {};
    for (const [kind, title, note, direction] of IMAGES) {
      const image = element("img", { alt: `${title} image of the current pose`, id: `image-${kind}` });
      const hint = Array.isArray(note)
        ? element("span", {}, note[0], element("i", { class: `scale ${direction}` }), note[1])
        : element("span", {}, note);
      this.images[kind] = image;
      this.append(
        element(
          "figure",
          {},
          element("div", { class: "picture" }, image),
          element("figcaption", {}, element("b", {}, title), hint),
        ),
      );
    }
    this.unwatch = watch(["images", "mission"], () => this.#schedule());
  }

  disconnectedCallback() {
    this.unwatch();
    clearTimeout(this.timer);
  }

  /** Fetch when there is a newer view, at most once an interval. */
  #schedule() {
    const { mission, viewSequence } = store;
    if (mission && mission.id !== this.shownMission) {
      this.shownMission = mission.id;
      this.shownView = 0;
      for (const kind of Object.keys(this.images)) this.#show(kind, null, null);
    }
    if (this.timer || !mission || viewSequence === this.shownView) return;
    const pause = Math.max(0, (this.fetchedAt ?? -INTERVAL_MS) + INTERVAL_MS - performance.now());
    this.timer = setTimeout(async () => {
      this.fetchedAt = performance.now();
      this.shownView = store.viewSequence;
      await Promise.all(Object.keys(this.images).map((kind) => this.#fetch(kind)));
      this.timer = null;
      this.#schedule();
    }, pause);
  }

  async #fetch(kind) {
    const id = store.mission.id;
    let response;
    try {
      response = await fetch(imageUrl(id, kind), { cache: "no-cache" });
    } catch {
      return; // the badge in the bar tells when the service is gone
    }
    const tag = response.headers.get("ETag");
    if (!response.ok || tag === this.tags[kind] || store.mission.id !== id) return;
    this.#show(kind, tag, await response.blob());
  }

  #show(kind, tag, blob) {
    const image = this.images[kind];
    if (image.src) URL.revokeObjectURL(image.src);
    this.tags[kind] = tag;
    if (blob) image.src = URL.createObjectURL(blob);
    else image.removeAttribute("src");
  }
}

customElements.define("image-grid", ImageGrid);
