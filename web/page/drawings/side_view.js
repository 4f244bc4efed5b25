// SPDX-License-Identifier: Apache-2.0
// The isocentre from the side, which the map from above cannot show: skin and couch along two lines
// through it, and how high it lies; and what is implausible about it.
import { action, clear, h, svg } from '../dom.js';
import { S } from '../words.js';
import { cellAt } from './maps.js';

const kWidth = 340;
const kHeight = 150;
const kLeft = 36;
const kBottom = 22;
const kAbove_m = 0.01;   // the skin is known as well as this
const kFar_m = 0.5;     // kMostIsocentreAway_m of web/model/limits.hpp
const kDown_m = 0.4;     // where no couch is seen: no body is thicker

const isBody = (body, cell) => Boolean(body) && cell >= 0 && !Number.isNaN(body.values[cell]);
const heightAt = (map, cell) => (cell < 0 ? NaN : map.values[cell]);

/// The height of what the body lies on, beside it: the middle of what was seen there, or NaN.
function couchOf({ map, body }) {
  const beside = [];
  map.values.forEach((z, cell) => {
    if (!Number.isNaN(z) && body && !isBody(body, cell)) beside.push(z);
  });
  beside.sort((a, b) => a - b);
  return beside.length ? beside[Math.floor(beside.length / 2)] : NaN;
}

/// How far a point is from the body, seen from above; 0 on it, NaN where the body is not known.
function offBody({ grid, body }, [x, y]) {
  if (!body) return NaN;
  let least = Infinity;
  for (let row = 0; row < grid.height; ++row) {
    for (let column = 0; column < grid.width; ++column) {
      const at = [grid.x_min + (column + 0.5) * grid.step, grid.y_min + (row + 0.5) * grid.step];
      if (isBody(body, cellAt(grid, ...at))) {
        least = Math.min(least, Math.hypot(at[0] - x, at[1] - y));
      }
    }
  }
  return least < 2 * grid.step ? 0 : least;
}

/// What is implausible about an isocentre, in words; `refused` where it cannot be meant.
export function doubtsOf(heights, point) {
  const text = S.plan;
  const off_m = offBody(heights, point);
  const far = (away_m) =>
    ({ refused: true, words: [text.isocentreFar(Math.round(1000 * away_m))] });
  if (off_m > kFar_m) return far(off_m);
  const words = [];
  if (off_m > 0) words.push(text.isocentreBeside(Math.round(1000 * off_m)));
  const skin = heightAt(heights.map, cellAt(heights.grid, point[0], point[1]));
  const couch = couchOf(heights);
  const top = point[2] - skin;
  if (top > kFar_m) return far(top);
  if (top > kAbove_m) words.push(text.isocentreAbove(Math.round(1000 * top)));
  const floor = Number.isNaN(couch) ? skin - kDown_m : Math.min(couch, skin);
  if (floor - point[2] > kFar_m) return far(floor - point[2]);
  if (floor - point[2] > kAbove_m) {
    words.push(text.isocentreBelow(Math.round(1000 * (floor - point[2]))));
  }
  return { refused: false, words };
}

/// From the lowest to the highest of some heights, with the point and a margin.
function rangeOf(heights, point) {
  let [low, high] = [point[2], point[2]];
  for (const z of heights) {
    if (z < low) low = z;
    if (z > high) high = z;
  }
  return [low - 0.03, high + 0.03];
}

