// SPDX-License-Identifier: Apache-2.0
// The error map with a cursor that reads millimetres, and the profile through it.
import { fileUrl, get, live } from '../api.js';
import { arrowOf, clear, fixed, h, hint, svg, warn } from '../dom.js';
import { compassOf, drawCropped, mapFrame, marksNote, markToward, viewOf } from './map_frame.js';
import { cellAt, errorColour, loadMap, paintErrors, paintOverlay } from './maps.js';
import { signed } from '../numbers.js';
import { isAdvice, sidesOf } from '../screens/common.js';
import { S } from '../words.js';

const kTicks = [-20, -10, -5, -2, -1, 1, 2, 5, 10, 20];  // tolerances

/// The scale, evenly spaced by its stops: the white part is the tolerance, and every stop carries
/// its number.
export function legend(tolerance_mm) {
  const text = S.result;
  const stops = kTicks.map((tick, i) => {
    const [r, g, b] = errorColour(tick).map(Math.round);
    return `rgb(${r} ${g} ${b}) ${(100 * (i + 0.5)) / kTicks.length}%`;
  });
  const said = `${text.lower}, ${text.higher}`;
  const scale = h('div', { class: 'scale', role: 'img', 'aria-label': said });
  scale.style.setProperty('background', `linear-gradient(90deg, ${stops.slice(0, 5).join(', ')}, `
    + `#fafaf8 50%, ${stops.slice(5).join(', ')})`);
  const label = (tick) => {
    const value = Math.abs(tick * tolerance_mm);
    return `${tick < 0 ? '−' : '+'}${Number.isInteger(value) ? value : fixed(value, 1)}`;
  };
  return h('div', { class: 'legend' },
    h('div', { class: 'scale-box' }, scale,
      h('div', { class: 'ticks', 'aria-hidden': 'true' }, kTicks.map((tick) =>
        h('span', { class: Math.abs(tick) === 1 ? 'limit' : '' }, label(tick))))),
    hint(`mm, ${text.tolerance(`${`${tolerance_mm}`.replace('.', S.decimal)} mm`)}`),
    h('p', { class: 'keys' }, h('span', { class: 'key low' }, text.lower),
      h('span', { class: 'key high' }, text.higher), h('span', { class: 'key gap' }, text.unknown),
      h('span', { class: 'key hole' }, text.hole_),
      h('span', { class: 'key edge' }, text.regionOutline)));
}

const kProfile = { width: 420, height: 220, left: 42, bottom: 34, top: 8, right: 22 };

/// Heights along a line through the cursor; both axes in millimetres, equally marked.
function profile(grid, view, reference, deviation, cursor, along, compass) {
  const { width, height, left, bottom, top, right } = kProfile;
  const from = along === 0 ? view.x_min : view.y_max - view.height;
  const length = along === 0 ? view.width : view.height;
  const points = [];
  for (let s = grid.step / 2; s < length; s += 2 * grid.step) {
    const cell = cellAt(grid, along === 0 ? from + s : cursor.x, along === 0 ? cursor.y : from + s);
    if (cell >= 0) points.push({ s, z: reference.values[cell], d: deviation.values[cell] });
  }
  const heights = points.flatMap(({ z, d }) => [z, z + d]).filter(Number.isFinite);
  const low = Math.floor(10 * Math.min(0, ...heights)) / 10;
  const high = Math.max(low + 0.1, Math.ceil(20 * Math.max(0.1, ...heights)) / 20);
  const x = (s) => left + s / length * (width - left - right);
  const y = (z) => height - bottom - (z - low) / (high - low) * (height - bottom - top);
  const path = (value) => {
    let pen = 'M';
    let d = '';
    for (const point of points) {
      const z = value(point);
      if (!Number.isFinite(z)) { pen = 'M'; continue; }
      d += `${pen}${x(point.s).toFixed(1)} ${y(z).toFixed(1)}`;
      pen = 'L';
    }
    return d;
  };
  const ticks = (low_m, high_m, step) => Array.from(
    { length: Math.floor((high_m - low_m) / step + 1e-6) + 1 },
    (_, i) => (Math.ceil(low_m / step - 1e-6) + i) * step).filter((v) => v <= high_m + 1e-6);
  const mm = (v) => fixed(1000 * v, 0);
  const here = along === 0 ? cursor.x - from : cursor.y - from;
  const end = (at, anchor, way) => {
    const name = markToward(compass, along === 0 ? [way, 0] : [0, way]);
    return name && svg('text', {
      x: at, y: height - 3, class: `tick ${anchor}`, 'data-mark': name,
    }, S.result.marks[name]);
  };
  return svg('svg', {
    viewBox: `0 0 ${width} ${height}`, class: 'profile', role: 'img',
    'aria-label': S.result.sliceLabel,
  },
  ticks(from, from + length, 0.1).map((v) => [
    svg('line', { x1: x(v - from), x2: x(v - from), y1: top, y2: height - bottom, class: 'grid' }),
    svg('text', { x: x(v - from), y: height - bottom + 14, class: 'tick middle' }, mm(v))]),
  ticks(low, high, 0.05).map((v) => [
    svg('line', { x1: left, x2: width - right, y1: y(v), y2: y(v), class: 'grid' }),
    svg('text', { x: left - 5, y: y(v) + 4, class: 'tick' }, mm(v))]),
  svg('text', { x: (left + width) / 2, y: height - 3, class: 'tick middle' }, S.result.sliceWay),
  end(left, 'start', -1), end(width - right, 'end', 1),
  svg('text', {
    x: 11, y: (height - bottom) / 2, class: 'tick middle',
    transform: `rotate(-90 11 ${(height - bottom) / 2})`,
  }, S.result.sliceHeight),
  svg('line', { x1: x(here), x2: x(here), y1: top, y2: height - bottom, class: 'zero' }),
  svg('path', { d: path(({ z }) => z), class: 'line-reference' }),
  svg('path', { d: path(({ z, d }) => z + d), class: 'line-current' }));
}

