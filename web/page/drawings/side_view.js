// SPDX-License-Identifier: Apache-2.0
// The isocentre from the side, which the map from above cannot show: skin and couch along two lines
// through it, and how high it lies; and what is implausible about it.
import { h, svg } from '../dom.js';
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

/// One section along x (axis 0) or y (axis 1).
function section({ grid, map, body }, point, axis) {
  const text = S.plan;
  const size = axis === 0 ? grid.width : grid.height;
  const low = axis === 0 ? grid.x_min : grid.y_min;
  const cells = Array.from({ length: size }, (_, i) => {
    const along = low + (i + 0.5) * grid.step;
    const cell = axis === 0 ? cellAt(grid, along, point[1]) : cellAt(grid, point[0], along);
    return { along, z: heightAt(map, cell), onBody: isBody(body, cell) };
  }).filter(({ z }) => !Number.isNaN(z));
  const heights = [...cells.map(({ z }) => z), point[2]];
  const [bottom, top] = [Math.min(...heights) - 0.03, Math.max(...heights) + 0.03];
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
  const name = text.sideAlong['xy'[axis]];
  const [cx, cy] = [x(point[axis]), y(point[2])];
  return h('figure', { class: 'side-view' }, h('figcaption', {}, name),
    svg('svg', {
      viewBox: `0 0 ${kWidth} ${kHeight}`, role: 'img',
      'aria-label': `${name}: ${text.isocentreAt(...point.map((v) => 1000 * v))}`,
    },
    svg('path', { d: path(false), class: 'couch-line' }),
    svg('path', { d: path(true), class: 'skin-line' }),
    svg('path', { d: `M${cx - 8} ${cy}h16M${cx} ${cy - 8}v16`, class: 'isocentre-cross' }),
    svg('line', { x1: kLeft, x2: kLeft + 0.1 * scale, y1: kHeight - 8, y2: kHeight - 8,
      class: 'scale-bar' }),
    svg('text', { x: kLeft, y: kHeight - 11, class: 'tick begin' }, S.result.scaleBar)));
}

/// Both sections with their key; nothing without an isocentre.
export function sideViews(heights, point) {
  if (!heights || !point) return null;
  const text = S.plan;
  return h('div', { class: 'side-views' }, section(heights, point, 0), section(heights, point, 1),
    h('p', { class: 'keys' }, h('span', { class: 'key skin' }, text.sideSkin),
      h('span', { class: 'key couch' }, text.sideCouch),
      h('span', { class: 'key at-isocentre' }, text.isocentre)));
}
