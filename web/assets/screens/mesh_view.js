// The card of the 3-D view, which is loaded only when it is opened.
import { fileUrl } from '../api.js';
import { action, checkbox, clear, h, select, warn } from '../dom.js';
import { marksNote } from '../map_frame.js';
import { S } from '../strings.js';

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
  const way = select(text.cutWays, '', { id: 'mesh-cut' });
  const where = h('input', {
    type: 'range', min: 0, max: 1, step: 0.02, value: 0.5, 'aria-label': text.cutWhere,
    hidden: true,
  });
  const apply = () => {
    where.hidden = !way.value;
    view.cut(way.value, Number(where.value));
  };
  way.addEventListener('change', apply);
  where.addEventListener('input', apply);
  return [h('label', { for: 'mesh-cut' }, text.cut), way, where];
}

function controls(view, canvas, ghostUrl, scan, compass) {
  const text = S.result;
  const buttons = viewsOf(compass).map((name) =>
    action(nameOf(name, compass), async () => view.look(name), {}));
  const picture = action(text.screenshot, async () => {
    h('a', { href: view.picture(), download: `plumb_${scan.id}_3d.png` }).click();
  }, {});
  const cut = cutControls(view);
  if (!ghostUrl) return h('div', { class: 'row' }, buttons, picture, cut);
  const ghost = checkbox(text.ghost, false, {});
  const share = h('input', {
    type: 'range', min: 0, max: 1, step: 0.05, value: 0.5, 'aria-label': text.ghostShare,
    hidden: true,
  });
  const state = h('span', { class: 'hint', role: 'status' });
  ghost.box.addEventListener('change', async () => {
    share.hidden = !ghost.box.checked;
    state.textContent = ghost.box.checked ? text.ghostLoading : '';
    try {
      await view.setGhost(ghost.box.checked ? ghostUrl : null, Number(share.value));
    } catch (error) {
      warn(error.message);
    }
    state.textContent = '';
    canvas.dataset.ghost = ghost.box.checked ? 'yes' : '';
  });
  share.addEventListener('input', () => view.setShare(Number(share.value)));
  return h('div', { class: 'row' }, buttons, picture, cut, ghost.element, share, state);
}

export function meshView({ scan, reference, details }, map, tolerance_mm) {
  const text = S.result;
  const place = h('div', { class: 'mesh-place' });
  let view = null;
  const open = action(text.meshOpen, async () => {
    place.classList.remove('waiting');
    clear(place, h('p', { class: 'hint' }, text.meshLoading));
    const canvas = h('canvas', {
      class: 'mesh', tabindex: '0', role: 'application', 'aria-label': text.meshLabel,
    });
    try {
      if (!document.createElement('canvas').getContext('webgl2')) throw new Error(text.meshFailed);
      const { openMesh } = await import('../mesh.js');
      const below = h('div', {});
      clear(place, canvas, map?.legend?.(), below);
      view = await openMesh(canvas, {
        url: fileUrl(scan.id, 'mesh.ply'), grid: map?.grid, deviation: map?.deviation,
        region: map?.region, T: details?.alignment?.T_reference_current,
        tolerance_m: tolerance_mm / 1000, compass: map?.compass,
        words: { ...text.marks, ...text.cube },
      });
      canvas.dataset.ready = 'yes';
      const ghostUrl = reference && fileUrl(reference.scan_id, 'mesh.ply');
      clear(below, marksNote(map?.compass), controls(view, canvas, ghostUrl, scan, map?.compass));
    } catch {
      clear(place, h('p', { class: 'hint' }, text.meshFailed));
    }
  }, {});
  place.classList.add('waiting');
  clear(place, open, h('p', { class: 'hint' }, text.meshHint));
  return { element: place, stop: () => view?.stop() };
}
