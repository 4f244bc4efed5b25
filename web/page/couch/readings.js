// SPDX-License-Identifier: Apache-2.0
// Computes the couch readings to set from the present ones: nobody has to add in their head.
import { live } from '../api.js';
import { clear, field, h, hint } from '../dom.js';
import { kAxes } from '../numbers.js';
import { S } from '../words.js';
import { couchAxis, couchVersion } from './axes.js';

const kMax = { cm: 300, mm: 3000 };

/// A reading as people type it: nothing where it is not a number that a couch could show.
export function readingOf(text, unit = 'cm') {
  const words = text.trim().replace(',', '.').replace('−', '-');
  if (!/^[+-]?\d{1,4}(\.\d{1,2})?$/.test(words)) return null;
  const value = Number(words);
  return Math.abs(value) <= kMax[unit] ? value : null;
}

/// How couches show what they read: to the millimetre. Centimetres where no profile says otherwise.
const kUnsigned = { factor: 0.1, unit: 'cm', digits: 1 };
function scaleOf(axis) {
  const { factor, unit } = couchAxis(axis);
  return couchVersion() ? { factor, unit, digits: unit === 'cm' ? 1 : 0 } : kUnsigned;
}

/// The value to set the axis to; a shift that is not known to differ from nothing leaves the axis
/// where it is.
export function targetOf(reading, { value, still }, { factor, digits }) {
  const scale = 10 ** digits;
  return Math.round(scale * (reading + (still ? 0 : value * factor))) / scale;
}

/// Only for a result that commands moves, and where the room's axes are known.
export function couchReadings({ result, details }) {
  const text = S.result;
  const roomKnown = live.status?.room?.known && details?.body?.room_known !== false;
  if (result?.verdict !== 'move' || !roomKnown) return null;
  const shifts = result.numbers.filter((row, i) => kAxes[i].shift && row.value !== null);
  if (!shifts.length) return null;
  const rows = shifts.map((shift) => {
    const scale = scaleOf(kAxes.find(({ name }) => name === shift.name));
    const input = h('input', {
      inputmode: 'decimal', autocomplete: 'off', maxlength: 8, size: 8,
    });
    const target = h('output', { class: 'couch-target', 'aria-live': 'polite' });
    input.addEventListener('input', () => {
      const reading = readingOf(input.value, scale.unit);
      const bad = input.value.trim() !== '' && reading === null;
      input.setAttribute('aria-invalid', String(bad));
      if (bad) clear(target, text.couchBad(scale.unit));
      else if (reading === null) clear(target);
      else {
        const value = targetOf(reading, shift, scale);
        const shown = Math.abs(value).toFixed(scale.digits).replace('.', S.decimal);
        clear(target, text.couchSet(text.axes[shift.name], `${value < 0 ? '−' : ''}${shown}`,
          scale.unit));
      }
    });
    return h('div', { class: 'couch-axis' },
      field(`${text.axes[shift.name]} (${scale.unit})`, input), target);
  });
  return h('details', { class: 'couch' }, h('summary', {}, text.couch),
    hint(couchVersion() ? text.couchHintProfile(live.status.couch.name) : text.couchHint),
    h('div', { class: 'couch-axes' }, rows));
}
