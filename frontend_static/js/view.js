/** What the page shows: the present of the mission, or a moment of its past. */
import * as api from "./api.js";
import { Observable } from "./observable.js";
import { report, store } from "./store.js";
import { timeline } from "./timeline.js";

const INTERVAL_MS = 2000;

class View extends Observable {
  /** The map from above: `{facts, image}`, `image` an ImageBitmap; null while there is none. */
  map = null;
  /** Place in the plan's list of the candidate that is pointed at; null: none. */
  pointedAt = null;
  #mapKey = null;
  #loading = false;
  #loadedAt = -INTERVAL_MS;

  constructor() {
    super();
    store.watch(["figures", "plan", "images", "mission", "events"], (what) => {
      if (this.past && !what.has("mission")) return;
      this.changed(...what, "map");
      this.#loadMap();
    });
    timeline.watch(["moment"], () => {
      this.pointedAt = null;
      this.changed("figures", "plan", "images", "events", "past", "map");
      this.#loadMap();
    });
  }

  /** The moment of the past that is shown; null in the present. */
  get past() {
    return timeline.moment;
  }

  get figures() {
    return this.past ? this.past.figures : store.figures;
  }

  get plan() {
    return this.past ? this.past.plan : store.plan;
  }

  /** Positions since the map was made. */
  get trail() {
    return this.past ? [] : store.trail;
  }

  /** Events that had happened. */
  get events() {
    const { past } = this;
    return past ? store.events.filter(({ sequence }) => sequence <= past.sequence) : store.events;
  }

  /** Names the images shown: a change means that they are others. */
  get imageKey() {
    if (!store.mission) return null;
    const { past } = this;
    if (past) return `${store.mission.id} moment ${past.number}`;
    return store.viewSequence > 0 ? `${store.mission.id} view ${store.viewSequence}` : null;
  }

  imageUrl(kind) {
    return api.imageUrl(store.mission.id, kind, this.past?.number ?? null);
  }

  /** Point at a candidate of the plan, from the table or the map. */
  pointAt(place) {
    if (place === this.pointedAt) return;
    this.pointedAt = place;
    this.changed("pointed");
  }

  /** Load the map that belongs to `imageKey`: at once for the past, at most once an interval for the present. */
  async #loadMap() {
    const key = this.imageKey;
    if (key === null && this.map) {
      this.map = null;
      this.#mapKey = null;
      this.changed("map");
    }
    if (key === null || key === this.#mapKey || this.#loading) return;
    this.#loading = true;
    const { mission } = store;
    const moment = this.past;
    if (!moment) await pause(this.#loadedAt + INTERVAL_MS - performance.now());
    this.#loadedAt = performance.now();
    try {
      const trail = store.trail.length;
      const facts = moment ? moment.top_view : await api.getTopView(mission.id);
      const map = { facts, image: await picture(api.topViewUrl(mission.id, moment?.number ?? null)) };
      if (store.mission?.id === mission.id && this.past === moment) {
        this.map = map;
        this.#mapKey = moment ? key : `${mission.id} view ${facts.view_sequence}`;
        if (!moment) store.trail.splice(0, trail);
        this.changed("map");
      }
    } catch (error) {
      if (error.status !== 404 && error.status !== 0) report(error);
      this.#mapKey = key; // there is none yet: the next view may bring one
    }
    this.#loading = false;
    if (this.imageKey !== key || this.past !== moment) this.#loadMap();
  }
}

const pause = (milliseconds) => new Promise((done) => setTimeout(done, Math.max(0, milliseconds)));

async function picture(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new api.Problem({ title: answer.statusText }, answer.status);
  return createImageBitmap(await answer.blob());
}

export const view = new View();
