// SPDX-License-Identifier: Apache-2.0
// Computes the couch readings to set from the present ones: nobody has to add in their head.
import { live } from '../api.js';
import { clear, field, h, hint } from '../dom.js';
import { kAxes } from '../numbers.js';
import { S } from '../words.js';

const kMax_cm = 300;

/// A reading as people type it: nothing where it is not a number that a couch could show.
export function readingOf(text) {
  const words = text.trim().replace(',', '.').replace('−', '-');
  if (!/^[+-]?\d{1,3}(\.\d{1,2})?$/.test(words)) return null;
  const value = Number(words);
  return Math.abs(value) <= kMax_cm ? value : null;
}

/// The value to set the axis to, in centimetres with one digit as couches show it; a shift that is
/// not known to differ from nothing leaves the axis where it is.
export function targetOf(reading_cm, { value, still }) {
  const shift_cm = still ? 0 : value / 10;
  return Math.round(10 * (reading_cm + shift_cm)) / 10;
}

/// Only for a result that commands moves, and where the room's axes are known.
export function couchReadings({ result, details }) {
  const text = S.result;
  const roomKnown = live.status?.room?.known && details?.body?.room_known !== false;
  if (result?.verdict !== 'move' || !roomKnown) return null;
  const shifts = result.numbers.filter((row, i) => kAxes[i].shift && row.value !== null);
  if (!shifts.length) return null;
  const rows = shifts.map((shift) => {
    const input = h('input', {
      inputmode: 'decimal', autocomplete: 'off', maxlength: 8, size: 8,
    });
    const target = h('output', { class: 'couch-target', 'aria-live': 'polite' });
    input.addEventListener('input', () => {
      const reading = readingOf(input.value);
      const bad = input.value.trim() !== '' && reading === null;
      input.setAttribute('aria-invalid', String(bad));
      if (bad) clear(target, text.couchBad);
      else if (reading === null) clear(target);
      else {
        const value = targetOf(reading, shift);
        clear(target, text.couchSet(text.axes[shift.name],
          `${value < 0 ? '−' : ''}${Math.abs(value).toFixed(1).replace('.', S.decimal)}`));
      }
    });
    return h('div', { class: 'couch-axis' }, field(`${text.axes[shift.name]} (cm)`, input), target);
  });
  return h('details', { class: 'couch' }, h('summary', {}, text.couch),
    hint(text.couchHint), h('div', { class: 'couch-axes' }, rows));
}
