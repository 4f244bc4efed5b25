// SPDX-License-Identifier: Apache-2.0
// The six numbers over the fractions of a patient: the first and the last scan of each.
import { h, hint, localDay, svg } from '../dom.js';
import { digitsOf, kAxes, kTones, mostDigits, signed } from '../numbers.js';
import { S } from '../words.js';

const kWidth = 340;
const kHeight = 150;
const kLeft = 36;
const kBottom = 24;
const kMaxFractions = 40;

/// Scans of the same session are one fraction; those without a session count by themselves.
function fractionsOf(scans) {
  const groups = new Map();
  for (const scan of [...scans].reverse()) {
    if (!scan.result?.numbers.length) continue;
    const key = scan.session_id ?? scan.id;
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(scan);
  }
  return [...groups.values()].slice(-kMaxFractions).map((group, i) => ({
    number: group[0].fraction ?? i + 1, first: group[0], last: group[group.length - 1],
  }));
}

const valueOf = (scan, axis) => scan.result.numbers.find(({ name }) => name === axis.name);

/// A mark of a trend, told apart by its shape as well as by its colour: within a circle, outside a
/// triangle, inconclusive a diamond.
export function markOf(tone, cx, cy, r) {
  if (tone === 'within') return svg('circle', { cx, cy, r, class: `mark ${tone}` });
  const d = tone === 'outside' ? `M${cx} ${cy - 1.2 * r}l${1.2 * r} ${2.2 * r}h${-2.4 * r}z`
    : `M${cx} ${cy - 1.3 * r}l${1.3 * r} ${1.3 * r} ${-1.3 * r} ${1.3 * r} ${-1.3 * r} `
      + `${-1.3 * r}z`;
  return svg('path', { d, class: `mark ${tone}` });
}

/// The days below a chart: several points of one day have one label.
/// @param points  In the order of time: {x, time}.
export const dayLabels = (points, y) => points.map(({ x, time }) => ({ x, day: localDay(time) }))
  .filter(({ day }, i, all) => day !== all[i - 1]?.day)
  .map(({ x, day }) => svg('text', { x, y, class: 'tick middle' }, day));

function chart(axis, fractions, limit, isTitled) {
  const points = fractions
    .map((fraction, i) => ({
      i, fraction, first: valueOf(fraction.first, axis), last: valueOf(fraction.last, axis),
    }))
    .filter(({ last }) => last.value !== null);
  if (!points.length) return null;
  const all = points.flatMap(({ first, last }) => [first, last]);
  const reach = 1.1 * Math.max(1.5 * limit,
    ...all.map((p) => Math.abs(p.value ?? 0) + (p.u95 || 0)));
  const n = fractions.length;
  const x = (i) => kLeft + (n === 1 ? 0.5 : (i + 0.3) / (n - 0.4)) * (kWidth - kLeft - 8);
  const middle = (kHeight - kBottom) / 2;
  const y = (value) => middle - value / reach * (middle - 6);
  const written = ({ value, u95 }) => signed(value, digitsOf(u95 ?? NaN, mostDigits(axis)));
  const sign = (value) => (value > 0 ? '+' : value < 0 ? '−' : '');
  const text = (value) => `${sign(value)}${Math.abs(value)}`.replace('.', S.decimal);
  const tick = (value) =>
    svg('text', { x: kLeft - 5, y: y(value) + 4, class: 'tick' }, text(value));
  const beyond = Math.floor(reach / limit) >= 2 ? Math.floor(reach / limit) * limit : 0;
  const every = Math.ceil(n / 6);
  const newest = points[points.length - 1].last;
  const said = points.map(({ fraction, last }) =>
    `${S.result.trendFraction(fraction.number, localDay(fraction.last.started_at))}: `
    + `${written(last)} ${axis.unit}`).join('; ');
  const mark = (p, i, filled) => {
    const shape = markOf(kTones[p.judgement], x(i) + (filled ? 3 : -3), y(p.value),
      filled ? 5 : 3.5);
    if (!filled) shape.classList.add('open');
    return shape;
  };
  return h('figure', { class: 'trend' },
    h('figcaption', {}, S.result.axes[axis.name], isTitled && [' ',
      h('strong', {}, `${written(newest)}${axis.unit === '°' ? '' : ' '}${axis.unit}`)]),
    svg('svg', {
      viewBox: `0 0 ${kWidth} ${kHeight}`, role: 'img',
      'aria-label': `${S.result.trendLabel(S.result.axes[axis.name])}: ${said}`,
    },
    svg('rect', {
      x: kLeft, width: kWidth - kLeft - 4, y: y(limit), height: y(-limit) - y(limit), class: 'zone',
    }),
    svg('line', { x1: kLeft, x2: kWidth - 4, y1: y(0), y2: y(0), class: 'zero' }),
    y(0) - y(limit) > 12 && [tick(limit), tick(-limit)], tick(0),
    beyond > limit && [tick(beyond), tick(-beyond)],
    svg('polyline', {
      points: points.map((p) => `${x(p.i) + 3},${y(p.last.value)}`).join(' '), class: 'line',
    }),
    points.map(({ i, fraction, first, last }) => [
      last.u95 > 0 && svg('line', {
        x1: x(i) + 3, x2: x(i) + 3, y1: y(last.value - last.u95), y2: y(last.value + last.u95),
        class: 'whisker',
      }),
      fraction.first !== fraction.last && first.value !== null && mark(first, i, false),
      mark(last, i, true)]),
    dayLabels(points.filter((p) => p.i % every === 0)
      .map(({ i, fraction }) => ({ x: x(i), time: fraction.last.started_at })), kHeight - 6)));
}

/// @param scans  Newest first.
/// @param isTitled  With the newest value in each title: not where the scan shown has no answer, or
/// it could be taken for that scan's.
export function trend(scans, tolerance, isTitled = true) {
  const fractions = fractionsOf(scans);
  const shown = new Set(fractions.flatMap(({ first, last }) => [first.id, last.id]));
  if (shown.size < 2) return hint(S.result.trendEmpty);
  const charts = kAxes.map((axis) =>
    chart(axis, fractions, axis.shift ? tolerance.shift_mm : tolerance.rotation_deg, isTitled));
  return h('div', {}, hint(S.result.trendHint),
    h('div', { class: 'trends' }, charts));
}
