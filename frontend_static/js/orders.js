/**
 * What the operator asks of the shown mission beside start and stop: region of interest, no-go areas, budgets, a say
 * in every view. `draft` is edited here and holds once it is sent; `inForce` is what the service says.
 */
import * as api from "./api.js";
import { Observable } from "./observable.js";
import { store } from "./store.js";

export const MOST_CORNERS = 64;
export const MOST_NO_GO = 32;
const NOTHING = {
  region: null,
  no_go: [],
  max_speed_m_s: null,
  max_path_m: null,
  return_to_start: false,
  approve_views: false,
};

class Orders extends Observable {
  inForce = NOTHING;
  draft = NOTHING;
  /** What was wrong with the orders that were sent last: problem entries by field. */
  errors = [];
  sending = false;
  #mission = null;

  constructor() {
    super();
    store.watch(["mission"], () => this.#follow());
  }

  /** Whether orders can be given now. */
  get possible() {
    const state = store.mission?.state;
    return store.operator && state !== undefined && !["completed", "failed", "aborted"].includes(state);
  }

  get changedHere() {
    return !same(this.draft, this.inForce);
  }

  /** The view that waits for an answer, as the service tells it; null: none does. */
  get waiting() {
    return store.mission?.approval ?? null;
  }

  /** Replace parts of the draft. */
  edit(changes) {
    this.draft = { ...this.draft, ...changes };
    this.errors = [];
    this.changed("draft");
  }

  /** Replace a polygon: `kind` region or no_go, `index` among the no-go areas. Null corners remove it. */
  setPolygon({ kind, index }, corners) {
    if (kind === "region") return this.edit({ region: corners });
    const areas = [...this.draft.no_go];
    if (corners === null) areas.splice(index, 1);
    else areas[index] = corners;
    return this.edit({ no_go: areas });
  }

  revert() {
    this.edit(this.inForce);
  }

  /** Send the draft. Raises the service's refusal, and keeps what it says of single fields in `errors`. */
  async send() {
    const id = this.#mission;
    this.sending = true;
    this.changed("draft");
    try {
      const inForce = await api.putDirectives(id, this.draft);
      if (this.#mission !== id) return;
      this.inForce = inForce;
      this.draft = inForce;
      this.errors = [];
    } catch (error) {
      this.errors = error.errors ?? [];
      throw error;
    } finally {
      this.sending = false;
      this.changed("draft", "in force");
    }
  }

  /** Drive to the view that waits, to another candidate of the plan, or to none of them. */
  async answer(decision, candidate = null) {
    const answer = { plan_sequence: this.waiting.plan_sequence, decision, candidate };
    store.adopt(await api.answerApproval(this.#mission, answer));
  }

  #follow() {
    const id = store.mission?.id ?? null;
    const told = { ...NOTHING, ...store.mission?.directives };
    const untouched = id !== this.#mission || !this.changedHere;
    if (id === this.#mission && same(told, this.inForce)) return;
    this.#mission = id;
    this.inForce = told;
    if (untouched) {
      this.draft = told;
      this.errors = [];
    }
    this.changed("draft", "in force");
  }
}

const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

export const orders = new Orders();
