// SPDX-License-Identifier: Apache-2.0
// Requests to the appliance, the session, and the stream of its state.
import { S, haveWords, said } from './words.js';

export class ApiError extends Error {
  constructor(status, body) {
    super(said(body, 'error') ?? S.answered(status));
    this.status = status;
    this.body = body;
  }
}

const kAnswer_ms = 20000;
const kLongAnswer_ms = 60000;  // files, and what removes or packs many
const kVeryLongAnswer_ms = 3600000;  // a backup of a full disk
const kLogOut_ms = 5000;
const kPicture_ms = 5000;
const kSilent_s = 6;  // the appliance sends a beat every 2 s

/// A moment, for since_s().
export const now = () => ({ wall: Date.now(), steady: performance.now() });
const ago = (s) => ({ wall: Date.now() - 1000 * s, steady: performance.now() - 1000 * s });
/// Seconds since that moment: never negative, and neither too few because the machine slept (the
/// steady clock may have stood still) nor because its clock was set back.
export const since_s = (moment) =>
  Math.max(0, Date.now() - moment.wall, performance.now() - moment.steady) / 1000;

let session = null;
let onLoggedOff = () => {};
let touched = now();  // the session was last used

export const currentSession = () => session;
export const may = (permission) => session?.permissions.includes(permission) ?? false;
export const setLoggedOffHandler = (handler) => { onLoggedOff = handler; };
export const touchedAt = () => touched;

function endSession() {
  if (!session) return;
  session = null;
  onLoggedOff();
}

const asJson = (response) => response.json();
const errorOf = async (response) => new ApiError(response.status,
  await response.json().catch(() => null));

/// Sends a request; returns what `read` makes of the answer.
async function ask(method, path, body,
  { background = false, timeout_ms = kAnswer_ms, read = asJson } = {}) {
  const headers = {};
  if (method !== 'GET' && session) headers['X-CSRF-Token'] = session.csrf_token;
  if (body !== undefined) headers['Content-Type'] = 'application/json';
  if (background) headers['X-Plumb-Background'] = '1';
  const asked = now();
  let response;
  try {
    response = await fetch(path, {
      method,
      headers,
      body: body === undefined ? undefined : JSON.stringify(body),
      cache: 'no-store',
      signal: AbortSignal.timeout(timeout_ms),
    });
    if (response.ok) {
      if (!background) noteUse(asked);
      return await read(response);
    }
  } catch {
    await haveWords;
    throw new ApiError(0, { error: S.noAnswer });
  }
  await haveWords;
  const problem = await errorOf(response);
  if (response.status === 401) endSession();
  throw problem;
}

/// Answers may come in another order than their requests: the latest use counts.
/// @param when  The request began, which is not later than it counted there.
function noteUse(when) {
  if (!takeUse(when)) return;
  // Each tab has a steady clock of its own.
  channel?.postMessage({ kind: 'used', age_s: since_s(when) });
}
function takeUse(when) {
  const isLater = since_s(when) < since_s(touched);
  if (isLater) touched = when;
  return isLater;
}

/// The bytes of an answer, with its progress: `onPart(received, total)`, total 0 where not known.
async function readParts(response, onPart) {
  const total = Number(response.headers.get('Content-Length') ?? 0);
  const parts = [];
  let received = 0;
  for (const reader = response.body.getReader();;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    received += value.length;
    onPart(received, total);
  }
  return new Blob(parts).arrayBuffer();
}

const nameOf = (response) =>
  /filename="([^"]+)"/.exec(response.headers.get('Content-Disposition') ?? '')?.[1] ?? 'plumb';
const readFile = async (response) => ({ blob: await response.blob(), name: nameOf(response) });
const orNothing = (response) => response.json().catch(() => ({}));
const api = (path) => `/api/v1/${path}`;
/// Sends bytes with their progress, which fetch does not report: `onPart(share)`.
export const sendFile = (path, file, failed, onPart, headers = {}) => new Promise((
  resolve, reject,
) => {
  const request = new XMLHttpRequest();
  request.open('POST', api(path));
  request.setRequestHeader('X-CSRF-Token', session.csrf_token);
  request.setRequestHeader('Content-Type', 'application/octet-stream');
  for (const [name, value] of Object.entries(headers)) request.setRequestHeader(name, value);
  request.upload.onprogress = (event) => onPart(event.loaded / event.total);
  request.onload = () => {
    let answer = null;
    try { answer = JSON.parse(request.responseText); } catch { /* no answer of ours */ }
    if (request.status < 300) resolve(answer);
    else reject(answer ? new ApiError(request.status, answer) : new Error(failed));
  };
  request.onerror = () => reject(new Error(failed));
  request.send(file);
});
export const get = (path, background = false) => ask('GET', api(path), undefined, { background });
export const getOrNull = (path) => get(path, true).catch(() => null);
/// Null only where the appliance says that there is none: what it could not be asked for is not
/// left out.
export const getIfThere = (path) => get(path, true).catch((error) => {
  if (error.status >= 400 && error.status < 500) return null;
  throw error;
});
/// For pictures that are asked for again and again.
export const fetchPicture = (path) => fetch(api(path), {
  headers: { 'X-Plumb-Background': '1' }, cache: 'no-store',
  signal: AbortSignal.timeout(kPicture_ms),
});
/// Calls `task` until the returned function is called; it returns after how many milliseconds
/// again.
export function repeat(task) {
  let stopped = false;
  const next = async () => {
    if (stopped) return;
    const wait_ms = await task();
    setTimeout(next, wait_ms);
  };
  next();
  return () => { stopped = true; };
}
export const getBytes = (path, onPart, timeout_ms = kLongAnswer_ms) =>
  ask('GET', api(path), undefined, {
    timeout_ms,
    read: (response) => (onPart ? readParts(response, onPart) : response.arrayBuffer()),
  });
