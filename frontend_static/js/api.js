/** The service's REST interface, and its stream of events. */

const BASE = "/api/v1";
const SESSION = "/session";
const LOGIN_ENDED = 4401;

/** A refusal of the service: its problem document. */
export class Problem extends Error {
  constructor(document, status) {
    super(document.detail || document.title || `HTTP ${status}`);
    this.status = status;
    this.errors = document.errors || [];
  }
}

async function request(path, options = {}) {
  let response;
  try {
    response = await fetch(BASE + path, options);
  } catch {
    throw new Problem({ detail: "The service does not answer. Is it still running?" }, 0);
  }
  if (!response.ok) {
    const document = await response.json().catch(() => ({ title: response.statusText }));
    if (response.status === 401 && path !== SESSION) toLogin();
    throw new Problem(document, response.status);
  }
  return response.status === 204 ? null : response.json();
}

/** Leave for the page to log in: there is no session, or it has ended. */
export function toLogin() {
  location.replace("login.html");
}

const sending = (method, content) => ({
  method,
  headers: { "Content-Type": "application/json" },
  body: JSON.stringify(content),
});
const post = (content) => sending("POST", content);

export const getSession = () => request(SESSION);
export const openSession = (token) => request(SESSION, post({ token }));
export const closeSession = () => request(SESSION, { method: "DELETE" });

const query = (values) => new URLSearchParams(values).toString();

export const getSystem = () => request("/system");
export const listScenes = () => request("/scenes");
export const listPresets = () => request("/presets");
/** `planner`: as if the preset named this one; none: its own. */
export const getPresetSettings = (name, planner) =>
  request(`/presets/${encodeURIComponent(name)}/settings${planner ? `?${query({ planner })}` : ""}`);

/** A page of missions, newest first; `states`: only these. */
export const listMissions = ({ cursor = null, states = [], limit = 50 } = {}) => {
  const wish = new URLSearchParams({ limit });
  if (cursor) wish.set("cursor", cursor);
  for (const state of states) wish.append("state", state);
  return request(`/missions?${wish}`);
};
export const getMission = (id) => request(`/missions/${id}`);
/** A live mission's robot and the link to it. */
export const getRobot = (id) => request(`/missions/${id}/robot`);
export const listResults = (id) => request(`/missions/${id}/results`);
export const getMetrics = (id, since) => request(`/missions/${id}/metrics?${query({ since, limit: 2000 })}`);

/** Kinds of events that a log shows; telemetry is not among them. */
export const LOGGED = [
  "state",
  "phase",
  "plan",
  "notice",
  "directives",
  "approval",
  "resumed",
  "halted",
  "ended",
];

/** The newest `limit` events of these kinds with numbers below `before` (none: the newest of all). */
export const newestEvents = (id, limit, { kinds = LOGGED, before = null } = {}) => {
  const wish = new URLSearchParams({ newest: true, limit });
  if (before) wish.set("before", before);
  for (const kind of kinds) wish.append("kind", kind);
  return request(`/missions/${id}/events?${wish}`);
};

export const getTopView = (id) => request(`/missions/${id}/top-view`);
export const listMoments = (id) => request(`/missions/${id}/moments`);
export const getMoment = (id, number) => request(`/missions/${id}/moments/${number}`);
export const getDirectives = (id) => request(`/missions/${id}/directives`);
export const putDirectives = (id, directives) =>
  request(`/missions/${id}/directives`, sending("PUT", directives));

/** `answer`: `{plan_sequence, decision, candidate}`. */
export const answerApproval = (id, answer) => request(`/missions/${id}/approval`, post(answer));

export const resultUrl = (id, name) =>
  `${BASE}/missions/${id}/results/${name.split("/").map(encodeURIComponent).join("/")}`;

export const archiveUrl = (id) => `${BASE}/missions/${id}/results.zip`;

/** The newest image of `kind`; of a moment where one is named. */
export const imageUrl = (id, kind, moment = null) =>
  moment === null
    ? `${BASE}/missions/${id}/images/${kind}`
    : `${BASE}/missions/${id}/moments/${moment}/images/${kind}`;

/** The map from above; at a moment where one is named. */
export const topViewUrl = (id, moment = null) =>
  moment === null
    ? `${BASE}/missions/${id}/top-view.png`
    : `${BASE}/missions/${id}/moments/${moment}/top-view.png`;

/** The newest plan with all its candidates. */
export const getPlan = (id) => request(`/missions/${id}/plan`);

/** The mission's report, or null while there is none. */
export const getReport = async (id) => {
  try {
    return await request(`/missions/${id}/results/report.json`);
  } catch (error) {
    if (error.status === 404) return null;
    throw error;
  }
};

export const sceneUrl = (id) => `/viewer/${id}/`;

export const createMission = (wish, key) => {
  const options = post(wish);
  options.headers["Idempotency-Key"] = key;
  return request("/missions", options);
};

/** `name` is start, pause, resume or stop. */
export const command = (id, name) => request(`/missions/${id}/${name}`, { method: "POST" });

/**
 * Events of one mission from `after` on, over a WebSocket that reconnects where it broke off.
 * `onEvent(event)` gets each event, `onConnection(connected)` every change of the line.
 */
export class EventStream {
  constructor(missionId, after, { onEvent, onConnection }) {
    this.missionId = missionId;
    this.cursor = after;
    this.onEvent = onEvent;
    this.onConnection = onConnection;
    this.closed = false;
    this.wait = 500;
    this.#open();
  }

  close() {
    this.closed = true;
    clearTimeout(this.timer);
    this.socket?.close();
  }

  #open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const path = `${BASE}/missions/${this.missionId}/events?after=${this.cursor}`;
    this.socket = new WebSocket(`${scheme}://${location.host}${path}`);
    this.socket.onopen = () => {
      this.wait = 500;
      if (!this.closed) this.onConnection(true);
    };
    this.socket.onmessage = (message) => {
      if (this.closed) return;
      const event = JSON.parse(message.data);
      if (event.sequence) this.cursor = event.sequence;
      this.onEvent(event);
    };
    this.socket.onclose = ({ code }) => {
      if (this.closed) return;
      if (code === LOGIN_ENDED) toLogin();
      this.onConnection(false);
      this.timer = setTimeout(() => this.#open(), this.wait);
      this.wait = Math.min(this.wait * 2, 5000);
    };
  }
}
