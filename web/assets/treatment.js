// The treatment session as this browser knows it: what people open and close here, and the alert
// when somebody else changes it.
import { live, post } from './api.js';
import { action, clear, done, h } from './dom.js';
import { S } from './strings.js';

const kSeen = 'plumb-session-seen';
let seen;          // the session that the person here knows to be open; undefined: not yet known
let own = 0;       // changes of our own that are on their way
let alertBox = null;

/// Kept in the tab, so that a reload does not count as having seen a change.
function remember(session) {
  if (seen !== undefined && seen?.id === session?.id) return;
  seen = session;
  try { sessionStorage.setItem(kSeen, JSON.stringify(session)); } catch { /* for this page only */ }
}
function forget() {
  seen = undefined;
  try { sessionStorage.removeItem(kSeen); } catch { /* there is none */ }
}
function remembered() {
  try {
    const kept = sessionStorage.getItem(kSeen);
    return kept === null ? undefined : JSON.parse(kept);
  } catch {
    return undefined;
  }
}

const nameOf = (session) => (session
  ? [session.patient_code, session.fraction && S.session.fraction(session.fraction)]
    .filter(Boolean).join(', ')
  : S.session.none);
export const sessionName = nameOf;

/// @param isOurs  Whether that session, or null, is what the change leads to.
async function asOwn(change, isOurs) {
  ++own;
  const before = live.received;
  let isDone = false;
  try {
    await change();
    isDone = true;
  } finally {
    await live.refreshed();
    --own;
    const isKnown = live.received !== before;
    if (isDone && !isKnown) forget();
    if (isDone && isKnown && isOurs(live.status.session)) remember(live.status.session);
    // Otherwise somebody else changed the session first, or again.
    if (isKnown) live.notify('status');
  }
}

/// @param replaces  Id of the session of another patient that the person has agreed to close.
export const openPatient = (patient, purpose, reason = '', replaces = '') => asOwn(async () => {
  await post(`patients/${patient.id}/open`, { purpose, reason, replaces });
  done(S.patients.opened(patient.code));
}, (now) => now?.patient_id === patient.id && now.purpose === purpose);

export const closeSession = (session) => asOwn(async () => {
  await post('treatment/close', { session_id: session.id });
  done(S.session.closed);
}, (now) => !now);

/// False while somebody else's change has not been acknowledged here: no scan starts from here.
export const isAcknowledged = () => alertBox === null;

function showAlert(before, after, isModal, acknowledged) {
  const text = S.session;
  const button = h('button', { class: 'primary', type: 'button' }, text.acknowledge);
  const words = [h('p', { class: 'lead' }, text.changed(nameOf(before), nameOf(after))),
    after?.opened_by && h('p', {}, text.changedBy(after.opened_by)), h('p', {}, text.checkCouch)];
  button.addEventListener('click', acknowledged);
  if (!isModal) {
    const bar = h('div', { class: 'session-alert' },
      h('div', {}, h('strong', {}, text.changedTitle), words), button);
    document.getElementById('session-changed').append(bar);
    return bar;
  }
  const box = h('dialog', { class: 'session-alert', 'aria-labelledby': 'session-alert-title' },
    h('h2', { id: 'session-alert-title' }, text.changedTitle), words, button);
  box.addEventListener('cancel', (event) => event.preventDefault());
  document.body.append(box);
  box.showModal();
  return box;
}

function removeAlert() {
  alertBox?.close?.();
  alertBox?.remove();
  alertBox = null;
}

/// To be called with every status, and when the screen or the language is another one.
/// @param isModal  Whether the screen shown acts on who is open: then nothing else can be used
/// before it is acknowledged. Elsewhere the alert stands above the screen until then.
export function followSession(isModal, changed) {
  if (!live.status || own > 0) return;
  const now = live.status.session;
  if (seen === undefined) seen = remembered();
  if (seen === undefined || seen?.id === now?.id) {
    remember(now);
    if (!alertBox) return;
    removeAlert();  // it is the acknowledged session again
    changed();
    return;
  }
  const shown = JSON.stringify([now?.id, isModal, S.languageName]);
  if (alertBox?.dataset.shown === shown) return;
  removeAlert();
  alertBox = showAlert(seen, now, isModal, () => {
    removeAlert();
    remember(now);
    changed();
  });
  alertBox.dataset.shown = shown;
  changed();
}

export function forgetSession() {
  forget();
  removeAlert();
}

/// Who is open, which fraction, and how to close: on top of the screens that depend on it.
export function sessionLine(place, { mayClose }) {
  const draw = () => {
    const session = live.status?.session;
    const { status } = live;
    const text = S.session;
    if (!session) {
      clear(place, h('strong', { class: 'code-big none' }, text.none),
        h('span', { class: 'hint' }, text.noneHint), ' ',
        h('a', { href: '#/patients' }, S.scan.choose));
      return;
    }
    const running = status.state === 'scanning' || status.state === 'working';
    const close = mayClose && !running && action(text.close, () => closeSession(session), {});
    clear(place, h('strong', { class: 'code-big' }, session.patient_code),
      h('span', {}, session.purpose === 'reference' ? S.purposes.reference
        : text.fraction(session.fraction)),
      h('span', {}, text.scans(session.num_scans)),
      h('span', { class: 'hint' }, text.openedBy(session.opened_by)), close);
  };
  return draw;
}