export const post = (path, body) => ask('POST', api(path), body, { read: orNothing });
export const postForFile = (path) =>
  ask('POST', api(path), undefined, { timeout_ms: kLongAnswer_ms, read: readFile });
export const put = (path, body) => ask('PUT', api(path), body);
export const removeFor = (path, body) => ask('DELETE', api(path), body,
  { timeout_ms: kLongAnswer_ms, read: orNothing });
/// For requests that copy much: the answer comes when they are done.
export const postLong = (path, body) => ask('POST', api(path), body,
  { timeout_ms: kVeryLongAnswer_ms, read: orNothing });
export const remove = (path) => ask('DELETE', api(path), undefined, { timeout_ms: kLongAnswer_ms });
/// A file of a scan; the texts of a picture are in the language of the page.
export function fileUrl(scanId, name, download) {
  const asked = [download && 'download',
    name.endsWith('.png') && `language=${document.documentElement.lang}`].filter(Boolean);
  return `/api/v1/scans/${scanId}/files/${name}${asked.length ? `?${asked.join('&')}` : ''}`;
}

/// The session, or null; `setupRequired` says that there is no account yet, `fault` why nobody can
/// log in.
export async function loadSession() {
  try {
    session = await get('session');
    return { session, setupRequired: false, fault: '', certificate: '' };
  } catch (error) {
    if (error.status !== 401) throw error;
    session = null;
    return {
      session: null,
      setupRequired: error.body?.setup_required ?? false,
      fault: said(error.body, 'fault') ?? '',
      certificate: error.body?.certificate ?? '',
    };
  }
}

export async function logOut() {
  await ask('POST', '/api/v1/logout', undefined, { timeout_ms: kLogOut_ms, read: orNothing });
  session = null;
}

/// Tabs of one browser share one stream: HTTP/1.1 allows six connections to a host, and a stream
/// takes one for itself. One visible tab has the stream and passes on what comes.
const channel = typeof BroadcastChannel === 'function' ? new BroadcastChannel('plumb-live') : null;
const kMe = `${Date.now()}-${Math.random()}`;
const kPulse_s = 1;
const kNoPulse_s = 3.5;
const kHello_ms = 150;
const kPoll_ms = 2000;
const kStreamAgain_ms = 15000;

