// SPDX-License-Identifier: Apache-2.0
// The parts of the 3-D view that need no browser: reading packed surfaces, whole and damaged, and
// the motion that a correction is shown as: surface_test.mjs NODE_MODULES SOURCE_FOLDER
import {
  copyFileSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync,
} from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { deflateSync } from 'node:zlib';

const [modules, source] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), 'plumb-surface-'));
writeFileSync(join(folder, 'package.json'), '{"type": "module"}');
symlinkSync(modules, join(folder, 'node_modules'));
for (const name of ['inflate', 'packed_mesh', 'mesh_motion']) {
  copyFileSync(join(source, 'web/page/drawings', `${name}.js`), join(folder, `${name}.js`));
}
const load = (file) => import(pathToFileURL(file).href);
const { readMesh } = await load(join(folder, 'packed_mesh.js'));
const { correctionOf, fractionOf } = await load(join(folder, 'mesh_motion.js'));
const { Vector3 } = await load(createRequire(join(folder, 'package.json')).resolve('three')
  .replace('three.cjs', 'three.module.js'));
rmSync(folder, { recursive: true });

const failures = [];
const check = (holds, what) => { if (!holds) failures.push(what); };

// --- Packed surfaces, written from the description in daemon/files/compact_map.hpp.
const kStep = 0.001;
const kLeast = [-0.5, 0.25, 1];
function packed(content, { vertices, triangles, magic = 'PLM2' }) {
  const head = Buffer.alloc(28);
  head.write(magic);
  [vertices, triangles].forEach((number, i) => head.writeUInt32LE(number, 4 + 4 * i));
  [...kLeast, kStep].forEach((number, i) => head.writeFloatLE(number, 12 + 4 * i));
  const bytes = Buffer.concat([head, deflateSync(Buffer.from(content))]);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
}
// X, y and z of each vertex.
const kSteps = [[0, 0, 65535], [300, 2, 0], [7, 65535, 9], [0, 1, 12]];
const kTriangles = [[0, 1, 2], [3, 0, 2]];
const bytesOfVertices = () => [0, 1, 2].flatMap((axis) => kSteps.flatMap((steps, i) => {
  const difference = (steps[axis] - (i ? kSteps[i - 1][axis] : 0)) & 0xffff;
  return [difference & 0xff, difference >> 8];
}));
const bytesOfCorners = (corners) => corners.flatMap((corner, i) => {
  const difference = corner - (i ? corners[i - 1] : 0);
  let zigzag = difference < 0 ? -2 * difference - 1 : 2 * difference;
  const bytes = [];
  for (; zigzag >= 0x80; zigzag = Math.floor(zigzag / 0x80)) bytes.push((zigzag & 0x7f) | 0x80);
  return [...bytes, zigzag];
});
const kSize = { vertices: 4, triangles: 2 };
const kWhole = [...bytesOfVertices(), ...bytesOfCorners(kTriangles.flat())];
const whole = packed(kWhole, kSize);

const { positions, corners } = await readMesh(whole);
check([...corners].join() === kTriangles.flat().join(), `the corners: ${corners}`);
kSteps.flat().forEach((steps, i) => {
  check(Math.abs(positions[i] - kLeast[i % 3] - steps * kStep) < 1e-5,
    `coordinate ${i}: ${positions[i]}`);
});
const empty = await readMesh(packed([], { vertices: 0, triangles: 0 }));
check(empty.positions.length === 0 && empty.corners.length === 0, 'an empty surface');

const withCorners = (bytes, triangles = 2) =>
  packed([...bytesOfVertices(), ...bytes], { vertices: 4, triangles });
const kMost = 2 ** 25;
for (const [what, bytes, expected] of [
  ['nothing', new ArrayBuffer(0), 'no surface'],
  ['less than a head', whole.slice(0, 27), 'no surface'],
  ['something else', packed(kWhole, { ...kSize, magic: 'PLM1' }), 'no surface'],
  ['too many vertices', packed(kWhole, { vertices: kMost + 1, triangles: 2 }), 'no surface'],
  ['too many triangles', packed(kWhole, { vertices: 4, triangles: kMost + 1 }), 'no surface'],
  ['as many as there may be, which are not there',
    packed(kWhole, { vertices: kMost, triangles: kMost }), 'ends early'],
  ['a head alone', whole.slice(0, 28), ''],
  ['half a stream', whole.slice(0, 28 + Math.floor((whole.byteLength - 28) / 2)), ''],
  ['vertices that end early', packed(kWhole.slice(0, 20), kSize), 'ends early'],
  ['corners that end early', packed(kWhole.slice(0, -1), kSize), 'ends early'],
  ['a last corner that ends early', withCorners([...bytesOfCorners([0, 1, 2, 3, 0]), 0x80]),
    'a triangle'],
  ['a corner past the last vertex', withCorners(bytesOfCorners([0, 1, 2, 3, 0, 4])), 'a triangle'],
  ['a corner before the first vertex', withCorners(bytesOfCorners([0, 1, 2, 3, -1, 2])),
    'a triangle'],
  ['a corner that is far off', withCorners(bytesOfCorners([0, 1, 2, 3, 2 ** 40, 2])), 'a triangle'],
  ['a number without end', withCorners(Array(5000).fill(0x80)), 'a triangle'],
  ['a number of ever more bits', withCorners(Array(5000).fill(0xff)), 'a triangle'],
]) {
  const refusal = await readMesh(bytes).then(() => null, (error) => error);
  check(refusal instanceof Error && refusal.message.includes(expected), `${what}: ${refusal}`);
}
// What the appliance packs, a browser reads.
const bound = (file, pattern) =>
  Number(pattern.exec(readFileSync(join(source, file), 'utf8'))?.[1]);
