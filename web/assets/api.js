// Requests to the appliance, the session, and the stream of its state.
import { S } from './strings.js';

export class ApiError extends Error {
  constructor(status, body) {
    super(body?.error ?? `The appliance answered ${status}.`);
    this.status = status;
    this.body = body;
  }
}

const kAnswer_ms = 20000;
const kLongAnswer_ms = 60000;  // files, and what removes or packs many
const kLogOut_ms = 5000;
const kSilent_s = 25;  // the appliance sends a beat every 10 s

/// A moment, for since_s().
export const now = () => ({ wall: Date.now(), steady: performance.now() });
/// Seconds since that moment: never negative, and neither too few because the machine slept (the steady clock may have stood still) nor
/// because its clock was set back.
export const since_s = (moment) => Math.max(0, Date.now() - moment.wall, performance.now() - moment.steady) / 1000;

let session = null;
let onLoggedOff = () => {};

export const currentSession = () => session;
export const may = (permission) => session?.permissions.includes(permission) ?? false;
export const setLoggedOffHandler = (handler) => { onLoggedOff = handler; };

const asJson = (response) => response.json();

/// What `read` makes of the answer.
async function ask(method, path, body, { background = false, timeout_ms = kAnswer_ms, read = asJson } = {}) {
  const headers = {};
  if (method !== 'GET' && session) headers['X-CSRF-Token'] = session.csrf_token;
  if (body !== undefined) headers['Content-Type'] = 'application/json';
  if (background) headers['X-Plumb-Background'] = '1';
  let response;
  try {
    response = await fetch(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body), cache: 'no-store', signal: AbortSignal.timeout(timeout_ms) });
    if (response.ok) return await read(response);
  } catch {
    throw new ApiError(0, { error: S.noAnswer });
  }
  const problem = await response.json().catch(() => null);
  if (response.status === 401 && session) {
    session = null;
    onLoggedOff();
  }
  throw new ApiError(response.status, problem);
}

const readFile = async (response) => ({ blob: await response.blob(), name: /filename="([^"]+)"/.exec(response.headers.get('Content-Disposition') ?? '')?.[1] ?? 'plumb' });
const orNothing = (response) => response.json().catch(() => ({}));
export const get = (path, background = false) => ask('GET', `/api/v1/${path}`, undefined, { background });
export const getBytes = (path) => ask('GET', `/api/v1/${path}`, undefined, { timeout_ms: kLongAnswer_ms, read: (response) => response.arrayBuffer() });
export const post = (path, body) => ask('POST', `/api/v1/${path}`, body, { read: orNothing });
export const postForFile = (path) => ask('POST', `/api/v1/${path}`, undefined, { timeout_ms: kLongAnswer_ms, read: readFile });
export const put = (path, body) => ask('PUT', `/api/v1/${path}`, body);
export const remove = (path) => ask('DELETE', `/api/v1/${path}`, undefined, { timeout_ms: kLongAnswer_ms });
export const fileUrl = (scanId, name, download) => `/api/v1/scans/${scanId}/files/${name}${download ? '?download' : ''}`;

/// The session, or null; `setupRequired` tells whether there is an account at all.
export async function loadSession() {
  try {
    session = await get('session');
    return { session, setupRequired: false };
  } catch (error) {
    if (error.status !== 401) throw error;
    session = null;
    return { session: null, setupRequired: error.body?.setup_required ?? false };
  }
}

export async function logOut() {
  await ask('POST', '/api/v1/logout', undefined, { timeout_ms: kLogOut_ms, read: orNothing });
  session = null;
}

/// The newest state and who wants to know; when it came, and when anything came at all.
export const live = {
  status: null,
  received: now(),
  heard: now(),
  listeners: new Set(),
  source: null,
  wanted: false,  // by whoever is logged in, whether there is a stream just now or not
  connected: true,

  open() {
    this.close();
    this.wanted = true;
    const source = new EventSource('/api/v1/events');
    this.source = source;
    this.heard = now();
    const on = (kind, take) => source.addEventListener(kind, (event) => {
      this.heard = now();
      take(event);
    });
    on('beat', () => {});
    on('status', (event) => this.take(JSON.parse(event.data)));
    for (const kind of ['result', 'data', 'update']) on(kind, () => this.tell(kind));
    on('logged_off', () => {
      this.close();
      session = null;
      onLoggedOff();
    });
    source.onopen = () => this.connection(true);
    source.onerror = () => {
      this.connection(false);
      if (source.readyState !== EventSource.CLOSED) return;
      // The browser gave up: the session is over, or the appliance restarts.
      this.source = null;
      const again = () => { if (this.wanted && !this.source) this.open(); };
      setTimeout(() => { if (this.wanted && !this.source) get('session', true).then(again, (error) => { if (error.status !== 401) again(); }); }, 2000);
    };
  },
  close() {
    this.wanted = false;
    this.source?.close();
    this.source = null;
  },
  /// A stream may die without an end that the browser sees (sleep, a network that is gone): then not even the beat comes.
  watch() {
    if (!this.source || since_s(this.heard) <= kSilent_s) return;
    this.connection(false);
    this.open();
  },
  take(status) {
    this.status = status;
    this.received = now();
    this.tell('status');
  },
  tell(kind) {
    for (const listener of [...this.listeners]) listener(kind);
  },
  connection(connected) {
    if (connected === this.connected) return;
    this.connected = connected;
    this.tell('connection');
    if (connected) this.tell('data');  // what was told meanwhile is not told again
  },
  /// Calls listener(kind) until the returned function is called.
  listen(listener) {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  },
};
setInterval(() => live.watch(), 1000);
