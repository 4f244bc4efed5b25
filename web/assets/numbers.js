// The six numbers: value, words, arrow, uncertainty, tolerance bar.
import { h, svg } from './dom.js';
import { S } from './strings.js';

export const kAxes = [
  { name: 'vertical', key: 'vertical_mm', unit: 'mm', shift: true }, { name: 'longitudinal', key: 'longitudinal_mm', unit: 'mm', shift: true }, { name: 'lateral', key: 'lateral_mm', unit: 'mm', shift: true },
  { name: 'pitch', key: 'pitch_deg', unit: '°' }, { name: 'roll', key: 'roll_deg', unit: '°' }, { name: 'yaw', key: 'yaw_deg', unit: '°' },
];

const printsAsZero = (value, digits) => Number(Math.abs(value).toFixed(digits)) === 0;
export const signed = (value, digits = 1) => `${printsAsZero(value, digits) ? '' : value < 0 ? '−' : '+'}${Math.abs(value).toFixed(digits)}`;

// What the couch does, drawn for a positive value; a negative one is turned or mirrored. The gantry is the ring.
const kDrawings = {
  vertical: { flip: 'rotate(180 24 24)', parts: () => [svg('path', { d: 'M24 42V10M13 20l11-12 11 12', class: 'stroke' })] },
  longitudinal: { flip: 'rotate(180 24 27)', fixed: () => svg('path', { d: 'M10 6a14 6 0 0 1 28 0', class: 'ring' }), parts: () => [svg('path', { d: 'M24 45V16M14 25l10-10 10 10', class: 'stroke' })] },
  lateral: { flip: 'rotate(180 24 24)', parts: () => [svg('path', { d: 'M6 24h32M28 13l12 11-12 11', class: 'stroke' })] },
  pitch: { flip: 'matrix(1 0 0 -1 0 48)', parts: () => [svg('path', { d: 'M6 36l36-14', class: 'ring' }), svg('path', { d: 'M38 18V6M32 11l6-6 6 6', class: 'stroke' })] },
  roll: { flip: 'matrix(-1 0 0 1 48 0)', parts: () => [svg('path', { d: 'M8 18l32 12', class: 'ring' }), svg('path', { d: 'M38 33v11M32 39l6 6 6-6', class: 'stroke' })] },
  yaw: { flip: 'matrix(-1 0 0 1 48 0)', parts: () => [svg('path', { d: 'M37 35A17 17 0 1 0 11 36M11 25V36L1 33', class: 'stroke' })] },
};

function drawing(name, value) {
  const { flip, parts, fixed } = kDrawings[name];
  return svg('svg', { viewBox: '0 0 48 48', class: 'arrow', 'aria-hidden': 'true' }, fixed?.(), svg('g', { transform: value < 0 ? flip : undefined }, parts()));
}

function bar(value, u95, tolerance) {
  const span = 2.5 * tolerance;
  const x = (v) => 100 + 96 * Math.max(-1, Math.min(1, v / span));
  const beyond = Math.abs(value) > span;
  return svg('svg', { viewBox: '0 0 200 26', class: 'tolerance-bar', 'aria-hidden': 'true', preserveAspectRatio: 'none' },
    svg('rect', { x: 2, y: 9, width: 196, height: 8, rx: 4, class: 'track' }),
    svg('rect', { x: x(-tolerance), y: 6, width: x(tolerance) - x(-tolerance), height: 14, rx: 3, class: 'zone' }),
    svg('line', { x1: 100, x2: 100, y1: 3, y2: 23, class: 'zero' }),
    svg('line', { x1: x(value - u95), x2: x(value + u95), y1: 13, y2: 13, class: 'whisker' }),
    beyond ? svg('path', { d: value > 0 ? 'M188 4l10 9-10 9z' : 'M12 4L2 13l10 9z', class: 'mark' }) : svg('rect', { x: x(value) - 2, y: 2, width: 4, height: 22, rx: 1, class: 'mark' }));
}

function card(axis, correction, u95, tolerance, words, weak) {
  const text = S.result;
  const value = correction[axis.key];
  const limit = axis.shift ? tolerance.shift_mm : tolerance.rotation_deg;
  const name = text.axes[axis.name];
  if (value === null || value === undefined) return h('li', { class: 'number refused' }, h('h3', {}, name), h('p', { class: 'value' }, S.none), h('p', { class: 'word' }, text.refused));
  const half = u95?.[axis.key] ?? 0;
  const within = Math.abs(value) + half <= limit;
  const digits = axis.shift ? 1 : Math.abs(value) < 10 ? 2 : 1;
  const still = printsAsZero(value, digits);  // no direction either
  const word = still ? text.still : words?.[axis.name] ?? S.none;
  return h('li', { class: `number ${within ? 'within' : 'outside'}` },
    h('h3', {}, name), !still && drawing(axis.name, value),
    h('p', { class: 'value' }, signed(value, digits), h('span', { class: 'unit' }, axis.unit === '°' ? '°' : ` ${axis.unit}`)),
    h('p', { class: 'word' }, word),
    bar(value, half, limit),
    h('p', { class: 'fine' }, h('span', {}, h('span', { class: 'visually-hidden' }, `${text.uncertaintyLong} `), text.uncertainty(half.toFixed(axis.shift ? 1 : 2), axis.unit)),
      h('span', { class: 'judged' }, within ? `✓ ${text.within}` : `▲ ${text.outside}`)),
    weak && h('p', { class: 'caution' }, text.notSeen));
}

export function sixNumbers(result, reference, details) {
  const tolerance = reference?.plan.tolerance ?? { shift_mm: 3, rotation_deg: 1 };
  const weak = new Set((details?.motion?.weak_directions ?? []).map((direction) => direction.name));
  return h('ol', { class: 'numbers' }, kAxes.map((axis) => card(axis, result.correction, result.u95, tolerance, result.words, weak.has(axis.name))));
}
