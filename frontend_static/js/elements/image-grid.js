/** The images side by side: camera, map from the same pose, depth, quality gain. A click enlarges one. */
import { element } from "../format.js";
import { Part } from "../observable.js";
import { store } from "../store.js";
import { view } from "../view.js";

const IMAGES = [
  ["observed", "Observed", "camera"],
  ["rendered", "Rendered", "from the map"],
  ["depth", "Depth", ["0.3", "5 m"], "reversed"],
  ["quality", "Quality gain", ["low", "high"], ""],
];
const INTERVAL_MS = 1000;

class ImageGrid extends Part {
  connectedCallback() {
    this.tags = {};
    this.images = {};
    this.fetchedAt = -INTERVAL_MS;
    for (const [kind, title, note, direction] of IMAGES) this.append(this.#figure(kind, title, note, direction));
    this.follow(view, ["images", "mission"], () => this.#schedule());
  }

  #figure(kind, title, note, direction) {
    const image = element("img", { alt: `${title} image of the pose shown`, id: `image-${kind}` });
    const hint = Array.isArray(note)
      ? element("span", {}, note[0], element("i", { class: `scale ${direction}` }), note[1])
      : element("span", {}, note);
    this.images[kind] = image;
    const enlarge = element(
      "button",
      { type: "button", class: "picture", title: "Enlarge", "aria-label": `Enlarge ${title}`, "aria-pressed": "false" },
      image,
    );
    enlarge.addEventListener("click", () => this.#enlarge(kind));
    return element("figure", { "data-kind": kind }, enlarge, element("figcaption", {}, element("b", {}, title), hint));
  }

  #enlarge(kind) {
    this.large = this.large === kind ? null : kind;
    for (const figure of this.children) {
      const large = figure.dataset.kind === this.large;
      figure.classList.toggle("large", large);
      figure.firstElementChild.setAttribute("aria-pressed", String(large));
    }
  }

  /** Fetch what is shown: at once when it is another mission or moment, else at most once an interval. */
  #schedule() {
    const key = view.imageKey;
    if (store.mission?.id !== this.mission) {
      this.mission = store.mission?.id;
      for (const kind of Object.keys(this.images)) this.#show(kind, null, null);
    }
    if (this.busy || key === null || key === this.shown) return;
    this.busy = true;
    const wait = view.past || this.past ? 0 : this.fetchedAt + INTERVAL_MS - performance.now();
    setTimeout(() => this.#fetchAll(), Math.max(0, wait));
  }

  async #fetchAll() {
    this.fetchedAt = performance.now();
    this.shown = view.imageKey;
    this.past = view.past !== null;
    if (this.shown !== null)
      await Promise.all(Object.keys(this.images).map((kind) => this.#fetch(kind, this.shown)));
    this.busy = false;
    this.#schedule();
  }

  async #fetch(kind, key) {
    let response;
    try {
      response = await fetch(view.imageUrl(kind), view.past ? {} : { cache: "no-cache" });
    } catch {
      return; // the badge in the bar tells when the service is gone
    }
    const tag = response.headers.get("ETag") ?? key;
    if (!response.ok || tag === this.tags[kind] || !key.startsWith(store.mission.id)) return;
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
