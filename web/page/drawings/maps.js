// SPDX-License-Identifier: Apache-2.0
// Maps of heights: reading them, colours, drawing.
import { getBytes } from '../api.js';
import { inflated } from './inflate.js';

const kNone = -32768;

/// A packed map, as daemon/files/compact_map.hpp writes it: {width, height, values} on the whole
/// grid, row 0 first, metres (for "region": 1 measured, 2 a hole), NaN where there is none.
export async function readPacked(buffer, scale = 1e-4) {
  const head = new DataView(buffer);
  if (head.byteLength < 16 || head.getUint32(0) !== 0x504c4d31) throw new Error('no map');
  const [width, height, x0, y0, w, h] = Array.from({ length: 6 },
    (_, i) => head.getUint16(4 + 2 * i, true));
  if (!(width * height <= 2 ** 25) || x0 + w > width || y0 + h > height) throw new Error('no map');
  const cells = new DataView(await inflated(buffer, 16));
  if (cells.byteLength !== 2 * w * h) throw new Error('a map that ends early');
  const values = new Float32Array(width * height).fill(NaN);
  for (let row = 0; row < h; ++row) {
    let cell = 0;
    for (let column = 0; column < w; ++column) {
      cell = (cell + cells.getUint16(2 * (row * w + column), true)) & 0xffff;
      const value = cell << 16 >> 16;
      if (value !== kNone) values[(y0 + row) * width + x0 + column] = value * scale;
    }
  }
  return { width, height, values };
}

/// @param onPart  Called with the bytes received and their number, while they come.
export const loadMap = (scanId, name, onPart) =>
  getBytes(`scans/${scanId}/maps/${name}`, onPart)
    .then((bytes) => readPacked(bytes, ['region', 'body'].includes(name) ? 1 : 1e-4));

export const kOutside = 0.28;  // light of what lies outside the region
// Stops of the signed scale, in units of the tolerance: blue where the current surface is lower,
// orange where it is higher.
const kStops = [
  [-20, 8, 29, 88], [-10, 33, 85, 152], [-5, 66, 130, 190], [-2, 120, 180, 220],
  [-1, 190, 214, 228],
  [-0.999, 226, 232, 236], [0, 250, 250, 248], [0.999, 245, 236, 226], [1, 250, 208, 160],
  [2, 244, 166, 90], [5, 217, 103, 30], [10, 160, 60, 10], [20, 92, 28, 6],
];

export function errorColour(tolerances) {
  const value = Math.max(-20, Math.min(20, tolerances));
  let i = 1;
  while (i < kStops.length - 1 && kStops[i][0] < value) ++i;
  const [a, b] = [kStops[i - 1], kStops[i]];
  const fraction = (value - a[0]) / (b[0] - a[0]);
  return [1, 2, 3].map((k) => a[k] + (b[k] - a[k]) * fraction);
}

const kSteps = 1024;
/// A table of colours over -20..20 tolerances, for speed.
export const errorTable = () => Uint8ClampedArray.from(
  Array.from({ length: kSteps }, (_, i) => errorColour((i / (kSteps - 1)) * 40 - 20)).flat());
export const errorIndex = (tolerances) =>
  Math.round((Math.max(-20, Math.min(20, tolerances)) + 20) / 40 * (kSteps - 1));

/// Paints a map into a canvas with y up; `colour(index, out)` writes r, g, b, a of a cell.
export function paint(canvas, { width, height }, colour) {
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d');
  const image = context.createImageData(width, height);
  const out = [0, 0, 0, 0];
  for (let row = 0; row < height; ++row) {
    for (let column = 0; column < width; ++column) {
      colour(row * width + column, out);
      image.data.set(out, 4 * ((height - 1 - row) * width + column));
    }
  }
  context.putImageData(image, 0, 0);
}

const kUnmeasured = [46, 53, 60];
// Black and white in stripes: seen whatever colours a person tells apart, and in no scale.
const kHole = [255, 255, 255];
const kHoleDark = [10, 10, 12];

