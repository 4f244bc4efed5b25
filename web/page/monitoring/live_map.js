// SPDX-License-Identifier: Apache-2.0
// Where the body's surface lies higher or lower now than it was scanned: twice a second.
import { live, repeat } from '../api.js';
import { clear, h } from '../dom.js';
import { fetchSurface } from '../drawings/live_surface.js';
import { compassOf, drawCropped, mapFrame, viewOf } from '../drawings/map_frame.js';
import { paintErrors, paintMissing } from '../drawings/maps.js';
import { S } from '../words.js';

const kEvery_ms = 500;

/// Hidden where nothing newer than a second is known.
export function liveMap() {
  const text = S.monitor;
  const canvas = h('canvas', { class: 'still-map', role: 'img', 'aria-label': text.bodyNow });
  const box = h('div', { class: 'live-box' });
  const element = h('figure', { class: 'live-map', hidden: true },
    h('figcaption', {}, text.bodyNow), box, h('p', { class: 'keys' },
      h('span', { class: 'key low' }, text.bodyLower),
      h('span', { class: 'key high' }, text.bodyHigher),
      h('span', { class: 'key hole' }, text.bodyHidden)));
  const draw = ({ heights, missing, grid }, tolerance_mm) => {
    // All of the region, seen now or not, so that the picture stays where it is.
    const region = { ...heights, values: heights.values.map((z, i) =>
      (missing.values[i] === 1 ? 1 : z)) };
    const view = viewOf(grid, region);
    drawCropped(canvas, view, (whole) => {
      paintErrors(whole, heights, tolerance_mm / 1000);
      paintMissing(whole, missing);
    });
    clear(box, mapFrame({ grid, view, canvas, compass: compassOf(live.status?.room, null) }));
    box.style.setProperty('--aspect', `${view.width / view.height}`);
  };
  let stopped = false;
  const end = repeat(async () => {
    const { monitor } = live;
    const map = monitor?.active ? await fetchSurface('monitor/map').catch(() => null) : null;
    if (stopped) return kEvery_ms;
    element.hidden = !map;
    if (map) draw(map, monitor.shift_tolerance_mm);
    return kEvery_ms;
  });
  return { element, stop: () => { stopped = true; end(); } };
}
