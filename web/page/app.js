// SPDX-License-Identifier: Apache-2.0
// The page: who is logged in, which screen is shown, and the bar above it.
import {
  currentSession, get, live, loadSession, logOut, may, now, post, setLoggedOffHandler, since_s,
  touchedAt,
} from './api.js';
import { action, clear, forgetWarning, h, hint, say, warn } from './dom.js';
import { tellFieldErrors } from './field_errors.js';
import { kNobody, languageOf, useLanguage } from './language.js';
import { lastLogin, lastLoginWords } from './last_login.js';
import { mayLeave } from './leave.js';
import { drafts } from './plan_drafts.js';
import { adoptPreferences, applyTheme, looks } from './preferences.js';
import { listenToScanners } from './scanner.js';
import { kScreens } from './screens/all_screens.js';
import { stateHere } from './screens/common.js';
import { showFault, showFirstPassword, showLogin } from './screens/login.js';
import { quickLogIn, quickPeople, rememberQuickPeople } from './screens/quick_login.js';
import { followReference, followSession, forgetSession } from './treatment.js';
import { S, said } from './words.js';

const kAskAgain_ms = 3000;
const kUseEvery_s = 30;
const kWarn_s = 120;
const kSayLeft_s = [10, 30, 60];  // the seconds are announced at these only, and once at the start
const main = document.getElementById('main');
const top = document.getElementById('top');
let cleanUp = null;
let turn = 0;
let waiting = false;  // for the appliance, to come in or to leave
let opening = 0;      // for what screens need before the first of them
let shownHash = '';
let failed = false;   // the screen could not be shown
let faulty = false;   // nobody can log in, and the page says why

const route = () => {
  const [name, argument] = location.hash.replace(/^#\/?/, '').split('/');
  return { name: kScreens[name] ? name : 'status', argument };
};

let drawnFor;  // null: for nobody
/// Built once per login, so that the focus stays where it is from screen to screen.
function drawTop() {
  const session = currentSession();
  const isIn = session && session.role !== 'display' && !session.password_change_required;
  top.hidden = false;
  if (drawnFor !== session) {
    drawnFor = session;
    if (isIn) buildTop(session);
    else clear(top, h('p', { class: 'brand' }, S.product), looks(session?.user ?? kNobody));
  }
  if (!isIn) return;
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
  const nav = h('nav', { 'aria-label': S.nav.label, id: 'nav' }, links);
  // On a phone the menu takes no room until it is asked for.
  const menu = h('button', {
    class: 'quiet menu', type: 'button', 'aria-expanded': 'false', 'aria-controls': 'nav',
  }, '☰ ', S.nav.menu);
  const open = (wanted) => {
    top.classList.toggle('menu-open', wanted);
    menu.setAttribute('aria-expanded', String(wanted));
  };
  menu.addEventListener('click', () => open(!top.classList.contains('menu-open')));
  nav.addEventListener('click', () => open(false));
  clear(top,
    h('a', { class: 'brand', href: '#/status' }, S.product), menu, nav,
    h('div', { class: 'mine' },
      h('p', { class: 'chip', id: 'chip' }),
      h('p', { class: 'who' }, session.is_quick ? S.login.quickly(session.user)
        : S.loggedInAs(session.user, S.roles[session.role])),
      looks(session.user), handOverButton(session),
      h('button', { class: 'quiet log-out', onclick: () => leave().catch(report) }, S.logOut)));
}

/// There while somebody else of the shift can take over here.
function handOverButton(session) {
  const button = h('button', { class: 'quiet change-person', hidden: true }, S.login.switchPerson);
  const others = async () => (await quickPeople()).filter((name) => name !== session.user);
  button.addEventListener('click', async () => {
    const people = await others();
    if (!people.length) button.hidden = true;
    else if (mayLeave()) handOver(people);
  });
  others().then((people) => { button.hidden = !people.length; });
  return button;
}

/// What is open stays open, and the screen stays: only the person changes.
function handOver(people) {
  const place = h('div', { class: 'login' });
  const box = h('dialog', { class: 'session-alert', 'aria-label': S.login.switchPerson }, place);
  const close = async () => box.close();
  box.addEventListener('close', () => box.remove());
  document.body.append(box);
  box.showModal();
  quickLogIn(place, people, async (entered) => {
    await post('session/hand-over', entered);
    box.close();
    drafts.removeAll();
    live.close();
    forgetSession();
    await begin();
  }, action(S.cancel, close, {}));
}

let lastState = null;
function drawChip() {
  document.body.classList.toggle('disconnected', !live.connected);
  const chip = document.getElementById('chip');
  if (!chip || !live.status) return;
  const state = stateHere(live.status);
  chip.dataset.state = live.connected ? state : 'offline';
  const words = live.connected ? S.states[state]
    : `${S.lastKnown(S.states[state])}${S.lastKnownAge(Math.floor(since_s(live.received)))}`;
  if (chip.textContent !== words) chip.textContent = words;
  if (state === lastState) return;
  lastState = state;
  say(S.states[state]);
}

async function show() {
  const mine = ++turn;
  cleanUp?.();
  cleanUp = null;
  failed = false;
  shownHash = location.hash;
  warn(live.connected ? '' : S.offline);
  const { name, argument } = route();
  drawTop();
  watchSession();
  const screen = kScreens[name];
  const place = h('div', { class: `screen ${name}` }, hint(S.loading));
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
    clear(place, h('h1', { class: 'visually-hidden' }, S.nav[screen.parent ?? name]),
      h('p', { class: 'card' }, error.message));
  }
}

