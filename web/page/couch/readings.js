// SPDX-License-Identifier: Apache-2.0
// Computes the couch readings to set from the present ones: nobody has to add in their head.
import { live } from '../api.js';
import { clear, field, h, hint } from '../dom.js';
import { kAxes } from '../numbers.js';
import { S } from '../words.js';
import { couchAxis, couchVersion } from './axes.js';

const kMax = { cm: 300, mm: 3000, '°': 360 };

/// A reading as people type it: nothing where it is not a number that a couch could show.
/// @param period  Where its readings begin at zero again, if they do.
function readingOf(text, { unit = 'cm', period = null } = {}) {
  const words = text.trim().replace(',', '.').replace('−', '-');
  if (!/^[+-]?\d{1,4}(\.\d{1,2})?$/.test(words)) return null;
  const value = Number(words);
  if (period !== null) return value >= 0 && value < period ? value : null;
  return Math.abs(value) <= kMax[unit] ? value : null;
}

function whyNot({ unit, period = null }) {
  const text = S.result;
  return period === null ? text.couchBad(unit, kMax[unit]) : text.couchBadWraps(unit, period);
}

/// How couches show what they read: to the millimetre. Centimetres where no profile says otherwise.
const kUnsigned = { factor: 0.1, unit: 'cm', digits: 1 };
function scaleOf(axis) {
  if (!couchVersion()) return kUnsigned;
  const { factor, unit, period } = couchAxis(axis);
  return { factor, unit, period, digits: unit === 'mm' ? 0 : 1 };
}

/// The value to set the axis to. A number that does not differ from zero by more than its
/// uncertainty leaves the axis where it is.
function targetOf(reading, { value, still }, { factor, digits, period = null }) {
  const scale = 10 ** digits;
  const target = Math.round(scale * (reading + (still ? 0 : value * factor)));
  // Rounded before: 999.96 is 0.0, and never 1000.0.
  const turn = period === null ? null : scale * period;
  return (turn === null ? target : ((target % turn) + turn) % turn) / scale;
}

/// Only for a result that commands moves, and where the room's axes are known.
export function couchReadings({ result }) {
  const text = S.result;
  const roomKnown = live.status?.room?.known && result?.along_couch;
  if (result?.verdict !== 'move' || !roomKnown) return null;
  // Rotations are listed only if the couch profile defines how the couch counts them.
  const moved = result.numbers.filter((row, i) => row.value !== null
    && (kAxes[i].shift || (couchVersion() > 0 && couchAxis(kAxes[i]).moves)));
  if (!moved.length) return null;
  const rows = moved.map((number) => {
    const scale = scaleOf(kAxes.find(({ name }) => name === number.name));
    const input = h('input', {
      inputmode: 'decimal', autocomplete: 'off', maxlength: 8, size: 8,
    });
    const target = h('output', { class: 'couch-target', 'aria-live': 'polite' });
    input.addEventListener('input', () => {
      const reading = readingOf(input.value, scale);
      const bad = input.value.trim() !== '' && reading === null;
      input.setAttribute('aria-invalid', String(bad));
      if (bad) clear(target, whyNot(scale));
      else if (reading === null) clear(target);
      else {
        const value = targetOf(reading, number, scale);
        const shown = Math.abs(value).toFixed(scale.digits).replace('.', S.decimal);
        clear(target, text.couchSet(text.axes[number.name], `${value < 0 ? '−' : ''}${shown}`,
          scale.unit));
      }
    });
    return h('div', { class: 'couch-axis' },
      field(`${text.axes[number.name]} (${scale.unit})`, input), target);
  });
  return h('details', { class: 'couch' }, h('summary', {}, text.couch),
    hint(couchVersion() ? text.couchHintProfile(live.status.couch.name) : text.couchHint),
    h('div', { class: 'couch-axes' }, rows));
}
