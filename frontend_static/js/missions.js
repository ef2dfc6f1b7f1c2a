/** Which missions there are: a page of them kept fresh, and older ones on request. */
import * as api from "./api.js";
import { Observable } from "./observable.js";

class Missions extends Observable {
  /** Newest first, as far as they have been asked for. */
  entries = [];
  /** Missions that have a process, and those that wait for a place, by id. */
  running = [];
  queued = [];
  atOnce = 1;
  /** Only missions in these states are listed; none: all. */
  states = [];
  #cursor = null;
  #older = [];

  get more() {
    return this.#cursor !== null;
  }

  /** Ask for the newest ones again. Returns the answer. */
  async refresh() {
    const { states } = this;
    const page = await api.listMissions({ states });
    if (states !== this.states) return page;
    const fresh = new Set(page.missions.map(({ id }) => id));
    this.#older = this.#older.filter(({ id }) => !fresh.has(id));
    if (this.#older.length === 0) this.#cursor = page.next_cursor;
    this.entries = [...page.missions, ...this.#older];
    [this.running, this.queued, this.atOnce] = [page.running, page.queued, page.missions_at_once];
    this.changed("missions");
    return page;
  }

  /** Ask for the next older page. */
  async loadMore() {
    const page = await api.listMissions({ cursor: this.#cursor, states: this.states });
    const known = new Set(this.entries.map(({ id }) => id));
    this.#older.push(...page.missions.filter(({ id }) => !known.has(id)));
    this.#cursor = page.next_cursor;
    this.entries = [...this.entries, ...page.missions.filter(({ id }) => !known.has(id))];
    this.changed("missions");
  }

  async show(states) {
    this.states = states;
    this.#older = [];
    this.#cursor = null;
    await this.refresh();
  }

  /** Place in the queue from 1 on; 0 = not queued. */
  placeOf(id) {
    return this.queued.indexOf(id) + 1;
  }
}

export const missions = new Missions();
