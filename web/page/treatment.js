// SPDX-License-Identifier: Apache-2.0
// The treatment session as this browser knows it: what people open and close here, and the alert
// when somebody else changes it.
import { get, live, may, post } from './api.js';
import { action, clear, done, h } from './dom.js';
import { comparesWith, sourceVersion } from './screens/captured.js';
import { S, saidEach } from './words.js';

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

/// The session of that patient, which was just opened, is compared with what a person has chosen.
async function compareWith(patient, reference) {
  if (!reference) return;
  const { session } = await get('status', true);
  if (session?.patient_id !== patient || session.reference?.id === reference) return;
  await post('treatment/reference', { session_id: session.id, reference_id: reference });
}

/// @param more  reason; replaces: id of the session of another patient that the person has agreed
/// to close; reference: id of what a fraction is to be compared with, else it is the newest one.
export const openPatient = (patient, purpose, more) => asOwn(async () => {
  const { reason = '', replaces = '', reference = '' } = more;
  await post(`patients/${patient.id}/open`, { purpose, reason, replaces });
  await compareWith(patient.id, reference);
  done(S.patients.opened(patient.code));
}, (now) => now?.patient_id === patient.id && now.purpose === purpose);

/// @param more  replaces: as for openPatient(), also the id of another session of this patient;
/// reference: else the session goes on with its own.
export const resumeSession = (patient, session, more) => asOwn(async () => {
  const { replaces = '', reference = '' } = more;
  await post('treatment/resume', { session_id: session.id, replaces });
  await compareWith(patient.id, reference);
  done(S.session.resumed(session.fraction));
}, (now) => now?.id === session.id);

const end = (session) => asOwn(async () => {
  await post('treatment/close', { session_id: session.id });
  done(S.session.closed);
}, (now) => !now);

/// Asks first if the newest result has not been accepted.
export function closeSession(session) {
  const now = live.status?.session;
  if (!(now?.id === session.id ? now : session).has_unaccepted) return end(session);
  const text = S.session;
  return new Promise((answered) => {
    const box = h('dialog', { class: 'session-alert', 'aria-labelledby': 'close-title' },
      h('h2', { id: 'close-title' }, text.closeTitle),
      h('p', { class: 'lead' }, text.closeQuestion(nameOf(session))),
      h('div', { class: 'row' },
        action(text.closeKeep, async () => box.close(), { class: 'primary' }),
        action(text.closeAnyway, async () => {
          box.close();
          await end(session);
        }, { class: 'danger' })));
    box.addEventListener('close', () => {
      box.remove();
      answered();
    });
    document.body.append(box);
    box.showModal();
  });
}

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
  removeQuestion();
}

const kKept = 'plumb-reference-kept';
let question = null;   // about a newer reference
let questionOf = '';   // which one it is about

function removeQuestion() {
  question?.remove();
  question = null;
  questionOf = '';
}

const useReference = (session, wanted = session.newer_reference) => asOwn(async () => {
  await post('treatment/reference', { session_id: session.id, reference_id: wanted.id });
  done(S.session.referenceUsed(wanted.version));
}, (now) => now?.id === session.id);

async function planWords({ id, version }) {
  const { plan } = await get(`references/${id}`, true);
  const told = (value) => `${value}`.replace('.', S.decimal);
  return S.session.referencePlan(version, told(plan.tolerance.shift_mm),
    told(plan.tolerance.rotation_deg), S.plan.postures[plan.posture]);
}

async function askReference(session, mine) {
  const text = S.session;
  const [now, newer] = await Promise.all(
    [session.reference, session.newer_reference].map(planWords));
  if (questionOf !== mine) return;
  const keep = h('button', { type: 'button' }, text.referenceKeep(session.reference.version));
  const close = () => {
    question?.remove();
    question = null;
  };
  keep.addEventListener('click', () => {
    try { sessionStorage.setItem(kKept, mine); } catch { /* asked again after a reload */ }
    close();
  });
  question = h('dialog', { class: 'session-alert', 'aria-labelledby': 'reference-title' },
    h('h2', { id: 'reference-title' }, text.referenceTitle),
    h('p', { class: 'lead' }, text.referenceQuestion(now, newer)),
    h('div', { class: 'row' },
      action(text.referenceUse(session.newer_reference.version), async () => {
        await useReference(session);
        close();
      }, { class: 'primary' }), keep));
  question.addEventListener('cancel', (event) => event.preventDefault());
  document.body.append(question);
  question.showModal();
}

/// To be called as followSession(). When another reference is approved, people who may scan are
/// asked whether the open session keeps the one that it was opened with. Not during a sweep.
export function followReference(isActing) {
  const { session, state } = live.status ?? {};
  const newer = session?.newer_reference;
  const isRunning = state === 'scanning' || state === 'working';
  const key = newer && isActing && may('scan') && !isRunning && isAcknowledged()
    ? `${session.id} ${session.reference.id} ${newer.id} ${S.languageName}` : '';
  let kept = '';
  try { kept = sessionStorage.getItem(kKept) ?? ''; } catch { /* nothing is */ }
  if (key === questionOf) return;
  removeQuestion();
  if (!key || key === kept) return;
  questionOf = key;
  askReference(session, key).catch(() => { questionOf = ''; });  // the next status asks again
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
    const { reference, newer_reference: newer, other_reference: other } = session;
    const mayChoose = mayClose && !running;
    clear(place, h('strong', { class: 'code-big' }, session.patient_code),
      h('span', {}, session.purpose === 'reference' ? S.purposes.reference
        : text.fraction(session.fraction)),
      h('span', {}, text.scans(session.num_scans)),
      reference && h('span', {}, comparesWith(session)),
      saidEach(status, 'peer_notes').map(
        (one) => h('span', { class: 'caution', role: 'alert' }, one)),
      newer && h('span', { class: 'caution' }, text.referenceNewer(newer.version)),
      newer && mayChoose && action(text.referenceUse(newer.version),
        () => useReference(session), {}),
      other && other.id !== newer?.id && mayChoose && action(
        text.compareInstead(sourceVersion(other)), () => useReference(session, other), {}),
      h('span', { class: 'hint' }, text.openedBy(session.opened_by)), close);
  };
  return draw;
}