/// The focus goes to the new screen at once: later, when its data has come, somebody may have moved
/// it.
function showFocused() {
  const shown = show();
  // Unless the screen has focused one of its own fields.
  if (!main.contains(document.activeElement)) main.focus({ preventScroll: true });
  return shown;
}

/// The answer to `question`. Until the appliance answers, the page shows only that it does not, and
/// asks again.
async function ask(question, text = () => S.offline) {
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
        clear(main, h('h1', { class: 'visually-hidden' }, S.product),
          h('p', { class: 'card' }, error.status ? error.message : text()));
        await new Promise((ready) => { setTimeout(ready, kAskAgain_ms); });
      }
    }
    return null;  // another question has taken its place
  } finally {
    if (mine === turn) waiting = false;
  }
}

async function leave() {
  if (!mayLeave()) return;
  drafts.removeAll();
  live.close();
  forgetSession();
  await ask(logOut, () => S.leavingOffline).catch(() => {});
  await begin();
}

async function speak(who, language = languageOf(who)) {
  if (!await useLanguage(language)) return;
  document.querySelector('.skip').textContent = S.skip;
  const notice = document.querySelector('.notice');
  notice.setAttribute('aria-label', S.notice.label);
  clear(notice.firstElementChild, h('strong', {}, S.notice.strong), ` ${S.notice.text}`);
}

const asked = [];  // the session at the start, beside the words
/// @param message  Gives the text to show above the log-in, in its language.
async function begin(message) {
  const found = await ask(() => asked.pop() ?? loadSession());
  if (!found) return;
  // Screens need the words and the settings. Who goes to another one meanwhile gets that, once.
  ++opening;
  const isIn = await enter(found, message).finally(() => { --opening; });
  if (isIn) await showFocused();
}
/// Whether there is a screen to show; otherwise it shows what has to be done before.
async function enter({ session, setupRequired, fault, certificate }, message) {
  if (session) adoptPreferences(session);
  if (session?.has_pin) rememberQuickPeople();
  await speak(session?.user ?? kNobody);
  applyTheme(session?.user ?? kNobody);
  drawnFor = undefined;
  drawTop();
  if (!session || session.role === 'display') {
    document.title = `${S.login.title} · ${S.product}`;
    if (fault) {
      faulty = true;
      showFault(main, fault).then(() => {
        faulty = false;
        return begin();
      });
      return false;
    }
    showLogin(main, setupRequired, certificate, async () => {
      await begin();
      const answer = currentSession() && await lastLogin();
      if (answer?.failed > 0 || answer?.changes.length > 0) warn(lastLoginWords(answer));
      else if (answer) say(lastLoginWords(answer), true);
    });
    if (message) warn(message());
    return false;
  }
  if (session.password_change_required) {
    document.title = `${S.login.firstTitle} · ${S.product}`;
    showFirstPassword(main, session.user, () => begin());
    return false;
  }
  await live.open();
  return true;
}

/// A result that arrives while the sweep is shown is opened at once. A failed scan is announced,
/// and no older result is shown in its place. The state says that a sweep has ended, not a message
/// of its own: that can be lost with the connection, and the state then comes with the next one.
async function followScan() {
  const { state, sensor } = live.status;
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
  if (scans[0]?.outcome === 'failed') {
    warn(`${S.result.failed}: ${said(scans[0], 'failure')}`);
  }
}

