// The error map with a cursor that reads millimetres, and the profile through it.
import { fileUrl, get, getBytes } from './api.js';
import { clear, h, svg } from './dom.js';
import { cellAt, paintErrors, paintOverlay, readTiff } from './maps.js';
import { signed } from './numbers.js';
import { S } from './strings.js';

function legend(tolerance_mm) {
  const text = S.result;
  return h('div', { class: 'legend' }, h('span', {}, `−${(20 * tolerance_mm).toFixed(0)} mm`), h('span', { class: 'scale', role: 'img', 'aria-label': `${text.lower}, ${text.higher}` }), h('span', {}, `+${(20 * tolerance_mm).toFixed(0)} mm`),
    h('span', { class: 'keys' }, h('span', { class: 'key low' }, text.lower), h('span', { class: 'key high' }, text.higher), h('span', { class: 'key gap' }, text.unknown)));
}

function profile(grid, reference, deviation, cursor, along) {
  const points = [];
  const n = along === 0 ? grid.width : grid.height;
  for (let i = 0; i < n; i += 2) {
    const x = along === 0 ? grid.x_min + (i + 0.5) * grid.step : cursor.x;
    const y = along === 0 ? cursor.y : grid.y_min + (i + 0.5) * grid.step;
    const cell = cellAt(grid, x, y);
    if (cell >= 0) points.push({ s: i / n, z: reference.values[cell], d: deviation.values[cell] });
  }
  const heights = points.flatMap((point) => [point.z, point.z + point.d]).filter(Number.isFinite);
  const low = Math.min(-0.02, ...heights);
  const high = Math.max(0.1, ...heights);
  const path = (value) => {
    let pen = 'M';
    let d = '';
    for (const point of points) {
      const z = value(point);
      if (!Number.isFinite(z)) { pen = 'M'; continue; }
      d += `${pen}${(point.s * 600).toFixed(1)} ${(150 - (z - low) / (high - low) * 140).toFixed(1)}`;
      pen = 'L';
    }
    return d;
  };
  const here = along === 0 ? (cursor.x - grid.x_min) / (grid.width * grid.step) : (cursor.y - grid.y_min) / (grid.height * grid.step);
  return svg('svg', { viewBox: '0 0 600 160', class: 'profile', role: 'img', 'aria-label': S.result.sliceLabel, preserveAspectRatio: 'none' },
    svg('line', { x1: here * 600, x2: here * 600, y1: 0, y2: 160, class: 'zero' }), svg('path', { d: path((point) => point.z), class: 'line-reference' }), svg('path', { d: path((point) => point.z + point.d), class: 'line-current' }));
}

/// Map and reading side by side; the map is never higher than three quarters of the window.
function row(grid, ...children) {
  const element = h('div', { class: 'map-row' }, ...children);
  element.style.setProperty('--map-width', `${75 * grid.width / grid.height}vh`);
  return element;
}

const kAround = 2;  // cells to each side: what is read is the surface, not one cell's noise
function around({ width, values }, cell) {
  const known = [];
  for (let dy = -kAround; dy <= kAround; ++dy) for (let dx = -kAround; dx <= kAround; ++dx) {
    const value = values[cell + dy * width + dx];
    if (Number.isFinite(value)) known.push(value);
  }
  return known.length * 4 < (2 * kAround + 1) ** 2 ? NaN : known.sort((a, b) => a - b)[known.length >> 1];
}