/// Map and reading side by side; the map is never higher than three quarters of the window.
function sideBySide(view, ...children) {
  const element = h('div', { class: 'map-row' }, ...children);
  element.style.setProperty('--map-width', `${75 * view.width / view.height}vh`);
  return element;
}

const kAround = 2;  // cells to each side: what is read is the surface, not one cell's noise
function around({ width, values }, cell) {
  const known = [];
  for (let dy = -kAround; dy <= kAround; ++dy) {
    for (let dx = -kAround; dx <= kAround; ++dx) {
      const value = values[cell + dy * width + dx];
      if (Number.isFinite(value)) known.push(value);
    }
  }
  return known.length * 4 < (2 * kAround + 1) ** 2 ? NaN
    : known.sort((a, b) => a - b)[known.length >> 1];
}

/// Shows in `place` how much of all downloads begun so far has arrived.
export function progressIn(place, words = S.loading) {
  const bar = h('progress', { max: 1, 'aria-label': words });
  clear(place, hint(words), bar);
  const parts = new Map();
  return (name) => (received, total) => {
    parts.set(name, [received, total]);
    const sums = [...parts.values()].reduce(([a, b], [r, t]) => [a + r, b + t], [0, 0]);
    if (sums[1] > 0) bar.value = sums[0] / sums[1];
  };
}

async function loadAll(scan, reference, place) {
  const scene = await get(`scans/${reference.scan_id}/files/scene.json`, true);
  const grid = scene.heightmap;
  const part = progressIn(place);
  const [before, region, heights] = await Promise.all([
    loadMap(scan.id, 'deviation', part('map')),
    loadMap(scan.id, 'region', part('region')).catch(() => null),
    loadMap(reference.scan_id, 'heightmap', part('heights'))]);
  const fits = (map) => map.width === grid.width && map.height === grid.height;
  if (!fits(before) || !fits(heights)) throw new Error();
  return { grid, before, region, heights };
}

/// The middle of the hole for which there is no answer: where to sweep again.
function holeOf({ result, details }) {
  const { largest_hole_m: size, max_hole_m: limit, hole_centre_m: middle } = details?.region ?? {};
  return result?.verdict === 'no_answer' && size > limit ? middle : null;
}

/// In the axes of the map; nothing where the plan has none and the numbers are about the middle of
/// the region. The map of a planning CT has its origin at the isocentre.
function isocentreOnMap({ result, details }) {
  if (details?.compared_with) return [0, 0];
  const isAboutMiddle = result?.about_message?.id === 'result.about_middle';
  return isAboutMiddle ? null : details?.correction?.isocentre;
}