check(bound('web/page/drawings/packed_mesh.js', /kMost = 2 \*\* (\d+);/) === 25,
  'the most parts that are read');
check(bound('daemon/files/compact_map.cpp', /kMostParts = std::size_t\{1\} << (\d+);/) === 25,
  'the most parts that are packed');

// --- The correction, on matrices of plain numbers: rows of a rotation about an axis, and a shift.
function rigid(axis, degrees, shift) {
  const length = Math.hypot(...axis);
  const [x, y, z] = axis.map((value) => value / length);
  const [c, s] = [Math.cos(degrees * Math.PI / 180), Math.sin(degrees * Math.PI / 180)];
  const d = 1 - c;
  return [
    [c + x * x * d, x * y * d - z * s, x * z * d + y * s, shift[0]],
    [y * x * d + z * s, c + y * y * d, y * z * d - x * s, shift[1]],
    [z * x * d - y * s, z * y * d + x * s, c + z * z * d, shift[2]],
    [0, 0, 0, 1]];
}
const moved = (M, p) =>
  [0, 1, 2].map((row) => M[row][0] * p[0] + M[row][1] * p[1] + M[row][2] * p[2] + M[row][3]);
const movedBack = (M, p) => {
  const q = p.map((value, i) => value - M[i][3]);
  return [0, 1, 2].map((row) => M[0][row] * q[0] + M[1][row] * q[1] + M[2][row] * q[2]);
};
const by = (matrix, p) => new Vector3(...p).applyMatrix4(matrix).toArray();
const apart = (a, b) => Math.hypot(...a.map((value, i) => value - b[i]));

const T = rigid([1, -2, 3], 70, [0.4, -0.9, 0.2]);  // from the surface's frame to the map's
const M = rigid([2, 1, -1], 12, [0.03, -0.05, 0.02]);  // of the body, in the map's frame
const kPoints = [[0, 0, 0], [0.3, -0.2, 0.1], [-0.4, 0.5, 0.25]];
const correction = correctionOf(T, M);
for (const p of kPoints) {
  check(apart(moved(T, by(correction, p)), movedBack(M, moved(T, p))) < 1e-9,
    `the correction of ${p}: in the map's frame, the motion undone`);
  const swapped = moved(T, movedBack(M, movedBack(T, p)));
  check(apart(by(correction, p), swapped) > 0.01,
    `${p}: this T and M tell the order of the product`);
  check(apart(by(correctionOf(null, M), p), movedBack(M, p)) < 1e-9, `${p}: one frame`);
}

const centre = [0.2, 0.1, 0.15];
const motionAt = (fraction) => fractionOf(correction, fraction, new Vector3(...centre));
const turnOf = ({ elements: e }) => Math.acos((e[0] + e[5] + e[10] - 1) / 2) * 180 / Math.PI;
for (const p of kPoints) {
  check(apart(by(motionAt(0), p), p) < 1e-9, `${p}: nothing has moved at first`);
  check(apart(by(motionAt(1), p), by(correction, p)) < 1e-9,
    `${p}: all of the correction at the end`);
}
for (const fraction of [0.25, 0.5, 0.8]) {
  check(Math.abs(turnOf(motionAt(fraction)) - 12 * fraction) < 1e-6, `${fraction} of the turn`);
  const end = by(correction, centre);
  const expected = centre.map((value, i) => value + fraction * (end[i] - value));
  check(apart(by(motionAt(fraction), centre), expected) < 1e-9,
    `${fraction} of the way of the centre`);
}

for (const failure of failures) console.log(`  - ${failure}`);
console.log(failures.length ? `${failures.length} failures` : 'all well');
process.exit(failures.length ? 1 : 0);
