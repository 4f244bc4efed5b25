// SPDX-License-Identifier: Apache-2.0
// Logging in with a PIN or a badge: first who it is, then the keypad.
import { get } from '../api.js';
import { action, clear, field, form, h } from '../dom.js';
import { S } from '../words.js';

const kKnown = 'plumb-quick';
const kMaxPin = 64;

/// Nobody is asked for in a browser in which nobody has a PIN.
export function rememberQuickPeople() {
  try { localStorage.setItem(kKnown, 'yes'); } catch { /* asked for after a password only */ }
}

/// Who can log in quickly in this browser now.
export async function quickPeople() {
  let isKnown = false;
  try { isKnown = localStorage.getItem(kKnown) !== null; } catch { /* it is not */ }
  const answer = isKnown && await get('login/people', true).catch(() => null);
  return answer?.people ?? [];
}

/// A field for a PIN; a scanner of badges types into it as well.
export const pinInput = (properties) => h('input', {
  type: 'password', autocomplete: 'off', required: true, maxlength: kMaxPin, ...properties,
});

function keypad(name, enter, back) {
  const text = S.login;
  // The keys below are for gloves: the keyboard of a tablet would cover them.
  const pin = pinInput({ inputmode: 'none', class: 'pin' });
  const key = (label, press, properties) => {
    const button = h('button', { type: 'button', ...properties }, label);
    button.addEventListener('click', () => {
      press();
      pin.focus();
    });
    return button;
  };
  const digit = (value) => key(value, () => { pin.value += value; });
  const element = form({ class: 'form' }, async () => {
    const typed = pin.value;
    pin.value = '';
    pin.focus();
    await enter({ name, pin: typed });
  }, field(text.pin, pin, text.pinHint), h('div', { class: 'keypad' },
    [...'123456789'].map(digit),
    key('⌫', () => { pin.value = pin.value.slice(0, -1); }, { 'aria-label': text.erase }),
    digit('0'), h('button', { class: 'primary' }, text.submit)));
  return { element: [h('h1', {}, text.pinOf(name)), element, action(text.back, back, {})], pin };
}

/// Large buttons for the people, then the keypad of one of them.
/// @param enter   Called with { name, pin }.
/// @param others  What stands below the people.
export function quickLogIn(place, people, enter, ...others) {
  const choose = async () => {
    clear(place, h('h1', {}, S.login.shift), h('div', { class: 'people' }, people.map((name) =>
      action(name, async () => {
        const pad = keypad(name, enter, choose);
        clear(place, pad.element);
        pad.pin.focus();
      }, { class: 'primary' }))), others);
    place.querySelector('button').focus();
  };
  choose();
}