/// The newest state and who wants to know; when it came, and when anything came at all.
export const live = {
  status: null,
  received: now(),
  monitor: null,  // what live monitoring said last, and when
  monitorAt: now(),
  heard: now(),      // from the appliance, by the tab that has the stream
  pulse: now(),      // from that tab, by the others
  listeners: new Set(),
  source: null,
  wanted: false,  // by a person who is logged in, whether there is a stream at the moment or not
  leads: false,
  polls: 0,
  connected: true,

  /// Returns a promise that is done once the first state is there, or cannot be had.
  open() {
    this.close();
    this.wanted = true;
    const first = this.refreshed();
    if (!channel) {
      this.lead();
      return first;
    }
    const before = now();
    this.pulse = before;
    channel.postMessage({ kind: 'hello', from: kMe });
    setTimeout(() => {
      const answered = this.pulse !== before;
      if (this.wanted && !this.leads && !answered && !document.hidden) this.lead();
    }, kHello_ms);
    return first;
  },
  close() {
    this.wanted = false;
    this.stopLeading();
  },
  refresh() { this.refreshed(); },
  /// Done once the newest state was asked for and taken.
  async refreshed() {
    try {
      const status = await get('status', true);
      if (this.wanted) this.take(status);
    } catch { /* the stream says that there is no connection */ }
  },

  lead() {
    this.stopLeading();
    this.leads = true;
    this.heard = now();
    const source = new EventSource('/api/v1/events');
    this.source = source;
    const on = (kind, take) => source.addEventListener(kind, (event) => {
      this.heard = now();
      take(event);
    });
    on('beat', () => {});
    on('status', (event) => this.pass({ kind: 'status', status: JSON.parse(event.data) }));
    on('monitor', (event) => this.pass({ kind: 'monitor', monitor: JSON.parse(event.data) }));
    for (const kind of ['result', 'data', 'update']) on(kind, () => this.pass({ kind }));
    on('logged_off', () => this.pass({ kind: 'logged_off' }));
    source.onopen = () => {
      ++this.polls;
      const wasConnected = this.connected;
      this.connection(true);
      // Messages since the page asked for its data, or since the last stream, are not repeated.
      if (wasConnected) this.pass({ kind: 'data' });
    };
    source.onerror = () => {
      if (source.readyState !== EventSource.CLOSED) {
        this.connection(false);
        return;
      }
      // The browser gave up: the session is over, the appliance restarts, or it has no stream left.
      this.source = null;
      this.poll();
    };
    this.sayPulse();
  },
  stopLeading() {
    ++this.polls;
    this.source?.close();
    this.source = null;
    if (this.leads) channel?.postMessage({ kind: 'left', from: kMe });
    this.leads = false;
  },
  sayPulse() {
    channel?.postMessage({ kind: 'pulse', from: kMe, connected: this.connected });
  },

  /// Without a stream: asks for the state until one can be had again.
  async poll() {
    const mine = ++this.polls;
    const begun = performance.now();
    let result = this.status?.last_result?.id;
    while (this.leads && mine === this.polls) {
      try {
        const status = await get('status', true);
        if (mine !== this.polls) return;
        this.heard = now();
        this.connection(true);
        this.pass({ kind: 'status', status });
        if (status.last_result?.id !== result) {
          result = status.last_result?.id;
          this.pass({ kind: 'result' });
          this.pass({ kind: 'data' });
        }
      } catch (error) {
        if (mine !== this.polls || error.status === 401) return;
        this.connection(false);
      }
      await new Promise((ready) => { setTimeout(ready, kPoll_ms); });
      if (mine === this.polls && performance.now() - begun > kStreamAgain_ms) {
        this.lead();
        return;
      }
    }
  },

  /// A stream may die without an end that the browser sees (sleep, a network that is gone): then
  /// not even the beat comes. A tab that led may be gone without a word.
  watch() {
    if (!this.wanted || document.hidden) return;
    if (!this.leads) {
      if (!channel || since_s(this.pulse) > kNoPulse_s) this.lead();
      return;
    }
    this.sayPulse();
    if (since_s(this.heard) <= kSilent_s) return;
    this.connection(false);
    this.lead();
  },
  pass(message) {
    channel?.postMessage({ ...message, from: kMe });
    this.obey(message);
  },
  obey(message) {
    if (message.kind === 'status') this.take(message.status);
    else if (message.kind === 'monitor') this.hearMonitor(message.monitor);
    else if (message.kind === 'logged_off') {
      this.close();
      endSession();
    } else this.notify(message.kind);
  },
  /// Takes a message of another tab.
  hear(message) {
    if (message.kind === 'used') {
      takeUse(ago(message.age_s));
      return;
    }
    if (!this.wanted) return;
    if (message.kind === 'hello') {
      if (this.leads) {
        this.sayPulse();
        if (this.status) channel.postMessage({ kind: 'status', status: this.status, from: kMe });
      }
    } else if (message.kind === 'left') {
      setTimeout(() => this.watch(), 50 + 200 * Math.random());
      this.pulse = { wall: 0, steady: -1e9 };
    } else if (message.kind === 'pulse') {
      this.pulse = now();
      if (this.leads && message.from < kMe) this.stopLeading();
      if (!this.leads) this.connection(message.connected);
    } else if (!this.leads) {
      this.pulse = now();
      this.obey(message);
    }
  },
  take(status) {
    this.status = status;
    this.received = now();
    this.notify('status');
  },
  hearMonitor(monitor) {
    this.monitor = monitor;
    this.monitorAt = now();
    this.notify('monitor');
  },
  notify(kind) {
    for (const listener of [...this.listeners]) listener(kind);
  },
  connection(connected) {
    if (connected === this.connected) return;
    this.connected = connected;
    if (this.leads) this.sayPulse();
    this.notify('connection');
    if (connected) this.notify('data');  // messages sent while disconnected are not repeated
  },
  /// Calls listener(kind) until the returned function is called.
  listen(listener) {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  },
};
channel?.addEventListener('message', (event) => live.hear(event.data));
setInterval(() => live.watch(), 1000 * kPulse_s);
// A hidden tab needs no stream.
document.addEventListener('visibilitychange', () => {
  if (!live.wanted) return;
  if (document.hidden) live.stopLeading();
  else {
    live.refresh();
    live.watch();
    live.notify('data');
  }
});
window.addEventListener('pagehide', () => live.stopLeading());