/// Figure with map, reading and profile for a scan with a result; falls back to the picture.
export async function errorMap(scan, reference, tolerance_mm) {
  const text = S.result;
  const picture = () => h('figure', {}, h('img', { src: fileUrl(scan.id, 'error_map.png'), alt: text.mapPicture, class: 'picture' }));
  let grid;
  let maps;
  let heights;
  try {
    const scene = await get(`scans/${reference.scan_id}/files/scene.json`, true);
    grid = scene.heightmap;
    const [before, after, base] = await Promise.all([
      getBytes(`scans/${scan.id}/files/deviation.tiff`).then(readTiff), getBytes(`scans/${scan.id}/files/deviation_after.tiff`).then(readTiff, () => null), getBytes(`scans/${reference.scan_id}/files/heightmap.tiff`).then(readTiff)]);
    if (before.width !== grid.width || before.height !== grid.height || base.width !== grid.width) throw new Error();
    maps = { before, after };
    heights = base;
  } catch {
    return { element: h('div', {}, h('p', { class: 'hint' }, text.mapFailed), picture()), grid: null };
  }

  const canvas = h('canvas', { class: 'map', tabindex: '0', role: 'application', 'aria-label': text.mapLabel });
  const cross = h('div', { class: 'cross', 'aria-hidden': 'true' });
  const reading = h('p', { class: 'reading', 'aria-live': 'polite' });
  const slice = h('div', {});
  const shown = { map: 'before', along: 0 };
  const cursor = { x: grid.x_min + grid.width * grid.step / 2, y: grid.y_min + grid.height * grid.step / 2 };
  const isocentre = scan.details?.correction?.isocentre;
  if (isocentre) [cursor.x, cursor.y] = isocentre;

  const read = () => {
    const cell = cellAt(grid, cursor.x, cursor.y);
    const value = cell < 0 ? NaN : around(maps[shown.map], cell);
    clear(reading, h('strong', {}, cell < 0 ? text.outsideMap : Number.isNaN(value) ? text.unknown : text.reads(signed(1000 * value))), ` ${text.at(cursor.x, cursor.y)}`);
    cross.style.setProperty('left', `${100 * (cursor.x - grid.x_min) / (grid.width * grid.step)}%`);
    cross.style.setProperty('top', `${100 * (1 - (cursor.y - grid.y_min) / (grid.height * grid.step))}%`);
    clear(slice, profile(grid, heights, maps[shown.map], cursor, shown.along));
  };
  const move = (x, y) => {
    cursor.x = Math.max(grid.x_min, Math.min(grid.x_min + (grid.width - 0.5) * grid.step, x));
    cursor.y = Math.max(grid.y_min, Math.min(grid.y_min + (grid.height - 0.5) * grid.step, y));
    read();
  };
  canvas.addEventListener('pointermove', (event) => {
    const box = canvas.getBoundingClientRect();
    move(grid.x_min + (event.clientX - box.left) / box.width * grid.width * grid.step, grid.y_min + (1 - (event.clientY - box.top) / box.height) * grid.height * grid.step);
  });
  canvas.addEventListener('keydown', (event) => {
    const by = (event.shiftKey ? 0.05 : 0.005);
    const direction = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!direction) return;
    event.preventDefault();
    move(cursor.x + by * direction[0], cursor.y + by * direction[1]);
  });
  const draw = () => paintErrors(canvas, maps[shown.map], tolerance_mm / 1000, shown.map === 'before' ? maps.after : null);
  const choose = (name, value, label, apply) => {
    const input = h('input', { type: 'radio', name, value, checked: value === shown[name === 'map' ? 'map' : 'along'] });
    input.addEventListener('change', () => { shown[name === 'map' ? 'map' : 'along'] = value; apply(); });
    return h('label', { class: 'check' }, input, ' ', label);
  };
  draw();
  read();
  const box = h('div', { class: 'map-box' }, canvas, cross);
  const profileBox = h('div', {}, h('h3', {}, text.slice), h('fieldset', { class: 'row plainset' }, h('legend', { class: 'visually-hidden' }, text.slice), choose('along', 0, text.sliceAlong[0], read), choose('along', 1, text.sliceAlong[1], read)), slice,
    h('p', { class: 'keys' }, h('span', { class: 'key reference' }, text.reference_), h('span', { class: 'key current' }, text.current_)));
  const element = h('div', {},
    h('fieldset', { class: 'row plainset' }, h('legend', { class: 'visually-hidden' }, text.where), choose('map', 'before', text.before, () => { draw(); read(); }), maps.after && choose('map', 'after', text.after, () => { draw(); read(); })),
    row(grid, box, h('div', { class: 'map-side' }, reading, legend(tolerance_mm), profileBox)));
  const overlay = (target) => paintOverlay(target, heights, maps.before, tolerance_mm / 1000, grid.step);
  return { element, grid, deviation: maps.before, region: maps.after, overlay };
}
