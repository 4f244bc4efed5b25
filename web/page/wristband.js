// SPDX-License-Identifier: Apache-2.0
// The wristband that the settings may ask for before each sweep.
import { may, post } from './api.js';
import {
  done, field, form, h, hint,
} from './dom.js';
import { S } from './words.js';

/// Lets one sweep of the open session begin, where the settings ask for it.
export async function confirmWristband(session, code) {
  await post('treatment/wristband', { session_id: session.id, code });
  done(S.scanner.confirmed(session.patient_code));
}

/// Above the button that begins a sweep, while the wristband has to be scanned first.
export function wristbandForm() {
  const text = S.scanner;
  const element = h('div', { class: 'wristband', hidden: true });
  let shown = '';
  const draw = ({ wants_wristband: isWanted, session, state }) => {
    const isHere = isWanted && session && may('scan') && !['scanning', 'working'].includes(state);
    element.hidden = !isHere;
    const key = isHere ? session.id : '';
    if (shown === key) return;
    shown = key;
    const code = h('input', {
      autocomplete: 'off', required: true, maxlength: 64,
    });
    element.replaceChildren(...(isHere ? [form({ class: 'form inline' }, async () => {
      const typed = code.value.trim();
      code.value = '';
      await confirmWristband(session, typed);
    }, field(text.wristband(session.patient_code), code),
    h('button', {}, text.wristbandSubmit)), hint(text.wristbandHint)] : []));
  };
  return { element, draw };
}
