// The six numbers over the last scans of a patient.
import { h, svg } from './dom.js';
import { kAxes, signed } from './numbers.js';
import { S } from './strings.js';

const kWidth = 320;
const kHeight = 120;

function chart(axis, points, limit) {
  const reach = Math.max(1.5 * limit, ...points.map((point) => Math.abs(point.value) + point.u95)) * 1.1;
  const x = (i) => 34 + (points.length === 1 ? 0.5 : i / (points.length - 1)) * (kWidth - 50);
  const y = (value) => kHeight / 2 - value / reach * (kHeight / 2 - 6);
  const newest = points[points.length - 1];
  const tick = (value) => svg('text', { x: 29, y: y(value) + 4, class: 'tick' }, `${value > 0 ? '+' : value < 0 ? '−' : ''}${Math.abs(value)}`);
  return h('figure', { class: 'trend' },
    h('figcaption', {}, S.result.axes[axis.name], ' ', h('strong', {}, `${signed(newest.value, axis.shift ? 1 : 2)} ${axis.unit}`)),
    svg('svg', { viewBox: `0 0 ${kWidth} ${kHeight}`, role: 'img', 'aria-label': `${S.result.trendLabel(S.result.axes[axis.name])}: ${points.map((point) => signed(point.value)).join(', ')} ${axis.unit}` },
      svg('rect', { x: 34, width: kWidth - 38, y: y(limit), height: y(-limit) - y(limit), class: 'zone' }), svg('line', { x1: 34, x2: kWidth - 4, y1: y(0), y2: y(0), class: 'zero' }),
      y(0) - y(limit) > 12 && [tick(limit), tick(-limit)], tick(0),
      svg('polyline', { points: points.map((point, i) => `${x(i)},${y(point.value)}`).join(' '), class: 'line' }),
      points.map((point, i) => [svg('line', { x1: x(i), x2: x(i), y1: y(point.value - point.u95), y2: y(point.value + point.u95), class: 'whisker' }),
        svg('circle', { cx: x(i), cy: y(point.value), r: i === points.length - 1 ? 6 : 4, class: Math.abs(point.value) + point.u95 <= limit ? 'mark within' : 'mark outside' })])));
}

/// @param scans  Newest first.
export function trend(scans, tolerance) {
  const shown = scans.filter((scan) => scan.result?.correction && scan.result.verdict !== 'no_answer').slice(0, 30).reverse();
  if (shown.length < 2) return h('p', { class: 'hint' }, S.result.trendEmpty);
  const charts = kAxes.map((axis) => {
    const points = shown.filter((scan) => scan.result.correction[axis.key] !== null).map((scan) => ({ value: scan.result.correction[axis.key], u95: scan.result.u95?.[axis.key] ?? 0 }));
    return points.length ? chart(axis, points, axis.shift ? tolerance.shift_mm : tolerance.rotation_deg) : null;
  });
  return h('div', { class: 'trends' }, charts);
}
