/**
 * What the page knows of the mission it shows, as it is now. Parts follow it and read the fields; `timeline.js`
 * knows its past, `view.js` which of the two is shown.
 */
import * as api from "./api.js";
import { missions } from "./missions.js";
import { Observable } from "./observable.js";

const MAX_POINTS = 4000;
const EVENTS_AT_FIRST = 300;
const MAX_EVENTS = 3000;
const ACTIVE = new Set(["starting", "running", "paused", "stopping"]);
const COLUMNS = [
  "time_s",
  "path_length_m",
  "observed_volume_m3",
  "missing_volume_m3",
  "psnr_current_db",
  "n_gaussians",
];
const PLAN_COLUMNS = ["time_s", "planning_s"];

class Store extends Observable {
  /** Who is logged in: `{login_required, name, role, expires_at}`. */
  session = null;
  system = null;
  scenes = [];
  presets = [];
  mission = null;
  figures = null;
  plan = null;
  /** Figures over time, a list a column. */
  series = empty(COLUMNS);
  planSeries = empty(PLAN_COLUMNS);
  /** Positions [x, y] since the newest map from above. */
  trail = [];
  events = [];
  moreEvents = false;
  results = [];
  /** Number of the newest view; images show it. 0 = none yet. */
  viewSequence = 0;
  connected = true;
  serviceReachable = true;
  heardAt = performance.now();
  /** The series hold every figure up to this event. */
  #charted = 0;
  #stream = null;
  #loading = 0;

  /** Load the catalogue, then show the running mission, or else the newest. */
  async begin() {
    this.session = await api.getSession();
    if (!this.session.role) {
      api.toLogin();
      return;
    }
    this.changed("session");
    [this.system, this.scenes, this.presets] = await Promise.all([
      api.getSystem(),
      api.listScenes(),
      api.listPresets(),
    ]);
    this.changed("system", "catalogue");
    const list = await missions.refresh();
    const first = list.running[0] ?? list.missions[0]?.id;
    if (first) await this.show(first);
    else this.changed("mission");
    setInterval(() => this.#poll(), 3000);
  }

  /** Whether this page may command. */
  get operator() {
    return this.session?.role === "operator";
  }

  get active() {
    return this.mission !== null && ACTIVE.has(this.mission.state);
  }

  /** Seconds since anything was heard of the shown mission, by this page or by the service. */
  get silence() {
    return (performance.now() - this.heardAt) / 1000;
  }

  /** Show mission `id`: its history first, then its stream from there on. */
  async show(id) {
    const ticket = ++this.#loading;
    this.#stream?.close();
    const [mission, metrics, page] = await Promise.all([
      api.getMission(id),
      api.getMetrics(id, 0),
      api.newestEvents(id, EVENTS_AT_FIRST),
    ]);
    const plan = mission.newest_plan === null ? null : await api.getPlan(id);
    if (ticket !== this.#loading) return;
    this.mission = mission;
    this.figures = mission.figures;
    this.plan = plan;
    this.series = Object.fromEntries(COLUMNS.map((name) => [name, metrics.columns[name]]));
    this.planSeries = Object.fromEntries(PLAN_COLUMNS.map((name) => [name, metrics.plans[name]]));
    this.trail = [];
    this.events = page.events;
    this.moreEvents = page.more;
    this.results = [];
    this.viewSequence = mission.view_sequence;
    this.connected = true;
    this.heardAt = performance.now();
    this.#charted = metrics.next_since;
    // The answers are of slightly different moments: what one of them has already is passed over.
    const told = page.events.at(-1)?.sequence ?? 0;
    this.#stream = new api.EventStream(id, Math.min(metrics.next_since, told), {
      onEvent: (event) => this.#take(event),
      onConnection: (connected) => {
        this.connected = connected;
        this.changed("connection");
      },
    });
    this.changed("shown", "mission", "figures", "plan", "series", "events", "results", "images");
    await this.#refreshResults();
  }

  /** Create and start a mission, and show it. A retry of the same click makes no second one. */
  async launch(wish, key) {
    const mission = await api.createMission(wish, key);
    await missions.refresh();
    await this.show(mission.id);
    await this.command("start");
  }

  /** Send start, pause, resume or stop to the shown mission. */
  async command(name) {
    if (!this.mission) return;
    this.adopt(await api.command(this.mission.id, name));
    await missions.refresh();
  }

  /** Take over what the service says of the mission, if it is still the one shown. */
  adopt(mission) {
    if (this.mission?.id !== mission.id) return;
    this.mission = mission;
    this.viewSequence = mission.view_sequence;
    this.changed("mission", "images");
  }

  /** Add the page of events before the oldest one. */
  async loadOlderEvents() {
    const { id } = this.mission;
    const page = await api.newestEvents(id, EVENTS_AT_FIRST, { before: this.events[0]?.sequence });
    if (this.mission.id !== id) return;
    this.events = [...page.events, ...this.events];
    this.moreEvents = page.more;
    this.changed("events");
  }

  #take(event) {
    this.heardAt = performance.now();
    switch (event.kind) {
      case "alive":
        if (event.silent_s !== null && event.silent_s !== undefined)
          this.heardAt = performance.now() - event.silent_s * 1000;
        this.changed("connection");
        return;
      case "telemetry":
        if (event.sequence <= this.#charted) return;
        this.figures = event;
        this.viewSequence = event.view_sequence ?? this.viewSequence;
        this.trail.push([event.x_m, event.y_m]);
        append(this.series, COLUMNS, event);
        this.changed("figures", "series", "images");
        return;
    }
    if (this.events.at(-1)?.sequence >= event.sequence) return; // told by the history already
    this.events.push(event);
    if (this.events.length > MAX_EVENTS) this.events.shift();
    this.#follow(event);
    this.changed("events");
  }

  #follow(event) {
    switch (event.kind) {
      case "plan":
        this.plan = event;
        if (event.sequence > this.#charted) append(this.planSeries, PLAN_COLUMNS, event);
        this.changed("plan", "series");
        return;
      case "state":
        this.mission = { ...this.mission, state: event.state, reason: event.reason };
        this.#askAgain();
        if (!ACTIVE.has(event.state)) this.#refreshResults();
        break;
      case "phase":
        this.mission = { ...this.mission, phase: event.phase };
        break;
      case "directives":
      case "approval":
        this.#askAgain();
        break;
    }
    this.changed("mission");
  }

  /** An event said that the mission changed: its record, commands and orders are the service's to tell. */
  #askAgain() {
    api.getMission(this.mission.id).then((mission) => this.adopt(mission), report);
    missions.refresh().catch(report);
  }

  async #refreshResults() {
    const { id } = this.mission;
    try {
      const results = await api.listResults(id);
      if (this.mission.id === id) this.results = results;
    } catch (error) {
      report(error);
    }
    this.changed("results");
  }

  async #poll() {
    try {
      await missions.refresh();
      this.serviceReachable = true;
    } catch {
      this.serviceReachable = false;
    }
    this.changed("connection");
  }
}

const empty = (names) => Object.fromEntries(names.map((name) => [name, []]));

function append(series, names, event) {
  for (const name of names) series[name].push(event[name]);
  if (series[names[0]].length > MAX_POINTS)
    for (const name of names) series[name] = series[name].filter((_, place) => place % 2 === 0);
}

export const store = new Store();

/** Call `draw` now and whenever one of `what` changes. Returns a function that ends it. */
export const watch = (what, draw) => store.watch(what, draw);

/** Show an error that belongs to no field. */
export function report(error) {
  store.dispatchEvent(new CustomEvent("problem", { detail: error.message || String(error) }));
}