/// One section along x (axis 0) or y (axis 1), through `at` of the other axis.
/// @param range  Of heights; by default that of the section.
function section({ grid, map, body }, point, axis, at = point[1 - axis], range = null) {
  const size = axis === 0 ? grid.width : grid.height;
  const low = axis === 0 ? grid.x_min : grid.y_min;
  const cells = Array.from({ length: size }, (_, i) => {
    const along = low + (i + 0.5) * grid.step;
    const cell = axis === 0 ? cellAt(grid, along, at) : cellAt(grid, at, along);
    return { along, z: heightAt(map, cell), onBody: isBody(body, cell) };
  }).filter(({ z }) => !Number.isNaN(z));
  const [bottom, top] = range ?? rangeOf(cells.map(({ z }) => z), point);
  const long = size * grid.step;
  // The same scale both ways, or a shallow isocentre would look deep.
  const scale = Math.min((kWidth - kLeft - 6) / long, (kHeight - kBottom - 6) / (top - bottom));
  const x = (along) => kLeft + (along - low) * scale;
  const y = (z) => 6 + (top - z) * scale;
  const path = (wanted) => {
    let last = -Infinity;
    return cells.filter(({ onBody }) => onBody === wanted).map(({ along, z }) => {
      const begins = along - last > 1.5 * grid.step;
      last = along;
      return `${begins ? 'M' : 'L'}${x(along).toFixed(1)} ${y(z).toFixed(1)}`;
    }).join('');
  };
  const [cx, cy] = [x(point[axis]), y(point[2])];
  const isThrough = at === point[1 - axis];
  return svg('svg', { viewBox: `0 0 ${kWidth} ${kHeight}`, role: 'img' },
    svg('path', { d: path(false), class: 'couch-line' }),
    svg('path', { d: path(true), class: 'skin-line' }),
    isThrough
      && svg('path', { d: `M${cx - 8} ${cy}h16M${cx} ${cy - 8}v16`, class: 'isocentre-cross' }),
    svg('line', { x1: kLeft, x2: kLeft + 0.1 * scale, y1: kHeight - 8, y2: kHeight - 8,
      class: 'scale-bar' }),
    svg('text', { x: kLeft, y: kHeight - 11, class: 'tick begin' }, S.result.scaleBar));
}

const millimetres = (point) => point.map((v) => 1000 * v);

/// A section through the point.
function fixedSection(heights, point, axis) {
  const name = S.plan.sideAlong['xy'[axis]];
  const drawn = section(heights, point, axis);
  drawn.setAttribute('aria-label', `${name}: ${S.plan.isocentreAt(...millimetres(point))}`);
  return h('figure', { class: 'side-view' }, h('figcaption', {}, name), drawn);
}

/// A section with a slider for where it is; it begins at the point, and a button leads back there.
function movableSection(heights, point, axis, range) {
  const text = S.plan;
  const other = 1 - axis;
  const { grid } = heights;
  const low = other === 0 ? grid.x_min : grid.y_min;
  const high = low + (other === 0 ? grid.width : grid.height) * grid.step;
  const from_mm = Math.ceil(1000 * (low - point[other]));
  const slider = h('input', {
    type: 'range', min: from_mm, max: Math.floor(1000 * (high - point[other])), step: 1, value: 0,
    'aria-label': text.cutPlace['xy'[axis]],
  });
  const caption = h('figcaption', {});
  const place = h('div', {});
  const draw = () => {
    const off_mm = Number(slider.value);
    const at = off_mm === 0 ? point[other] : point[other] + off_mm / 1000;
    const where = [text.cutAt('xy'[other], 1000 * at), off_mm === 0 && text.cutThrough]
      .filter(Boolean).join(', ');
    const drawn = section(heights, point, axis, at, range);
    drawn.setAttribute('aria-label', `${text.cutName['xy'[axis]]}: ${where}`);
    slider.setAttribute('aria-valuetext', where);
    caption.textContent = `${text.cutName['xy'[axis]]}: ${where}`;
    clear(place, drawn);
  };
  slider.addEventListener('input', draw);
  draw();
  const back = action(text.cutToIsocentre, async () => {
    slider.value = 0;
    draw();
  }, { 'aria-label': `${text.cutToIsocentre}: ${text.cutName['xy'[axis]]}` });
  return h('figure', { class: 'side-view' }, caption, place,
    h('div', { class: 'slider cut-place' }, slider, back));
}

function bothViews(heights, point, view) {
  if (!heights || !point) return null;
  const text = S.plan;
  return h('div', { class: 'side-views' }, view(heights, point, 0), view(heights, point, 1),
    h('p', { class: 'keys' }, h('span', { class: 'key skin' }, text.sideSkin),
      h('span', { class: 'key couch' }, text.sideCouch),
      h('span', { class: 'key at-isocentre' }, text.isocentre)));
}

/// Both sections through the point with their key; nothing without an isocentre.
export const sideViews = (heights, point) => bothViews(heights, point, fixedSection);

/// The same wherever a person moves them, of a map in the axes of the room.
export const movableCuts = (heights, point) => {
  const range = heights && point && rangeOf(heights.map.values, point);
  return bothViews(heights, point, (...of) => movableSection(...of, range));
};
