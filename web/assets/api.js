// Requests to the appliance, the session, and the stream of its state.
export class ApiError extends Error {
  constructor(status, body) {
    super(body?.error ?? `The appliance answered ${status}.`);
    this.status = status;
    this.body = body;
  }
}

let session = null;
let onLoggedOff = () => {};

export const currentSession = () => session;
export const may = (permission) => session?.permissions.includes(permission) ?? false;
export const setLoggedOffHandler = (handler) => { onLoggedOff = handler; };

async function ask(method, path, body, background) {
  const headers = {};
  if (method !== 'GET' && session) headers['X-CSRF-Token'] = session.csrf_token;
  if (body !== undefined) headers['Content-Type'] = 'application/json';
  if (background) headers['X-Plumb-Background'] = '1';
  let response;
  try {
    response = await fetch(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body), cache: 'no-store' });
  } catch {
    throw new ApiError(0, { error: 'The appliance does not answer.' });
  }
  if (!response.ok) {
    const problem = await response.json().catch(() => null);
    if (response.status === 401 && session) {
      session = null;
      onLoggedOff();
    }
    throw new ApiError(response.status, problem);
  }
  return response;
}

export const get = async (path, background = false) => (await ask('GET', `/api/v1/${path}`, undefined, background)).json();
export const getBytes = async (path) => (await ask('GET', `/api/v1/${path}`)).arrayBuffer();
export const post = async (path, body) => (await ask('POST', `/api/v1/${path}`, body)).json().catch(() => ({}));
export const postForFile = async (path) => {
  const response = await ask('POST', `/api/v1/${path}`);
  return { blob: await response.blob(), name: /filename="([^"]+)"/.exec(response.headers.get('Content-Disposition') ?? '')?.[1] ?? 'plumb' };
};
export const put = async (path, body) => (await ask('PUT', `/api/v1/${path}`, body)).json();
export const remove = async (path) => (await ask('DELETE', `/api/v1/${path}`)).json();
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
  await post('logout');
  session = null;
}

/// The newest state and who wants to know. `at` is when it came, by a clock that does not jump.
export const live = {
  status: null,
  at: 0,
  listeners: new Set(),
  source: null,
  connected: true,

  open() {
    this.close();
    const source = new EventSource('/api/v1/events');
    this.source = source;
    source.addEventListener('status', (event) => this.take(JSON.parse(event.data)));
    for (const kind of ['result', 'data', 'update']) source.addEventListener(kind, () => this.tell(kind));
    source.addEventListener('logged_off', () => {
      this.close();
      session = null;
      onLoggedOff();
    });
    source.onopen = () => this.connection(true);
    source.onerror = () => {
      this.connection(false);
      if (source.readyState !== EventSource.CLOSED) return;
      // The browser gave up: the session is over, or the appliance restarts.
      this.close();
      setTimeout(() => get('session', true).then(() => this.open(), (error) => { if (error.status !== 401) this.open(); }), 2000);
    };
  },
  close() {
    this.source?.close();
    this.source = null;
  },
  take(status) {
    this.status = status;
    this.at = performance.now();
    this.tell('status');
  },
  tell(kind) {
    for (const listener of [...this.listeners]) listener(kind);
  },
  connection(connected) {
    if (connected === this.connected) return;
    this.connected = connected;
    this.tell('connection');
  },
  /// Calls listener(kind) until the returned function is called.
  listen(listener) {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  },
};