/// Whether a cell lies where most cells of the region around it were not measured.
function holesOf({ width, height, values }) {
  const block = 8;  // cells
  const columns = Math.ceil(width / block);
  const all = new Uint8Array(columns * Math.ceil(height / block));
  const missing = new Uint8Array(all.length);
  const blockOf = (i) => Math.floor(Math.floor(i / width) / block) * columns
    + Math.floor((i % width) / block);
  for (let i = 0; i < values.length; ++i) {
    if (Number.isNaN(values[i])) continue;
    ++all[blockOf(i)];
    if (values[i] === 2) ++missing[blockOf(i)];
  }
  return (i) => 2 * missing[blockOf(i)] > all[blockOf(i)];
}

/// @param region  1 or 2 within the region of interest (2: not measured, a hole), NaN outside,
/// where the map is dimmed. The colours within are those of the scale.
export function paintErrors(canvas, map, tolerance_m, region = null) {
  const colours = errorTable();
  const { width } = map;
  const isHole = region ? holesOf(region) : () => false;
  const set = (out, [r, g, b]) => { out[0] = r; out[1] = g; out[2] = b; out[3] = 255; };
  paint(canvas, map, (i, out) => {
    const value = map.values[i];
    const inside = region ? region.values[i] : 1;
    if (Number.isNaN(value)) {
      if (inside === 2 && !isHole(i)) return;  // a single cell: as the one beside it
      const hatched = inside === 2 && (i % width + Math.floor(i / width)) % 12 < 6;
      set(out, inside === 2 ? hatched ? kHole : kHoleDark : kUnmeasured);
      return;
    }
    const at = 3 * errorIndex(value / tolerance_m);
    const light = Number.isNaN(inside) ? kOutside : 1;
    set(out, [colours[at] * light, colours[at + 1] * light, colours[at + 2] * light]);
  });
}

const kBlock = 4;  // cells: single cells of noise make no edge

/// The region in blocks of cells, each inside where at least half of its cells are.
function blocksOf({ width, height, values }) {
  const columns = Math.ceil(width / kBlock);
  const rows = Math.ceil(height / kBlock);
  const counts = new Uint8Array(columns * rows);
  for (let i = 0; i < values.length; ++i) {
    if (Number.isNaN(values[i])) continue;
    const column = i % width;
    const row = (i - column) / width;
    ++counts[Math.floor(row / kBlock) * columns + Math.floor(column / kBlock)];
  }
  return { columns, rows, inside: counts.map((count) => (2 * count >= kBlock * kBlock ? 1 : 0)) };
}

/// The edge of the region as an SVG path in metres of the map, x right, y down from the top.
export function outlineOf(region, grid) {
  const { columns, rows, inside } = blocksOf(region);
  const at = (row, column) => (row >= 0 && row < rows && column >= 0 && column < columns
    ? inside[row * columns + column] : 0);
  const x = (column) => (Math.min(column * kBlock, grid.width) * grid.step).toFixed(4);
  const y = (row) => ((grid.height - Math.min(row * kBlock, grid.height)) * grid.step).toFixed(4);
  /// A line for each run of edges: `isEdge(line, i)` for i below `length`.
  const runs = (lines, length, isEdge, draw) => {
    let path = '';
    for (let line = 0; line <= lines; ++line) {
      for (let i = 0, begun = -1; i <= length; ++i) {
        const edge = i < length && isEdge(line, i);
        if (edge && begun < 0) begun = i;
        if (edge || begun < 0) continue;
        path += draw(line, begun, i);
        begun = -1;
      }
    }
    return path;
  };
  return runs(rows, columns, (row, column) => at(row, column) !== at(row - 1, column),
    (row, begun, end) => `M${x(begun)} ${y(row)}H${x(end)}`)
    + runs(columns, rows, (column, row) => at(row, column) !== at(row, column - 1),
      (column, begun, end) => `M${x(column)} ${y(begun)}V${y(end)}`);
}

