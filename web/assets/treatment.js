// The treatment session as this browser knows it: what people open and close here, and the alert
// when somebody else changes it.
import { live, post } from './api.js';
import { action, clear, done, h } from './dom.js';
import { S } from './strings.js';

let seen;          // the session that was last shown to the person here; nothing: none was yet
let own = 0;       // changes of our own that are on their way
let alertBox = null;

const nameOf = (session) => (session
  ? [session.patient_code, session.fraction && S.session.fraction(session.fraction)]
    .filter(Boolean).join(', ')
  : S.session.none);
export const sessionName = nameOf;

async function asOwn(change) {
  ++own;
  try {
    return await change();
  } finally {
    await live.refreshed();
    seen = live.status?.session ?? null;
    --own;
  }
}

/// @param replaces  Id of the session of another patient that the person has agreed to close.
export const openPatient = (patient, purpose, reason = '', replaces = '') => asOwn(async () => {
  await post(`patients/${patient.id}/open`, { purpose, reason, replaces });
  done(S.patients.opened(patient.code));
});

export const closeSession = (session) => asOwn(async () => {
  await post('treatment/close', { session_id: session.id });
  done(S.session.closed);
});

/// False while somebody else's change has not been acknowledged here: no scan starts from here.
export const isAcknowledged = () => alertBox === null;

function showAlert(before, after, acknowledged) {
  const text = S.session;
  const button = h('button', { class: 'primary', type: 'button' }, text.acknowledge);
  const box = h('dialog', { class: 'session-alert', 'aria-labelledby': 'session-alert-title' },
    h('h2', { id: 'session-alert-title' }, text.changedTitle),
    h('p', { class: 'lead' }, text.changed(nameOf(before), nameOf(after))),
    after?.opened_by && h('p', {}, text.changedBy(after.opened_by)),
    h('p', {}, text.checkCouch), button);
  box.addEventListener('cancel', (event) => event.preventDefault());
  button.addEventListener('click', () => {
    box.close();
    box.remove();
    acknowledged();
  });
  document.body.append(box);
  box.showModal();
  return box;
}

/// To be called with every status.
/// @param watching  Whether the screen shown depends on who is open.
export function followSession(watching, changed) {
  const now = live.status?.session ?? null;
  if (seen === undefined || own > 0) {
    seen ??= now;
    return;
  }
  if ((seen?.id ?? null) === (now?.id ?? null)) {
    if (alertBox) endAlert(changed);  // it is again as the person here knows it
    seen = now;
    return;
  }
  if (!watching && !alertBox) {
    seen = now;
    return;
  }
  if (alertBox?.dataset.session === (now?.id ?? '')) return;
  alertBox?.close();
  alertBox?.remove();
  alertBox = showAlert(seen, now, () => {
    alertBox = null;
    seen = live.status?.session ?? null;
    changed();
  });
  alertBox.dataset.session = now?.id ?? '';
  changed();
}

function endAlert(changed) {
  alertBox.close();
  alertBox.remove();
  alertBox = null;
  changed();
}

export function forgetSession() {
  seen = undefined;
  alertBox?.remove();
  alertBox = null;
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
