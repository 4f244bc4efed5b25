// SPDX-License-Identifier: Apache-2.0
// Reading a packed surface.
import { inflated } from './inflate.js';

const kHead = 28;
const kMost = 2 ** 25;  // vertices or triangles, as daemon/files/compact_map.cpp

/// A packed surface, as daemon/files/compact_map.hpp writes it: {positions, corners}, metres, and
/// three corners for each triangle.
export async function readMesh(buffer) {
  const head = new DataView(buffer);
  if (head.byteLength < kHead || head.getUint32(0) !== 0x504c4d32) throw new Error('no surface');
  const [numVertices, numTriangles] = [4, 8].map((at) => head.getUint32(at, true));
  const [x, y, z, step] = [12, 16, 20, 24].map((at) => head.getFloat32(at, true));
  if (!(numVertices <= kMost) || !(numTriangles <= kMost)) throw new Error('no surface');
  const bytes = new Uint8Array(await inflated(buffer, kHead));
  if (bytes.length < 6 * numVertices + 3 * numTriangles) throw new Error('it ends early');
  const positions = new Float32Array(3 * numVertices);
  let at = 0;
  [x, y, z].forEach((least, axis) => {
    for (let i = 0, steps = 0; i < numVertices; ++i, at += 2) {
      steps = (steps + bytes[at] + 256 * bytes[at + 1]) & 0xffff;
      positions[3 * i + axis] = least + steps * step;
    }
  });
  const corners = new Uint32Array(3 * numTriangles);
  for (let i = 0, corner = 0; i < corners.length; ++i) {
    let zigzag = 0;
    for (let shift = 0; ; shift += 7) {
      const byte = bytes[at++];  // undefined after the end
      zigzag += (byte & 0x7f) * 2 ** shift;
      if (!(byte & 0x80)) break;
    }
    corner += zigzag % 2 ? -(zigzag + 1) / 2 : zigzag / 2;
    if (!(corner >= 0 && corner < numVertices) || at > bytes.length) {
      throw new Error('a triangle without its corners');
    }
    corners[i] = corner;
  }
  return { positions, corners };
}
