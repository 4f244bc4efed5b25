// SPDX-License-Identifier: Apache-2.0
// Scanners of wristbands type a code and Enter, wherever the focus is: one listener for the whole
// page takes such a burst, so that its Enter presses no button, and says whose wristband it is.
import {
  currentSession, get, getOrNull, live, may,
} from './api.js';
import { action, done, h, warn } from './dom.js';
import { confirmWristband } from './wristband.js';
import { S } from './words.js';

const kGap_ms = 30;       // between two characters; people are slower
const kEnter_ms = 100;
const kFewest = 4;

/// Codes are the same without regard to case, spaces and hyphens.
export const plainCode = (code) => code.replace(/[\s-]/g, '').toUpperCase();
/// Codes that people could take for each other have the same one.
export const lookOf = (code) => plainCode(code).replace(/[._]/g, '').replaceAll('O', '0')
  .replace(/[IL]/g, '1').replaceAll('S', '5').replaceAll('Z', '2').replaceAll('B', '8')
  .replace(/^0+(?=.)/, '');
/// Whether the last letter or digit is the check character of those before it (ISO/IEC 7064,
/// MOD 37,36): as HasCheckCharacter() of web/model/patient.hpp.
function hasCheckCharacter(code) {
  const values = [...plainCode(code).replace(/[._]/g, '')].map((one) => parseInt(one, 36));
  const last = values.pop();
  const sum = values.reduce((before, value) => ((before + value) % 36 || 36) * 2 % 37, 36);
  return values.length > 0 && (sum + last) % 36 === 1;
}

let box = null;

/// Another patient's wristband: nothing is opened or closed without an answer.
function ask(session, patient) {
  const text = S.scanner;
  box?.remove();
  const asked = h('dialog', { class: 'session-alert', 'aria-labelledby': 'scanner-title' },
    h('h2', { id: 'scanner-title' }, text.otherTitle),
    h('p', { class: 'lead' }, text.other(patient.code, session.patient_code)),
    h('div', { class: 'row' },
      action(text.stay(session.patient_code), async () => asked.close(), { class: 'primary' }),
      action(text.goTo(patient.code), async () => {
        asked.close();
        location.hash = `#/patient/${patient.id}`;
      }, {})));
  asked.addEventListener('close', () => asked.remove());
  box = asked;
  document.body.append(asked);
  asked.showModal();
}

async function answer(code) {
  const text = S.scanner;
  const { patients } = await get('patients', true);
  const same = patients.filter((patient) => plainCode(patient.code) === plainCode(code));
  const exact = same.find((patient) => patient.code.toUpperCase() === code.toUpperCase());
  const found = exact ?? (same.length === 1 ? same[0] : null);
  const { session, state } = live.status ?? {};
  if (!found && same.length) {
    warn(text.several(code, same.map((one) => one.code).join(', ')));
  } else if (!found) {
    const settings = await getOrNull('settings');
    const isMisread = settings?.code_check_character && !hasCheckCharacter(code);
    warn((isMisread ? text.misread : text.unknown)(code));
  } else if (session?.patient_id === found.id) {
    warn('');
    if (live.status.wants_wristband && may('scan')) await confirmWristband(session, code);
    else done(text.same(found.code));
  } else if (state === 'scanning' || state === 'working') {
    // A question over the page would hide the way to discard the scan.
    warn(text.otherRuns(found.code, session?.patient_code ?? S.session.none));
  } else if (session) {
    ask(session, found);
  } else {
    location.hash = `#/patient/${found.id}`;
  }
}

const isField = (element) => element?.matches?.('input, textarea, [contenteditable]');

/// A field that is to hold what is scanned has the attribute data-code.
export function listenToScanners() {
  let typed = '';
  let last_ms = -Infinity;
  let field = null;
  let before = '';
  document.addEventListener('keydown', (event) => {
    if (!currentSession() || !may('view') || event.ctrlKey || event.altKey || event.metaKey) return;
    const gap_ms = event.timeStamp - last_ms;
    if (event.key === 'Enter') {
      // What is in the field may have been replaced meanwhile: then the Enter is a person's.
      const isThere = !field || field.value.includes(typed.slice(0, kFewest));
      const isBurst = typed.length >= kFewest && gap_ms < kEnter_ms && isThere;
      const code = typed;
      typed = '';
      if (!isBurst) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      if (field?.dataset.code !== undefined) return;
      if (field) {
        field.value = before;
        field.dispatchEvent(new Event('input', { bubbles: true }));
      }
      answer(code.trim()).catch((error) => warn(error.message));
      return;
    }
    if (event.key.length !== 1) return;  // Shift, which scanners press for capitals
    if (gap_ms >= kGap_ms) {
      typed = '';
      field = isField(event.target) && event.target.type !== 'password' ? event.target : null;
      before = field?.value ?? '';
    }
    typed = isField(event.target) && !field ? '' : typed + event.key;
    last_ms = event.timeStamp;
    // Keys of maps and buttons mean nothing within a burst.
    if (typed.length > 1 && !field) {
      event.preventDefault();
      event.stopImmediatePropagation();
    }
  }, { capture: true });
}
