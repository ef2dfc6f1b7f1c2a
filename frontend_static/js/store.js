/**
 * What the page knows of the mission it shows. Elements listen for `change` (detail: a set of what changed) and
 * read the fields; only this module talks to the service.
 */
import * as api from "./api.js";

const MAX_POINTS = 4000;
const MAX_EVENTS = 300;
const ACTIVE = new Set(["starting", "running", "paused", "stopping"]);
const COLUMNS = {
  time_s: "time_s",
  path_length_m: "path_length_m",
  observed_volume_m3: "observed_volume_m3",
  missing_volume_m3: "missing_volume_m3",
  psnr_current_db: "psnr_current_db",
  n_gaussians: "n_gaussians",
};

class Store extends EventTarget {
  /** Who is logged in: `{login_required, name, role, expires_at}`. */
  session = null;
  system = null;
  scenes = [];
  presets = [];
  missions = [];
  /** Missions that have a process, and those that wait for a place, by id. */
  running = [];
  queued = [];
  missionsAtOnce = 1;
  mission = null;
  figures = null;
  plan = null;
  series = emptySeries();
  events = [];
  results = [];
  /** Number of the newest view; images show it. 0 = none yet. */
  viewSequence = 0;
  connected = true;
  serviceReachable = true;
  heardAt = performance.now();
  #stream = null;
  #loading = 0;

  /** Load the catalogue, then show the running mission, or else the newest. */
  async begin() {
    this.session = await api.getSession();
    if (!this.session.role) {
      api.toLogin();
      return;
    }
    this.#changed("session");
    [this.system, this.scenes, this.presets] = await Promise.all([
      api.getSystem(),
      api.listScenes(),
      api.listPresets(),
    ]);
    this.#changed("system", "catalogue");
    const list = await this.refreshMissions();
    const first = list.running[0] ?? list.missions[0]?.id;
    if (first) await this.show(first);
    else this.#changed("mission");
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

  async refreshMissions() {
    const list = await api.listMissions();
    this.missions = list.missions;
    this.running = list.running;
    this.queued = list.queued;
    this.missionsAtOnce = list.missions_at_once;
    this.#changed("missions");
    return list;
  }

  /** Show mission `id`: its history first, then its stream from there on. */
  async show(id) {
    const ticket = ++this.#loading;
    this.#stream?.close();
    const [mission, metrics, page] = await Promise.all([
      api.getMission(id),
      api.getMetrics(id, 0),
      api.newestEvents(id, MAX_EVENTS),
    ]);
    if (ticket !== this.#loading) return;
    this.mission = mission;
    this.figures = mission.figures;
    this.plan = mission.plan;
    this.series = emptySeries();
    for (const name of Object.keys(COLUMNS)) this.series[name] = metrics.columns[name];
    this.events = page.events;
    this.results = [];
    this.viewSequence = mission.view_sequence;
    this.connected = true;
    this.heardAt = performance.now();
    const after = Math.max(metrics.next_since, page.events.at(-1)?.sequence ?? 0);
    this.#stream = new api.EventStream(id, after, {
      onEvent: (event) => this.#take(event),
      onConnection: (connected) => {
        this.connected = connected;
        this.#changed("connection");
      },
    });
    this.#changed("mission", "figures", "plan", "series", "events", "results", "images");
    await this.#refreshResults();
  }

  /** Create and start a mission, and show it. A retry of the same click makes no second one. */
  async launch(wish, key) {
    const mission = await api.createMission(wish, key);
    await this.refreshMissions();
    await this.show(mission.id);
    await this.command("start");
  }

  /** Send start, pause, resume or stop to the shown mission. */
  async command(name) {
    if (!this.mission) return;
    const answer = await api.command(this.mission.id, name);
    this.#adopt(answer);
    await this.refreshMissions();
  }

  #take(event) {
    this.heardAt = performance.now();
    switch (event.kind) {
      case "alive":
        if (event.silent_s !== null && event.silent_s !== undefined)
          this.heardAt = performance.now() - event.silent_s * 1000;
        this.#changed("connection");
        return;
      case "telemetry":
        this.figures = event;
        this.viewSequence = event.view_sequence ?? this.viewSequence;
        this.#append(event);
        this.#changed("figures", "series", "images");
        return;
      case "plan":
        this.plan = event;
        break;
      case "state":
        this.mission = { ...this.mission, state: event.state, reason: event.reason };
        api.getMission(this.mission.id).then((mission) => this.#adopt(mission), () => {});
        this.refreshMissions().catch(() => {});
        if (!ACTIVE.has(event.state)) this.#refreshResults();
        break;
      case "phase":
        this.mission = { ...this.mission, phase: event.phase };
        break;
    }
    this.events.push(event);
    if (this.events.length > MAX_EVENTS) this.events.shift();
    this.#changed("mission", "plan", "events");
  }

  #append(event) {
    for (const name of Object.keys(COLUMNS)) this.series[name].push(event[name]);
    if (this.series.time_s.length > MAX_POINTS)
      for (const name of Object.keys(COLUMNS))
        this.series[name] = this.series[name].filter((_, place) => place % 2 === 0);
  }

  #adopt(mission) {
    if (this.mission?.id !== mission.id) return;
    this.mission = mission;
    this.viewSequence = mission.view_sequence;
    this.#changed("mission", "images");
  }

  async #refreshResults() {
    const id = this.mission.id;
    try {
      const results = await api.listResults(id);
      if (this.mission.id === id) this.results = results;
    } catch (error) {
      report(error);
    }
    this.#changed("results");
  }

  async #poll() {
    try {
      await this.refreshMissions();
      this.serviceReachable = true;
    } catch {
      this.serviceReachable = false;
    }
    this.#changed("connection");
  }

  #changed(...what) {
    this.dispatchEvent(new CustomEvent("change", { detail: new Set(what) }));
  }
}

function emptySeries() {
  return Object.fromEntries(Object.keys(COLUMNS).map((name) => [name, []]));
}

export const store = new Store();

/** Call `draw` now and whenever one of `what` changes. Returns a function that ends it. */
export function watch(what, draw) {
  const listen = (event) => {
    if (what.some((name) => event.detail.has(name))) draw();
  };
  store.addEventListener("change", listen);
  draw();
  return () => store.removeEventListener("change", listen);
}

/** Show an error that belongs to no field. */
export function report(error) {
  store.dispatchEvent(new CustomEvent("problem", { detail: error.message || String(error) }));
}
