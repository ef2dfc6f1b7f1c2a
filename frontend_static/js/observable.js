/** Something that changes, and tells what: `change` carries a set of names. */
export class Observable extends EventTarget {
  changed(...what) {
    this.dispatchEvent(new CustomEvent("change", { detail: new Set(what) }));
  }

  /** Call `draw` now and whenever one of `what` changes. Returns a function that ends it. */
  watch(what, draw) {
    const listen = (event) => {
      if (what.some((name) => event.detail.has(name))) draw(event.detail);
    };
    this.addEventListener("change", listen);
    draw(new Set(what));
    return () => this.removeEventListener("change", listen);
  }
}

/** A part of the page; what it follows it lets go of when it is removed. */
export class Part extends HTMLElement {
  #ends = [];

  follow(source, what, draw) {
    this.#ends.push(source.watch(what, draw));
  }

  /** Listen to `target` for as long as this part is on the page. */
  hear(target, kind, listener, options) {
    target.addEventListener(kind, listener, options);
    this.#ends.push(() => target.removeEventListener(kind, listener, options));
  }

  every(milliseconds, act) {
    const timer = setInterval(act, milliseconds);
    this.#ends.push(() => clearInterval(timer));
  }

  disconnectedCallback() {
    for (const end of this.#ends.splice(0)) end();
  }
}
