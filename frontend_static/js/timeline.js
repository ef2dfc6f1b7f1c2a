/** The past of the shown mission: moments to go back to, one by one or as a film. */
import * as api from "./api.js";
import { Observable } from "./observable.js";
import { report, store } from "./store.js";

const FRAME_MS = 700;
const REFRESH_MS = 5000;
const KEPT = 60;

class Timeline extends Observable {
  /** `{number, time_s, sequence, path_length_m}`, in order. */
  moments = [];
  /** What was seen, known and planned at the moment shown; null: the page shows the present. */
  moment = null;
  playing = false;
  #mission = null;
  #details = new Map();
  #wanted = null;

  constructor() {
    super();
    store.watch(["shown"], () => this.#begin());
    setInterval(() => store.active && this.#refresh(), REFRESH_MS);
    store.watch(["results"], () => this.#refresh());
  }

  /** Place of the moment shown; the last one where the present is shown. */
  get place() {
    if (!this.moment) return Math.max(0, this.moments.length - 1);
    const { number } = this.moment;
    const found = this.moments.findIndex((moment) => moment.number >= number);
    return found < 0 ? this.moments.length - 1 : found;
  }

  /** Show the moment at that place. */
  async go(place) {
    const entry = this.moments[Math.max(0, Math.min(this.moments.length - 1, place))];
    if (!entry) return;
    this.#wanted = entry.number;
    const mission = this.#mission;
    try {
      const moment = await this.#detail(entry.number);
      if (this.#wanted !== entry.number || this.#mission !== mission) return;
      this.moment = moment;
      this.changed("moment");
    } catch (error) {
      if (error.status !== 404) throw error;
      await this.#refresh(); // let go meanwhile, as there are too many: its neighbours are still there
    }
  }

  async step(by) {
    if (this.moment === null && by > 0) return;
    const next = this.place + by;
    if (next >= this.moments.length) this.goLive();
    else await this.go(next);
  }

  goLive() {
    this.#wanted = null;
    this.playing = false;
    if (this.moment === null) return;
    this.moment = null;
    this.changed("moment");
  }

  pause() {
    this.playing = false;
    this.changed("playing");
  }

  /** Show one moment after the other, from the one shown (or the first) to the present. */
  async play() {
    if (this.playing || this.moments.length === 0) return;
    this.playing = true;
    this.changed("playing");
    try {
      if (this.moment === null) await this.go(0);
      while (this.playing && this.moment !== null) {
        await new Promise((done) => setTimeout(done, FRAME_MS));
        if (this.playing) await this.step(1);
      }
    } catch (error) {
      report(error);
    }
    this.pause();
  }

  #begin() {
    this.#mission = store.mission?.id ?? null;
    this.#details.clear();
    this.moments = [];
    this.goLive();
    this.changed("moments", "moment");
    this.#refresh();
  }

  async #refresh() {
    const mission = this.#mission;
    if (!mission) return;
    try {
      const { moments } = await api.listMoments(mission);
      if (this.#mission !== mission) return;
      this.moments = moments;
      this.changed("moments");
    } catch (error) {
      if (error.status !== 0) report(error); // the bar tells when the service is gone
    }
  }

  async #detail(number) {
    const known = this.#details.get(number);
    if (known) return known;
    const detail = await api.getMoment(this.#mission, number);
    this.#details.set(number, detail);
    if (this.#details.size > KEPT) this.#details.delete(this.#details.keys().next().value);
    return detail;
  }
}

export const timeline = new Timeline();