/// Figure with map, reading and profile for a scan with a result; falls back to the picture.
/// @param place  Shows the progress meanwhile.
export async function errorMap(scan, reference, tolerance_mm, place) {
  const text = S.result;
  let loaded;
  try {
    loaded = await loadAll(scan, reference, place);
  } catch {
    const picture = h('figure', {}, h('img', {
      src: fileUrl(scan.id, 'error_map.png'), alt: text.mapPicture, class: 'picture',
    }));
    const element = h('div', {}, hint(text.mapFailed), picture);
    return { element, grid: null };
  }
  const { grid, region, heights } = loaded;
  const maps = { before: loaded.before, after: null };
  const view = viewOf(grid, region);
  const compass = compassOf(live.status?.room, sidesOf(scan, scan.details),
    reference.plan.posture);
  const isocentre = isocentreOnMap(scan);

  const canvas = h('canvas', {
    class: 'map', tabindex: '0', role: 'application', 'aria-label': text.mapLabel,
  });
  const cross = h('div', { class: 'cross', 'aria-hidden': 'true' });
  const reading = h('p', { class: 'reading', 'aria-live': 'polite' });
  const slice = h('div', {});
  const shown = { map: 'before', along: 0 };
  const y_min = view.y_max - view.height;
  const cursor = { x: view.x_min + view.width / 2, y: y_min + view.height / 2 };
  const hole = holeOf(scan);
  if (hole ?? isocentre) [cursor.x, cursor.y] = hole ?? isocentre;

  const read = () => {
    const cell = cellAt(grid, cursor.x, cursor.y);
    const value = cell < 0 ? NaN : around(maps[shown.map], cell);
    const words = cell < 0 ? text.outsideMap : Number.isNaN(value)
      ? region?.values[cell] === 2 ? text.hole_ : text.unknown : text.reads(signed(1000 * value));
    clear(reading, h('strong', {}, words), ` ${text.at(1000 * cursor.x, 1000 * cursor.y)}`);
    cross.style.setProperty('left', `${100 * (cursor.x - view.x_min) / view.width}%`);
    cross.style.setProperty('top', `${100 * (view.y_max - cursor.y) / view.height}%`);
    clear(slice, profile(grid, view, heights, maps[shown.map], cursor, shown.along, compass));
  };
  const move = (x, y) => {
    cursor.x = Math.max(view.x_min, Math.min(view.x_min + view.width - grid.step / 2, x));
    cursor.y = Math.max(y_min, Math.min(view.y_max - grid.step / 2, y));
    read();
  };
  canvas.addEventListener('pointermove', (event) => {
    const box = canvas.getBoundingClientRect();
    move(view.x_min + (event.clientX - box.left) / box.width * view.width,
      view.y_max - (event.clientY - box.top) / box.height * view.height);
  });
  canvas.addEventListener('keydown', (event) => {
    const by = (event.shiftKey ? 0.05 : 0.005);
    const direction = arrowOf(event);
    if (!direction) return;
    event.preventDefault();
    move(cursor.x + by * direction[0], cursor.y + by * direction[1]);
  });
  const draw = () => {
    drawCropped(canvas, view, (whole) =>
      paintErrors(whole, maps[shown.map], tolerance_mm / 1000, region));
    canvas.dataset.map = shown.map;
  };
  // The second map comes only when it is asked for.
  const choose = (name, value, label, apply) => {
    const input = h('input', { type: 'radio', name, value, checked: value === shown[name] });
    input.addEventListener('change', async () => {
      try {
        if (name === 'map') maps[value] ??= await loadMap(scan.id, 'deviation_after');
      } catch (error) {
        // The other map stays, and its name is the one that is marked.
        input.closest('fieldset').querySelector(`[value="${shown[name]}"]`).checked = true;
        warn(`${text.mapMissing} ${error.message}`);
        return;
      }
      if (!input.checked) return;  // somebody chose again meanwhile
      shown[name] = value;
      apply();
    });
    return h('label', { class: 'check' }, input, ' ', label);
  };
  draw();
  read();
  const both = () => { draw(); read(); };
  const box = mapFrame({ grid, view, canvas, region, compass, isocentre, cross });
  const profileBox = h('div', {}, h('h3', {}, text.slice),
    h('fieldset', { class: 'row plainset' }, h('legend', { class: 'visually-hidden' }, text.slice),
      choose('along', 0, text.sliceAlong.x, read), choose('along', 1, text.sliceAlong.y, read)),
    slice, h('p', { class: 'keys' }, h('span', { class: 'key reference' }, text.reference_),
      h('span', { class: 'key current' }, text.current_)));
  const element = h('div', {},
    h('fieldset', { class: 'row plainset' }, h('legend', { class: 'visually-hidden' }, text.where),
      choose('map', 'before', text.before, both),
      isAdvice(scan) && choose('map', 'after', text.after, both)),
    sideBySide(view, h('div', {}, box, marksNote(compass)),
      h('div', { class: 'map-side' }, reading, legend(tolerance_mm), profileBox)));
  const overlay = () => {
    const still = h('canvas', { class: 'still-map', role: 'img', 'aria-label': text.overlayAlt });
    drawCropped(still, view, (whole) =>
      paintOverlay(whole, heights, maps.before, tolerance_mm / 1000, grid.step));
    return { element: mapFrame({ grid, view, canvas: still, region, compass, isocentre }) };
  };
  return {
    element, grid, deviation: maps.before, region, overlay, compass,
    legend: () => legend(tolerance_mm),
  };
}