/// Pointer and keys count as use: who draws a plan is not logged out at Save. Two minutes before
/// the end the page warns.
let used = now();
let saidLeft_s = null;  // the step at which it was announced last; null: no warning is shown
for (const kind of ['pointerdown', 'keydown', 'wheel', 'input']) {
  document.addEventListener(kind, () => {
    if (!currentSession() || since_s(used) < kUseEvery_s) return;
    used = now();
    if (since_s(touchedAt()) >= kUseEvery_s) get('session').catch(() => {});
  }, { capture: true, passive: true });
}
/// The button and a sweep are use, too, of the screens that show them.
let seenState = null;
function noteSweep() {
  const { state } = live.status ?? {};
  const isUse = seenState !== null && state !== seenState && kSweep.includes(state);
  const hasEnded = kMakesResult.includes(seenState) && !kMakesResult.includes(state);
  seenState = state ?? null;
  if (hasEnded && route().name === 'scan') followScan().catch(() => {});
  if (isUse && kActOnSession.includes(route().name) && !document.hidden) {
    used = now();
    get('session').catch(() => {});
  }
}
function watchIdle() {
  const session = currentSession();
  if (!session || !live.wanted) return;
  const idle_s = 60 * session.idle_logout_min;
  const left_s = Math.floor(idle_s - since_s(touchedAt()));
  if (left_s > Math.min(kWarn_s, idle_s / 2) || left_s <= 0) {
    if (saidLeft_s !== null) endIdle();
    return;
  }
  if (saidLeft_s === null) {
    const stay = h('button', { type: 'button' }, S.stay);
    stay.addEventListener('click', () => get('session').catch(() => {}));
    clear(document.getElementById('idle'),
      h('section', { class: 'alert', 'aria-label': S.idle }, h('span', { id: 'idle-text' }), stay));
  }
  document.getElementById('idle-text').textContent = S.logOffSoon(left_s);
  const step = kSayLeft_s.find((one) => left_s <= one) ?? Infinity;
  if (step === saidLeft_s) return;
  saidLeft_s = step;
  document.getElementById('idle-said').textContent = S.logOffSoon(left_s);
}
function endIdle() {
  clear(document.getElementById('idle'));
  clear(document.getElementById('idle-said'));
  saidLeft_s = null;
}
setInterval(() => {
  watchIdle();
  if (!live.connected) drawChip();
}, 1000);

const report = (error) => clear(main, h('p', { class: 'card' }, error.message));
let lastPurpose = null;
/// Screens on which users act on the open session: they scan, or use a result. Opening another
/// patient there asks whether to close this session.
const kActOnSession = ['scan', 'result'];
const kMakesResult = ['scanning', 'working'];
const kSweep = [...kMakesResult, 'result'];
const watchSession = () => {
  const { name, argument } = route();
  // A result that was opened from the history is read, not acted on.
  const acts = kActOnSession.includes(name) && !(name === 'result' && argument);
  followSession(acts, () => live.notify('acknowledged'));
  followReference(acts);
};

function listen() {
  listenToScanners();
  live.listen((kind) => {
    lastPurpose = live.status?.scan?.purpose ?? lastPurpose;
    if (kind === 'connection') warn(live.connected ? '' : S.offline);
    if (kind === 'connection' && live.connected && failed) show();
    if (kind === 'status' || kind === 'connection') drawChip();
    if (kind === 'status' && live.status.sensor.present) forgetWarning(S.scan.lost);
    if (kind === 'status') {
      watchSession();
      noteSweep();
    }
  });
  setLoggedOffHandler(() => {
    live.close();
    forgetSession();
    endIdle();
    begin(() => S.loggedOff).catch(report);
  });
  window.addEventListener('plumb-language', async () => {
    const session = currentSession();
    await speak(session?.user ?? kNobody);
    drawnFor = undefined;
    drawTop();
    top.querySelector('.looks summary').focus();
    if (faulty) return;  // it says itself again in a moment
    if (!session || session.password_change_required) await begin();
    else await show();
  });
  window.addEventListener('hashchange', () => {
    if (!currentSession() || waiting || opening) return;
    if (location.hash === shownHash) return;
    if (!mayLeave()) {
      history.replaceState(null, '', shownHash || '#/status');
      return;
    }
    showFocused();
  });
}

tellFieldErrors();
if (location.pathname === '/room') {
  import('./screens/room.js').then(({ showRoom }) => showRoom(main, { speak, applyTheme }))
    .catch(report);
} else if (location.pathname === '/breath') {
  import('./monitoring/breath.js').then(({ showBreath }) => showBreath(main, { speak, applyTheme }))
    .catch(report);
} else {
  listen();
  // Until the user is known, the page is in the language of the login screen.
  applyTheme(kNobody);
  asked.push(loadSession());
  speak(kNobody).catch(report);
  begin().catch(report);
}
