// SPDX-License-Identifier: Apache-2.0
// The card of the 3-D view, which is loaded only when it is opened.
import { ApiError, getBytes } from '../api.js';
import { action, checkbox, clear, h, hint, saveFrom, select, warn } from '../dom.js';
import { progressIn } from '../drawings/error_map.js';
import { marksNote } from '../drawings/map_frame.js';
import { loadMap } from '../drawings/maps.js';
import { readMesh } from '../drawings/packed_mesh.js';
import { S } from '../words.js';
import { isAdvice } from './common.js';

/// Standard views: from above, from each mark (the gantry stands behind the head or the feet), and
/// askew.
const viewsOf = (compass) => ['top',
  ...Object.keys(compass?.ways ?? {}).filter((name) => name !== 'gantry'), 'reset'];

/// From above is from the front of who lies on the back.
function nameOf(view, compass) {
  const text = S.result;
  const { head, left } = compass?.ways ?? {};
  if (view !== 'top' || compass?.by !== 'posture' || !head || !left) {
    return text.views3d[view] ?? text.marks[view];
  }
  return head[0] * left[1] - head[1] * left[0] < 0 ? text.views3d.anterior : text.views3d.posterior;
}

/// Which way the surface is cut, and where.
function cutControls(view) {
  const text = S.result;
  const way = select(text.cutWays, 'off', { id: 'mesh-cut' });
  const where = h('input', {
    type: 'range', min: 0, max: 1, step: 0.02, value: 0.5, 'aria-label': text.cutWhere,
    hidden: true,
  });
  const apply = () => {
    where.hidden = way.value === 'off';
    view.cut(where.hidden ? '' : way.value, Number(where.value));
  };
  way.addEventListener('change', apply);
  where.addEventListener('input', apply);
  return [h('label', { for: 'mesh-cut' }, text.cut), way, where];
}

const kSurface_ms = 600000;  // on a slow line
/// The bytes that arrived are no surface.
class DamagedSurface extends Error {}

async function surfaceOf(scanId, onPart) {
  const bytes = await getBytes(`scans/${scanId}/maps/mesh`, onPart, kSurface_ms);
  try {
    return await readMesh(bytes);
  } catch (error) {
    throw new DamagedSurface(S.result.meshDamaged, { cause: error });
  }
}

/// A slider between words for its ends; the input itself is named for a screen reader.
const slider = (...parts) => h('div', { class: 'slider' }, parts.map((part) =>
  (typeof part === 'string' ? h('span', { 'aria-hidden': 'true' }, part) : part)));

/// The motion of the body that the correction undoes; null where no correction is advised.
const motionOf = (scan, details) => (isAdvice(scan) && details?.correction?.vertical_mm !== null
  ? details?.motion?.T ?? null : null);

/// From the surface as measured to the surface after the correction, beside the reference.
/// @param showReference  Shows it, once.
function correctionControls(view, canvas, scan, showReference) {
  const text = S.result;
  const fraction = h('input', {
    type: 'range', min: 0, max: 1, step: 0.05, value: 0, 'aria-label': text.correctionFraction,
  });
  let after = null;  // loaded once, however many steps the slider makes meanwhile
  let shown = false;
  fraction.addEventListener('input', async () => {
    if (!shown) showReference();
    shown = true;
    after ??= loadMap(scan.id, 'deviation_after');
    let map;
    try {
      map = await after;
    } catch (error) {
      after = null;
      fraction.value = 0;
      warn(`${text.mapMissing} ${error.message}`);
      return;
    }
    view.correct(Number(fraction.value), map);
    canvas.dataset.corrected = fraction.value;
  });
  return slider(text.before, fraction, text.after);
}

function controls(view, canvas, { reference, scan, details }, compass) {
  const text = S.result;
  const buttons = viewsOf(compass).map((name) =>
    action(nameOf(name, compass), async () => view.look(name), {}));
  const picture = action(text.screenshot, async () => {
    saveFrom(view.picture(), `plumb_${scan.id}_3d.png`);
  }, {});
  const cut = cutControls(view);
  if (!reference) return h('div', { class: 'row' }, buttons, picture, cut);
  const ghost = checkbox(text.ghost, false, {});
  const fraction = h('input', {
    type: 'range', min: 0, max: 1, step: 0.05, value: 0.5, 'aria-label': text.ghostFraction,
  });
  const blend = slider(text.ghostFraction, fraction);
  blend.hidden = true;
  const state = h('span', { class: 'hint', role: 'status' });
  ghost.box.addEventListener('change', async () => {
    blend.hidden = !ghost.box.checked;
    state.textContent = ghost.box.checked ? text.ghostLoading : '';
    try {
      await view.setGhost(ghost.box.checked ? () => surfaceOf(reference.scan_id) : null,
        Number(fraction.value));
    } catch (error) {
      ghost.box.checked = false;
      blend.hidden = true;
      warn(error.message);
    }
    state.textContent = '';
    canvas.dataset.ghost = ghost.box.checked ? 'yes' : '';
  });
  fraction.addEventListener('input', () => view.setFraction(Number(fraction.value)));
  const correction = motionOf(scan, details) && correctionControls(view, canvas, scan, () => {
    if (!ghost.box.checked) ghost.box.click();
  });
  return h('div', {}, h('div', { class: 'row' }, buttons, picture, cut),
    h('div', { class: 'row' }, ghost.element, state), blend, correction);
}

export function meshView({ scan, reference, details }, map, tolerance_mm) {
  const text = S.result;
  const place = h('div', { class: 'mesh-place' });
  let view = null;
  const open = action(text.meshOpen, async () => {
    const canvas = h('canvas', {
      class: 'mesh', tabindex: '0', role: 'application', 'aria-label': text.meshLabel,
    });
    try {
      if (!document.createElement('canvas').getContext('webgl2')) throw new Error(text.meshFailed);
      const T = details?.alignment?.T_reference_current;
      const part = progressIn(place, text.meshLoading);
      const [{ openMesh }, surface] = await Promise.all([import('../drawings/mesh.js'),
        surfaceOf(scan.id, part('surface'))]);
      if (!place.isConnected) return;  // the screen was left meanwhile
      const below = h('div', {});
      place.classList.remove('waiting');
      clear(place, canvas, map?.legend?.(), below);
      view = openMesh(canvas, {
        surface, grid: map?.grid, deviation: map?.deviation, region: map?.region,
        T, motion: motionOf(scan, details),
        // Against a planning CT the motion is stated in the frame of the scan.
        T_motion: details?.compared_with ? null : T,
        tolerance_m: tolerance_mm / 1000,
        compass: map?.compass, words: { ...text.marks, ...text.cube },
      });
      canvas.dataset.ready = 'yes';
      clear(below, marksNote(map?.compass),
        controls(view, canvas, { reference, scan, details }, map?.compass));
    } catch (error) {
      // A surface that did not arrive, or not whole, may arrive the next time; one that the browser
      // cannot show never will be.
      if (error instanceof ApiError || error instanceof DamagedSurface) offer(error.message);
      else clear(place, hint(text.meshFailed));
    }
  }, {});
  const offer = (words) => clear(place, open, hint(words));
  place.classList.add('waiting');
  offer(text.meshHint);
  return { element: place, stop: () => view?.stop() };
}
