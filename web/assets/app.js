// The page: who is logged in, which screen is shown, and the bar above it.
import { currentSession, get, live, loadSession, logOut, may, setLoggedOffHandler } from './api.js';
import { clear, h, say, warn } from './dom.js';
import { showAudit } from './screens/audit.js';
import { showCheck } from './screens/check.js';
import { showLogin } from './screens/login.js';
import { showPatient, showPatients } from './screens/patients.js';
import { showPlan } from './screens/plan.js';
import { showResult } from './screens/result.js';
import { showScan } from './screens/scan.js';
import { showSettings } from './screens/settings.js';
import { showStatus } from './screens/status.js';
import { showUpdate } from './screens/update.js';
import { showUsers } from './screens/users.js';
import { S } from './strings.js';

const kScreens = {
  status: { show: showStatus, permission: 'view', nav: true },
  patients: { show: showPatients, permission: 'view', nav: true },
  patient: { show: showPatient, permission: 'view', parent: 'patients' },
  plan: { show: showPlan, permission: 'view', parent: 'patients' },
  scan: { show: showScan, permission: 'view', nav: true },
  result: { show: showResult, permission: 'view', nav: true },
  check: { show: showCheck, permission: 'view', nav: true },
  users: { show: showUsers, permission: 'login', nav: true },
  audit: { show: showAudit, permission: 'audit', nav: true },
  settings: { show: showSettings, permission: 'view', nav: true },
  update: { show: showUpdate, permission: 'view', nav: true },
};

const kAskAgain_ms = 3000;
const main = document.getElementById('main');
const top = document.getElementById('top');
let cleanUp = null;
let turn = 0;
let waiting = false;  // for the appliance, to come in or to leave
let failed = false;   // the screen could not be shown

const route = () => {
  const [name, argument] = location.hash.replace(/^#\/?/, '').split('/');
  return { name: kScreens[name] ? name : 'status', argument };
};

let drawnFor = null;
/// Built once per login, so that the focus stays where it is from screen to screen.
function drawTop() {
  const session = currentSession();
  top.hidden = !session;
  if (drawnFor !== session) {
    drawnFor = session;
    if (session) buildTop(session);
  }
  if (!session) return;
  const active = kScreens[route().name].parent ?? route().name;
  for (const link of top.querySelectorAll('nav a')) {
    if (link.hash === `#/${active}`) link.setAttribute('aria-current', 'page');
    else link.removeAttribute('aria-current');
  }
  drawChip();
}

function buildTop(session) {
  const links = Object.entries(kScreens)
    .filter(([, screen]) => screen.nav && may(screen.permission))
    .map(([name]) => h('a', { href: `#/${name}` }, S.nav[name]));
  clear(top,
    h('a', { class: 'brand', href: '#/status' }, S.product),
    h('nav', { 'aria-label': S.nav.label }, links),
    h('p', { class: 'chip', id: 'chip' }),
    h('p', { class: 'who' }, S.loggedInAs(session.user, S.roles[session.role])),
    h('button', { class: 'quiet', onclick: () => leave().catch(report) }, S.logOut));
}

let lastState = null;
function drawChip() {
  const chip = document.getElementById('chip');
  if (!chip || !live.status) return;
  const { state } = live.status;
  if (chip.dataset.state !== state || !live.connected) {
    chip.dataset.state = live.connected ? state : 'offline';
    chip.textContent = live.connected ? S.states[state] : S.offline;
  }
  if (state === lastState) return;
  lastState = state;
  say(S.states[state]);
}

async function show() {
  const mine = ++turn;
  cleanUp?.();
  cleanUp = null;
  failed = false;
  warn(live.connected ? '' : S.offline);
  const { name, argument } = route();
  drawTop();
  const screen = kScreens[name];
  const place = h('div', { class: `screen ${name}` }, h('p', { class: 'hint' }, S.loading));
  clear(main, place);
  document.title = `${S.nav[screen.parent ?? name]} · ${S.product}`;
  try {
    if (!may(screen.permission)) throw new Error(S.notAllowed);
    const done = await screen.show(place, argument);
    if (mine === turn) cleanUp = done ?? null;
    else done?.();
  } catch (error) {
    if (mine !== turn || !currentSession()) return;
    failed = true;
    clear(place, h('p', { class: 'card' }, error.message));
  }
}

/// The focus goes to the new screen at once: later, when its data has come, somebody may have moved it.
function showFocused() {
  const shown = show();
  main.focus({ preventScroll: true });
  return shown;
}

/// What `question` answers. As long as the appliance does not answer, nothing else is shown than that, and it is asked again.
async function ask(question, text = S.offline) {
  const mine = ++turn;
  waiting = true;
  cleanUp?.();
  cleanUp = null;
  try {
    while (mine === turn) {
      try {
        return await question();
      } catch (error) {
        if (error.status > 0 && error.status < 500) throw error;
        top.hidden = true;
        clear(main, h('p', { class: 'card' }, error.status ? error.message : text));
        await new Promise((ready) => { setTimeout(ready, kAskAgain_ms); });
      }
    }
    return null;  // somebody else asks
  } finally {
    if (mine === turn) waiting = false;
  }
}

async function leave() {
  live.close();
  await ask(logOut, S.leavingOffline).catch(() => {});
  await begin();
}

async function begin(message) {
  const found = await ask(loadSession);
  if (!found) return;
  const { session, setupRequired } = found;
  drawTop();
  if (!session) {
    document.title = `${S.login.title} · ${S.product}`;
    showLogin(main, setupRequired, () => begin());
    if (message) warn(message);
    return;
  }
  live.open();
  await showFocused();
}

/// A result that comes while the sweep is watched is shown at once; a scan that failed is said, and no older result is shown for it.
async function followScan() {
  const { state, sensor } = await get('status', true);
  if (state === 'result') {
    location.hash = lastPurpose === 'daily_check' ? '#/check' : '#/result';
    return;
  }
  if (state === 'fault') return;  // the screen says it
  if (!sensor.present) {
    warn(S.scan.lost);
    return;
  }
  const { scans } = await get('scans?limit=1', true);
  if (scans[0]?.outcome === 'failed') warn(`${S.result.failed}: ${scans[0].failure}`);
}

const report = (error) => clear(main, h('p', { class: 'card' }, error.message));
let lastPurpose = null;
live.listen((kind) => {
  lastPurpose = live.status?.scan?.purpose ?? lastPurpose;
  if (kind === 'connection') warn(live.connected ? '' : S.offline);
  if (kind === 'connection' && live.connected && failed) show();
  if (kind === 'status' || kind === 'connection') drawChip();
  if (kind === 'result' && route().name === 'scan') followScan().catch(() => {});
});
setLoggedOffHandler(() => { live.close(); begin(S.loggedOff).catch(report); });
window.addEventListener('hashchange', () => {
  if (!currentSession() || waiting) return;
  showFocused();
});
begin().catch(report);
