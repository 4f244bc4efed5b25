// SPDX-License-Identifier: Apache-2.0
// The body of a reference from above, small enough to stand beside a code: whoever confirms who is
// on the couch sees whether this can be the body.
import { clear, h, svg } from '../dom.js';
import { S } from '../words.js';
import { cropOf, loadMap, outlineOf } from './maps.js';

/// Empty until it has come, and where the reference has none.
export function silhouette(reference) {
  const place = h('span', { class: 'silhouette' });
  const draw = (body) => {
    const { width, height } = body;
    const grid = { width, height, step: 1 };  // its size does not matter here
    const crop = cropOf(body, grid, 0);
    clear(place, svg('svg', {
      viewBox: [crop.left * width, crop.top * height, crop.width * width, crop.height * height]
        .map((value) => value.toFixed(1)).join(' '),
      role: 'img', 'aria-label': S.patients.silhouette,
    }, svg('path', { d: outlineOf(body, grid) })));
  };
  if (reference?.scan_id) loadMap(reference.scan_id, 'body').then(draw).catch(() => {});
  return place;
}
