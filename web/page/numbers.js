// SPDX-License-Identifier: Apache-2.0
// The six numbers: value, words, arrow, uncertainty, tolerance bar. The appliance has judged them.
import {
  couchAxis, couchCannot, couchNotes, isLeftOut,
} from './couch/axes.js';
import { h, svg } from './dom.js';
import { kTolerance } from './limits.js';
import { S, said } from './words.js';

export const kAxes = [
  { name: 'vertical', key: 'vertical_mm', unit: 'mm', shift: true },
  { name: 'longitudinal', key: 'longitudinal_mm', unit: 'mm', shift: true },
  { name: 'lateral', key: 'lateral_mm', unit: 'mm', shift: true },
  { name: 'pitch', key: 'pitch_deg', unit: '°' },
  { name: 'roll', key: 'roll_deg', unit: '°' },
  { name: 'yaw', key: 'yaw_deg', unit: '°' },
];
/// No space before the sign of degrees.
export const withUnit = (value, unit) => (unit === '°' ? `${value}°` : `${value} ${unit}`);
export const kMarks = { in_tolerance: '✓', unsure: '≈', outside: '▲', not_judged: '≈' };
/// Of the styles.
export const kTones = {
  in_tolerance: 'within', unsure: 'unsure', outside: 'outside', not_judged: 'unsure',
};

const printsAsZero = (value, digits) => Number(Math.abs(value).toFixed(digits)) === 0;
const number = (value, digits) => Math.abs(value).toFixed(digits).replace('.', S.decimal);
/// A limit as it was set, whatever the unit.
const plain = (value) => `${Math.round(1000 * value) / 1000}`.replace('.', S.decimal);
export const signed = (value, digits = 1) =>
  `${printsAsZero(value, digits) ? '' : value < 0 ? '−' : '+'}${number(value, digits)}`;

/// Digits behind the point that the uncertainty lets a value have: none below its first digit.
export function digitsOf(u95, most) {
  if (!(u95 > 0)) return most;
  return Math.max(0, Math.min(most, -Math.floor(Math.log10(u95) + 1e-9)));
}
/// An uncertainty has one digit more than its value if its first digit is 1 (JCGM 100, 7.2.6), but
/// never more than values of its kind. A small one is never shown as 0.
function shownUncertainty(u95, digits, most) {
  const shown = Math.min(most, digits + (/^[0.]*1/.test(u95.toFixed(3)) ? 1 : 0));
  return number(Math.max(u95, 10 ** -shown), shown);
}
export const mostDigits = (axis) => (axis.shift ? 1 : 2);

// The couch's movement, drawn for a positive value; for a negative one it is turned or mirrored.
// The gantry is the ring.
const stroke = (d) => svg('path', { d, class: 'stroke' });
const ring = (d) => svg('path', { d, class: 'ring' });
const kDrawings = {
  vertical: { flip: 'rotate(180 24 24)', parts: () => [stroke('M24 42V10M13 20l11-12 11 12')] },
  longitudinal: {
    flip: 'rotate(180 24 27)', fixed: () => ring('M10 6a14 6 0 0 1 28 0'),
    parts: () => [stroke('M24 45V16M14 25l10-10 10 10')],
  },
  lateral: { flip: 'rotate(180 24 24)', parts: () => [stroke('M6 24h32M28 13l12 11-12 11')] },
  pitch: {
    flip: 'matrix(1 0 0 -1 0 48)',
    parts: () => [ring('M6 36l36-14'), stroke('M38 18V6M32 11l6-6 6 6')],
  },
  roll: {
    flip: 'matrix(-1 0 0 1 48 0)',
    parts: () => [ring('M8 18l32 12'), stroke('M38 33v11M32 39l6 6 6-6')],
  },
  yaw: {
    flip: 'matrix(-1 0 0 1 48 0)', parts: () => [stroke('M37 35A17 17 0 1 0 11 36M11 25V36L1 33')],
  },
};

function drawing(name, value) {
  const { flip, parts, fixed } = kDrawings[name];
  return svg('svg', { viewBox: '0 0 48 48', class: 'arrow', 'aria-hidden': 'true' }, fixed?.(),
    svg('g', { transform: value < 0 ? flip : undefined }, parts()));
}

