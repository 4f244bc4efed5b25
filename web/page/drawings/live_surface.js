// SPDX-License-Identifier: Apache-2.0
// The surface that a sweep has seen so far, from above, and what of the region is still missing.
import { fetchPicture, get, live, repeat } from '../api.js';
import { clear, h, hint } from '../dom.js';
import { compassOfPlan, drawCropped, mapFrame, marksNote, viewOf } from './map_frame.js';
import { paintHeights, paintMissing, readPacked } from './maps.js';
import { S } from '../words.js';

const kEvery_ms = 500;
const kStep_m = 0.02;
const kMissing = 32767;

/// Heights in metres, and where the region is not seen: 1, else NaN. Null where there is no map.
export async function fetchSurface(path) {
  const response = await fetchPicture(path);
  if (!response.ok) return null;
  const { width, height, values } = await readPacked(await response.arrayBuffer(), 1);
  const missing = values.map((value) => (value === kMissing ? 1 : NaN));
  return {
    heights: {
      width, height, values: values.map((value) => (value === kMissing ? NaN : value * 1e-4)),
    },
    missing: { width, height, values: missing },
    grid: {
      width, height, step: kStep_m, x_min: -width * kStep_m / 2, y_min: -height * kStep_m / 2,
    },
  };
}

/// The posture in the plan that this sweep will be compared with; null where there is none.
async function plannedPosture() {
  const { session, scan } = live.status ?? {};
  if (session?.purpose !== 'fraction' || scan?.purpose !== 'fraction') return null;
  const id = session.reference?.id;
  return id ? (await get(`references/${id}`, true)).plan?.posture ?? null : null;
}

/// Grows while a sweep goes on; until the reference marker has been seen it says that this is what
/// it waits for.
export function liveSurface() {
  const text = S.scan;
  const canvas = h('canvas', { class: 'still-map', role: 'img', 'aria-label': text.surfaceMap });
  const box = h('div', { class: 'live-box' });
  const note = hint(text.surfaceWaits);
  const keys = h('p', { class: 'keys', hidden: true },
    h('span', { class: 'key seen' }, text.surfaceSeen),
    h('span', { class: 'key hole' }, text.surfaceMissing));
  const marksPlace = h('div', {});
  let posture = null;
  plannedPosture().then((found) => { posture = found; }, () => {});  // then the room's axes only
  const draw = ({ heights, missing, grid }) => {
    // All that is seen or wanted, so that the picture's scale does not change with every step.
    const shown = { ...heights, values: heights.values.map((z, i) =>
      (Number.isNaN(z) ? missing.values[i] : z)) };
    const view = viewOf(grid, shown);
    drawCropped(canvas, view, (whole) => {
      paintHeights(whole, heights, grid.step, 1);
      paintMissing(whole, missing);
    });
    const compass = compassOfPlan(live.status?.room, posture);
    clear(box, mapFrame({ grid, view, canvas, compass }));
    clear(marksPlace, compass?.by === 'plan' && marksNote(compass));
    box.style.setProperty('--aspect', `${view.width / view.height}`);
    note.hidden = true;
    keys.hidden = false;
    keys.lastElementChild.hidden = !missing.values.some((value) => value === 1);
  };
  const element = h('figure', { class: 'live-surface' }, box, marksPlace, note, keys);
  let stopped = false;
  const end = repeat(async () => {
    const surface = await fetchSurface('scan/surface').catch(() => null);
    if (surface && !stopped) draw(surface);
    return kEvery_ms;
  });
  return { element, stop: () => { stopped = true; end(); } };
}