/// The part of the grid that holds the region and `margin_m` around it: {left, top, width, height}
/// as fractions of the whole picture (y down); the whole where there is no region.
export function cropOf(region, grid, margin_m = 0.1) {
  const { width, height, values } = region;
  let [x0, x1, y0, y1] = [width, -1, height, -1];
  for (let i = 0; i < values.length; ++i) {
    if (Number.isNaN(values[i])) continue;
    const column = i % width;
    const row = (i - column) / width;
    if (column < x0) x0 = column;
    if (column > x1) x1 = column;
    if (row < y0) y0 = row;
    y1 = row;
  }
  if (x1 < 0) return { left: 0, top: 0, width: 1, height: 1 };
  const margin = Math.round(margin_m / grid.step);
  x0 = Math.max(0, x0 - margin);
  x1 = Math.min(width, x1 + 1 + margin);
  y0 = Math.max(0, y0 - margin);
  y1 = Math.min(height, y1 + 1 + margin);
  return {
    left: x0 / width, top: 1 - y1 / height, width: (x1 - x0) / width, height: (y1 - y0) / height,
  };
}

const kBoth = [148, 132, 168];
const kReferenceOnTop = [62, 118, 232];
const kCurrentOnTop = [226, 74, 62];
/// Both surfaces from above: the one that is higher by more than the tolerance shows its colour.
/// The background is dark.
export function paintOverlay(canvas, base, deviation, tolerance_m, step) {
  const { width, values } = base;
  paint(canvas, base, (i, out) => {
    const d = deviation.values[i];
    const z = values[i];
    if (Number.isNaN(d)) {
      out[0] = 30; out[1] = 37; out[2] = 44; out[3] = 255;
      return;
    }
    const colour = d > tolerance_m ? kCurrentOnTop : d < -tolerance_m ? kReferenceOnTop : kBoth;
    const across = (values[i + kReach] - values[i - kReach]) || 0;
    const along = (values[i + kReach * width] - values[i - kReach * width]) || 0;
    const slope = (along - across) / (2 * kReach * step);
    // The floor is flat and large: darker, so that the body stands out and nothing glares.
    const light = (z < 0.02 ? 0.45 : 0.8) + 0.25 * Math.max(-1.2, Math.min(1.2, slope));
    for (let k = 0; k < 3; ++k) out[k] = colour[k] * Math.max(0.2, light);
    out[3] = 255;
  });
}

const kReach = 4;  // cells; less shows the noise, not the body
/// Heights as a lit surface: brightness by slope, tint by height.
/// @param reach  Cells on either side that a slope is taken over.
export function paintHeights(canvas, map, step, reach = kReach) {
  const { width, values } = map;
  let top = 0.05;
  for (let i = 0; i < values.length; i += 97) if (values[i] > top) top = values[i];
  paint(canvas, map, (i, out) => {
    const z = values[i];
    if (Number.isNaN(z)) {
      out[0] = 24; out[1] = 30; out[2] = 36; out[3] = 255;
      return;
    }
    const dx = values[i + reach] - values[i - reach];
    const dy = values[i + reach * width] - values[i - reach * width];
    // Undefined and NaN count as flat.
    const slope = ((dx || 0) * -1 + (dy || 0)) / (2 * reach * step);
    const light = Math.max(0.25, Math.min(1, 0.66 + 0.3 * Math.max(-1.2, Math.min(1.2, slope))));
    const level = Math.max(0, Math.min(1, z / top));
    out[0] = (95 + 130 * level) * light;
    out[1] = (120 + 85 * level) * light;
    out[2] = (140 + 20 * level) * light;
    out[3] = 255;
  });
}

/// Over a painted map of the same size: hatches the cells that hold 1.
export function paintMissing(canvas, { width, height, values }) {
  const context = canvas.getContext('2d');
  values.forEach((value, i) => {
    if (value !== 1) return;
    const [column, row] = [i % width, Math.floor(i / width)];
    const [r, g, b] = (column + row) % 4 < 2 ? kHole : kHoleDark;
    context.fillStyle = `rgb(${r} ${g} ${b})`;
    context.fillRect(column, height - 1 - row, 1, 1);
  });
}

/// Nearest cell of a point in metres, or -1.
export function cellAt(grid, x, y) {
  const column = Math.floor((x - grid.x_min) / grid.step);
  const row = Math.floor((y - grid.y_min) / grid.step);
  const inside = column >= 0 && column < grid.width && row >= 0 && row < grid.height;
  return inside ? row * grid.width + column : -1;
}