/// The value with its uncertainty on the range of tolerance, whose ends carry their numbers.
/// @param u95  Where it is not known, the mark is hollow: no value is exact.
/// @param isKnown  Otherwise only the range is drawn.
export function toleranceBar(value, u95, tolerance, isKnown = true) {
  const span = 2.5 * tolerance;
  const x = (v) => 100 + 96 * Math.max(-1, Math.min(1, v / span));
  const beyond = Math.abs(value) > span;
  const tick = (v) => svg('text', { x: x(v), y: 36, class: 'bar-tick' },
    `${v < 0 ? '−' : '+'}${plain(Math.abs(v))}`);
  return svg('svg', { viewBox: '0 0 200 38', class: 'tolerance-bar', 'aria-hidden': 'true' },
    svg('rect', { x: 2, y: 9, width: 196, height: 8, rx: 4, class: 'track' }),
    svg('rect', {
      x: x(-tolerance), y: 6, width: x(tolerance) - x(-tolerance), height: 14, rx: 3, class: 'zone',
    }),
    svg('line', { x1: 100, x2: 100, y1: 3, y2: 23, class: 'zero' }),
    u95 > 0
      && svg('line', { x1: x(value - u95), x2: x(value + u95), y1: 13, y2: 13, class: 'whisker' }),
    !isKnown ? null : beyond
      ? svg('path', { d: value > 0 ? 'M188 4l10 9-10 9z' : 'M12 4L2 13l10 9z', class: 'mark' })
      : svg('rect', {
        x: x(value) - 2, y: 2, width: 4, height: 22, rx: 1, class: u95 > 0 ? 'mark' : 'mark open',
      }),
    tick(-tolerance), tick(tolerance));
}

/// @param commands  Whether this is a correction to apply, or was one; else a difference that is
/// only reported.
/// @param valid  Whether the result can be acted on; otherwise the card has no instruction.
/// @param pictured  Whether an arrow shows the way: only for what is to be applied, and, but for up
/// and down, only in a room whose axes are known.
function card(axis, row, { name, weak, commands, pictured, valid, alongCouch }) {
  const text = S.result;
  const { judgement } = row;
  if (row.value === null) {
    return h('li', { class: 'number refused' }, h('h3', {}, name),
      h('p', { class: 'value' }, S.none), h('p', { class: 'word' }, text.refused));
  }
  const couch = couchAxis(axis, alongCouch);
  const value = row.value * couch.factor;
  const limit = row.tolerance * Math.abs(couch.factor);
  const half = (row.u95 ?? NaN) * Math.abs(couch.factor);  // NaN: not known
  const digits = digitsOf(half, couch.digits);
  const directed = commands && !row.still;
  const cannot = directed && valid && !couch.moves;
  const word = cannot ? couchCannot()
    : !commands && !valid ? text.atThisScan : said(row, 'way') ?? S.none;
  // Those within tolerance are moved with the others: no green says "leave it".
  const neutral = commands && judgement === 'in_tolerance' ? ' neutral' : '';
  return h('li', { class: `number ${kTones[judgement]}${neutral}${commands ? '' : ' told'}` },
    h('h3', {}, name), directed && pictured && !cannot && drawing(axis.name, row.value),
    h('p', { class: 'value' }, signed(value, digits),
      h('span', { class: axis.shift ? 'unit' : 'unit degrees' },
        axis.shift ? ` ${couch.unit}` : '°')),
    h('p', { class: 'word' }, word),
    toleranceBar(value, half, limit),
    h('p', { class: 'fine' },
      h('span', { class: 'half' }, Number.isNaN(half) ? text.uncertaintyUnknown
        : [h('span', { class: 'visually-hidden' }, `${text.uncertaintyLong} `),
          `±${withUnit(shownUncertainty(half, digits, couch.digits), couch.unit)}`]),
      h('span', { class: 'judged' }, `${kMarks[judgement]} ${said(row, 'judged')}`),
      h('span', { class: 'limit' }, text.tolerance(withUnit(plain(limit), couch.unit)))),
    weak && h('p', { class: 'caution' }, text.notSeen));
}

/// The six in one line, for lists: shifts, then rotations, each with the digits that are known.
export function numbersLine({ numbers }) {
  const one = ({ value, u95 }, i) =>
    (value === null ? S.none : signed(value, digitsOf(u95 ?? NaN, mostDigits(kAxes[i]))));
  const between = S.decimal === ',' ? '; ' : ', ';
  const all = numbers.map(one);
  return `${all.slice(0, 3).join(between)} · ${all.slice(3).join(between)}`;
}

export const toleranceOf = (reference) => reference?.plan.tolerance ?? kTolerance;

/// Only a result that says MOVE commands moves, and only while it is valid; later its words say
/// what was found.
export function sixNumbers(result, details, valid = true) {
  const weak = new Set((details?.motion?.weak_directions ?? []).map(({ name }) => name));
  const commands = result.verdict === 'move';
  const alongCouch = Boolean(result.along_couch);
  const cards = kAxes.map((axis, i) => !isLeftOut(axis, result.numbers[i], alongCouch)
    && card(axis, result.numbers[i], {
      name: said(result.axes, axis.name), weak: weak.has(axis.name), commands, valid, alongCouch,
      pictured: valid && (alongCouch || axis.name === 'vertical'),
    }));
  return [h('ol', { class: 'numbers' }, cards), couchNotes(alongCouch)];
}
