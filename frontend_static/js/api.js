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

const post = (content) => ({
  method: "POST",
  headers: { "Content-Type": "application/json" },
  body: JSON.stringify(content),
});

export const getSession = () => request(SESSION);
export const openSession = (token) => request(SESSION, post({ token }));
export const closeSession = () => request(SESSION, { method: "DELETE" });

const query = (values) => new URLSearchParams(values).toString();

export const getSystem = () => request("/system");
export const listScenes = () => request("/scenes");
export const listPresets = () => request("/presets");
export const listMissions = () => request("/missions");
export const getMission = (id) => request(`/missions/${id}`);
export const listResults = (id) => request(`/missions/${id}/results`);
export const getMetrics = (id, since) => request(`/missions/${id}/metrics?${query({ since, limit: 2000 })}`);

/** The newest `limit` events that are not telemetry. */
export const newestEvents = (id, limit) => {
  const kinds = ["state", "phase", "plan", "notice", "ended"].map((kind) => `kind=${kind}`).join("&");
  return request(`/missions/${id}/events?newest=true&limit=${limit}&${kinds}`);
};

export const resultUrl = (id, name) =>
  `${BASE}/missions/${id}/results/${name.split("/").map(encodeURIComponent).join("/")}`;

export const imageUrl = (id, kind) => `${BASE}/missions/${id}/images/${kind}`;

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
