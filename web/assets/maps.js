// Maps of float values: reading the appliance's TIFF files, colours, drawing.

/// The values of an uncompressed or deflated 32-bit float TIFF in strips, as the appliance writes it: {width, height, values}, row 0 first.
export async function readTiff(buffer) {
  const view = new DataView(buffer);
  const little = view.getUint16(0) === 0x4949;
  if (view.getUint16(2, little) !== 42) throw new Error('no TIFF');
  const start = view.getUint32(4, little);
  const tags = new Map();
  for (let i = 0, n = view.getUint16(start, little); i < n; ++i) {
    const at = start + 2 + 12 * i;
    const short = view.getUint16(at + 2, little) === 3;
    const count = view.getUint32(at + 4, little);
    const place = count * (short ? 2 : 4) <= 4 ? at + 8 : view.getUint32(at + 8, little);
    tags.set(view.getUint16(at, little), Array.from({ length: count }, (_, k) => (short ? view.getUint16(place + 2 * k, little) : view.getUint32(place + 4 * k, little))));
  }
  const tag = (id, otherwise) => tags.get(id)?.[0] ?? otherwise;
  const width = tag(256);
  const height = tag(257);
  if (tag(258) !== 32 || tag(339) !== 3 || ![1, 8, 32946].includes(tag(259, 1)) || !(width * height <= 2 ** 25)) throw new Error('another kind of TIFF');
  const values = new Float32Array(width * height);
  let filled = 0;
  for (const [i, offset] of tags.get(273).entries()) {
    let strip = buffer.slice(offset, offset + tags.get(279)[i]);
    if (tag(259, 1) !== 1) strip = await new Response(new Blob([strip]).stream().pipeThrough(new DecompressionStream('deflate'))).arrayBuffer();
    if (little) {
      values.set(new Float32Array(strip, 0, Math.min(strip.byteLength >> 2, values.length - filled)), filled);
    } else {
      const cells = new DataView(strip);
      for (let k = 0; k < strip.byteLength >> 2; ++k) values[filled + k] = cells.getFloat32(4 * k);
    }
    filled += strip.byteLength >> 2;
  }
  if (filled < values.length) throw new Error('a TIFF that ends early');
  return { width, height, values };
}

export const kOutside = 0.28;  // light of what lies outside the region
// Stops of the signed scale, in units of the tolerance: blue where the current surface is lower, orange where it is higher.
const kStops = [[-20, 8, 29, 88], [-10, 33, 85, 152], [-5, 66, 130, 190], [-2, 120, 180, 220], [-1, 190, 214, 228], [-0.999, 226, 232, 236], [0, 250, 250, 248], [0.999, 245, 236, 226], [1, 250, 208, 160], [2, 244, 166, 90], [5, 217, 103, 30], [10, 160, 60, 10], [20, 92, 28, 6]];

export function errorColour(tolerances) {
  const value = Math.max(-20, Math.min(20, tolerances));
  let i = 1;
  while (i < kStops.length - 1 && kStops[i][0] < value) ++i;
  const [a, b] = [kStops[i - 1], kStops[i]];
  const share = (value - a[0]) / (b[0] - a[0]);
  return [1, 2, 3].map((k) => a[k] + (b[k] - a[k]) * share);
}

const kSteps = 1024;
/// A table of colours over -20..20 tolerances, for speed.
export const errorTable = () => Uint8ClampedArray.from(Array.from({ length: kSteps }, (_, i) => errorColour((i / (kSteps - 1)) * 40 - 20)).flat());
export const errorIndex = (tolerances) => Math.round((Math.max(-20, Math.min(20, tolerances)) + 20) / 40 * (kSteps - 1));

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

/// @param region  A map that is NaN outside the region of interest: what lies there is dimmed. The colours within are those of the scale.
export function paintErrors(canvas, map, tolerance_m, region = null) {
  const colours = errorTable();
  paint(canvas, map, (i, out) => {
    const value = map.values[i];
    if (Number.isNaN(value)) { out[0] = 70; out[1] = 76; out[2] = 82; out[3] = 255; return; }
    const at = 3 * errorIndex(value / tolerance_m);
    const light = region && Number.isNaN(region.values[i]) ? kOutside : 1;
    out[0] = colours[at] * light; out[1] = colours[at + 1] * light; out[2] = colours[at + 2] * light; out[3] = 255;
  });
}

const kBoth = [148, 132, 168];
const kReferenceOnTop = [62, 118, 232];
const kCurrentOnTop = [226, 74, 62];
/// Both surfaces from above: whichever lies higher by more than the tolerance shows its colour. The background is dark.
export function paintOverlay(canvas, base, deviation, tolerance_m, step) {
  const { width, values } = base;
  paint(canvas, base, (i, out) => {
    const d = deviation.values[i];
    const z = values[i];
    if (Number.isNaN(d)) { out[0] = 30; out[1] = 37; out[2] = 44; out[3] = 255; return; }
    const colour = d > tolerance_m ? kCurrentOnTop : d < -tolerance_m ? kReferenceOnTop : kBoth;
    const slope = (((values[i + kReach * width] - values[i - kReach * width]) || 0) - ((values[i + kReach] - values[i - kReach]) || 0)) / (2 * kReach * step);
    // The floor is flat and large: darker, so that the body stands out and nothing glares.
    const light = (z < 0.02 ? 0.45 : 0.8) + 0.25 * Math.max(-1.2, Math.min(1.2, slope));
    for (let k = 0; k < 3; ++k) out[k] = colour[k] * Math.max(0.2, light);
    out[3] = 255;
  });
}

const kReach = 4;  // cells; less shows the noise, not the body
/// Heights as a lit surface: brightness by slope, tint by height.
export function paintHeights(canvas, map, step) {
  const { width, values } = map;
  let top = 0.05;
  for (let i = 0; i < values.length; i += 97) if (values[i] > top) top = values[i];
  paint(canvas, map, (i, out) => {
    const z = values[i];
    if (Number.isNaN(z)) { out[0] = 24; out[1] = 30; out[2] = 36; out[3] = 255; return; }
    const dx = values[i + kReach] - values[i - kReach];
    const dy = values[i + kReach * width] - values[i - kReach * width];
    const slope = ((dx || 0) * -1 + (dy || 0)) / (2 * kReach * step);  // undefined and NaN count as flat
    const light = Math.max(0.25, Math.min(1, 0.66 + 0.3 * Math.max(-1.2, Math.min(1.2, slope))));
    const level = Math.max(0, Math.min(1, z / top));
    out[0] = (95 + 130 * level) * light; out[1] = (120 + 85 * level) * light; out[2] = (140 + 20 * level) * light; out[3] = 255;
  });
}

/// Nearest cell of a point in metres, or -1.
export function cellAt(grid, x, y) {
  const column = Math.floor((x - grid.x_min) / grid.step);
  const row = Math.floor((y - grid.y_min) / grid.step);
  return column >= 0 && column < grid.width && row >= 0 && row < grid.height ? row * grid.width + column : -1;
}
