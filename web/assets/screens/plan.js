import { get, getBytes, live, may, post, put } from '../api.js';
import { action, checkbox, clear, done, field, h, keepFocus, localTime, say, select, svg, warn } from '../dom.js';
import { cellAt, paintHeights, readTiff } from '../maps.js';
import { S } from '../strings.js';

const kStep_m = 0.005;

/// Height map with a polygon and a point that people draw, by pointer or keys. `model` is {region, isocentre}; `changed` is called after each change.
function editor(grid, map, model, editable, changed) {
  const text = S.plan;
  const canvas = h('canvas', { class: 'map', 'aria-hidden': 'true' });
  paintHeights(canvas, map, grid.step);
  const width = grid.width * grid.step;
  const height = grid.height * grid.step;
  const overlay = svg('svg', { viewBox: `0 0 ${width} ${height}`, class: 'draw', tabindex: '0', role: 'application', 'aria-label': text.mapLabel });
  const box = h('div', { class: 'map-box' }, canvas, overlay);
  box.style.setProperty('max-width', `${75 * width / height}vh`);
  const state = { chosen: -1, dragging: false, picking: false };
  const toMap = ([x, y]) => [x - grid.x_min, height - (y - grid.y_min)];
  const round = (value) => Math.round(value * 1000) / 1000;
  const fromEvent = (event) => {
    const area = overlay.getBoundingClientRect();
    return [round(grid.x_min + (event.clientX - area.left) / area.width * width), round(grid.y_min + (1 - (event.clientY - area.top) / area.height) * height)];
  };
  const draw = () => {
    const points = model.region.map(toMap);
    const size = width / 110;
    clear(overlay,
      points.length > 1 && svg(points.length > 2 ? 'polygon' : 'polyline', { points: points.map((point) => point.join(',')).join(' '), class: 'region' }),
      editable && points.map(([x, y], i) => svg('circle', { cx: x, cy: y, r: size, class: i === state.chosen ? 'corner chosen' : 'corner', 'data-corner': i })),
      model.isocentre && (() => {
        const [x, y] = toMap(model.isocentre);
        return svg('path', { d: `M${x - 2 * size} ${y}h${4 * size}M${x} ${y - 2 * size}v${4 * size}`, class: 'isocentre' });
      })());
  };
  const update = () => { draw(); changed(); };
  if (editable) {
    overlay.addEventListener('pointerdown', (event) => {
      overlay.focus();
      const point = fromEvent(event);
      if (state.picking) {
        const cell = cellAt(grid, ...point);
        const z = cell < 0 ? NaN : map.values[cell];
        model.isocentre = [...point, Number.isNaN(z) ? 0 : round(z)];
        state.picking = false;
        overlay.classList.remove('picking');
      } else if (event.target.dataset?.corner !== undefined) {
        state.chosen = Number(event.target.dataset.corner);
        state.dragging = true;
        overlay.setPointerCapture(event.pointerId);
      } else {
        // Into the edge that is nearest, so that clicks around the body make no crossing lines.
        model.region.splice(nearestEdge(model.region, point), 0, point);
        state.chosen = model.region.findIndex((other) => other === point);
      }
      update();
    });
    overlay.addEventListener('pointermove', (event) => {
      if (!state.dragging) return;
      model.region[state.chosen] = fromEvent(event);
      update();
    });
    overlay.addEventListener('pointerup', () => { state.dragging = false; });
    overlay.addEventListener('keydown', (event) => {
      const chosen = model.region[state.chosen];
      const direction = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (event.key === 'Enter') {
        model.region.push([round(grid.x_min + width / 2), round(grid.y_min + height / 2)]);
        state.chosen = model.region.length - 1;
      } else if (event.key.toLowerCase() === 'n' && model.region.length) {
        state.chosen = (state.chosen + 1) % model.region.length;
      } else if ((event.key === 'Delete' || event.key === 'Backspace') && chosen) {
        model.region.splice(state.chosen, 1);
        state.chosen = Math.min(state.chosen, model.region.length - 1);
      } else if (direction && chosen) {
        const by = kStep_m * (event.shiftKey ? 10 : 1);
        model.region[state.chosen] = [round(chosen[0] + by * direction[0]), round(chosen[1] + by * direction[1])];
      } else {
        return;
      }
      event.preventDefault();
      update();
      const now = model.region[state.chosen];
      if (now) say(text.corner(state.chosen + 1, ...now));
    });
  }
  draw();
  return { element: box, draw, clear: () => { model.region.length = 0; state.chosen = -1; update(); }, pick: () => { state.picking = true; overlay.classList.add('picking'); overlay.focus(); say(text.picking); } };
}

function nearestEdge(region, [x, y]) {
  if (region.length < 3) return region.length;
  let best = [Infinity, region.length];
  region.forEach(([ax, ay], i) => {
    const [bx, by] = region[(i + 1) % region.length];
    const length2 = (bx - ax) ** 2 + (by - ay) ** 2 || 1e-9;
    const share = Math.max(0, Math.min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2));
    const distance = Math.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay));
    if (distance < best[0]) best = [distance, i + 1];
  });
  return best[1];
}

async function loadMap(reference) {
  const scene = await get(`scans/${reference.scan_id}/files/scene.json`);
  const map = await readTiff(await getBytes(`scans/${reference.scan_id}/files/heightmap.tiff`));
  if (!scene.heightmap || scene.heightmap.width !== map.width) throw new Error(S.plan.noMap);
  return { grid: scene.heightmap, map };
}

function controls(reference, model, editable) {
  const text = S.plan;
  const number = (value, step, properties) => h('input', { type: 'number', step, value: value ?? '', disabled: !editable, inputmode: 'decimal', ...properties });
  const bad = h('p', { class: 'caution', id: 'isocentre-bad', role: 'alert' });
  const axes = ['x', 'y', 'z'].map((axis, i) => number(model.isocentre?.[i], '0.001', { 'aria-label': `${text.isocentre} ${axis}`, placeholder: axis, 'aria-describedby': bad.id }));
  const shift = number(reference.plan.tolerance.shift_mm, '0.1', { min: 0.1, max: 50 });
  const rotation = number(reference.plan.tolerance.rotation_deg, '0.1', { min: 0.1, max: 20 });
  const posture = select(text.postures, reference.plan.posture, { disabled: !editable });
  const couch = checkbox(text.couch, reference.plan.couch_markers, { disabled: !editable });
  /// The field that makes the isocentre neither three numbers nor none.
  const wrongAxis = () => axes.find((axis) => axis.validity.badInput) ?? (axes.some((axis) => axis.value !== '') ? axes.find((axis) => axis.value === '') : undefined);
  /// Says at the fields what is wrong; false then.
  const judge = () => {
    const wrong = wrongAxis();
    bad.textContent = wrong ? text.isocentreBad : '';
    for (const axis of axes) axis.setAttribute('aria-invalid', String(axis === wrong));
    wrong?.focus();
    return !wrong;
  };
  const isocentre = () => (wrongAxis() || axes[0].value === '' ? null : axes.map((axis) => Number(axis.value)));
  const body = () => ({
    region_m: model.region, isocentre_m: isocentre(), revision: reference.revision,
    shift_tolerance_mm: Number(shift.value), rotation_tolerance_deg: Number(rotation.value), posture: posture.value, couch_markers: couch.box.checked,
  });
  /// All that a person can change, to tell whether they did.
  const written = () => JSON.stringify([body(), axes.map((axis) => [axis.value, axis.validity.badInput])]);
  return { axes, bad, shift, rotation, posture, couch, judge, isocentre, body, written };
}

/// One stored plan and what is edited of it. `store(request)` sends a change.
async function draft(place, reference, store) {
  const text = S.plan;
  const patient = await get(`patients/${reference.patient_id}`);
  const editable = may('plan');
  const model = { region: reference.plan.region_m.map((point) => [...point]), isocentre: reference.plan.isocentre_m };
  const inputs = controls(reference, model, editable);
  const corners = h('p', { class: 'hint' });
  const mapPlace = h('div', {});
  const changed = () => {
    corners.textContent = text.corners(model.region.length);
    // Without a picked point the fields keep what was typed: it may be half of one.
    if (model.isocentre) inputs.axes.forEach((input, i) => { input.value = model.isocentre[i]; });
  };
  let drawing = null;
  try {
    const { grid, map } = await loadMap(reference);
    drawing = editor(grid, map, model, editable, changed);
    clear(mapPlace, drawing.element);
  } catch (error) {
    clear(mapPlace, h('p', { class: 'hint' }, error.message));
  }
  inputs.axes.forEach((input) => input.addEventListener('input', () => {
    model.isocentre = inputs.isocentre();
    inputs.bad.textContent = '';
    drawing?.draw();
  }));
  const save = action(text.save, async () => {
    if (inputs.judge()) await store(() => put(`references/${reference.id}/plan`, inputs.body()), text.saved);
  }, { class: 'primary' });
  const approve = action(text.approve, () => store(() => post(`references/${reference.id}/approve`, { revision: reference.revision }), text.approved), {});
  keepFocus(place, () => clear(place,
    h('h1', {}, `${text.reference} ${reference.version} · `, h('a', { href: `#/patient/${patient.id}` }, patient.code)),
    h('p', { class: 'lead' }, reference.approved_by ? S.patients.approvedBy(reference.approved_by, localTime(reference.approved_at)) : [h('span', { class: 'badge move' }, S.patients.draft), ` ${localTime(reference.created_at)}, ${reference.created_by}`]),
    h('div', { class: 'plan-grid' },
      h('section', { class: 'card' }, h('h2', {}, text.region), editable && h('p', { class: 'hint' }, text.regionHint), mapPlace, corners, editable && drawing && h('div', { class: 'row' }, action(text.clear, async () => drawing.clear(), {}), action(text.pick, async () => drawing.pick(), {}))),
      h('section', { class: 'card form' },
        h('fieldset', {}, h('legend', {}, text.isocentre), h('p', { class: 'hint' }, text.isocentreHint), h('div', { class: 'triple' }, inputs.axes), inputs.bad),
        h('fieldset', {}, h('legend', {}, text.tolerance), field(text.shift, inputs.shift), field(text.rotation, inputs.rotation)),
        field(text.posture, inputs.posture), inputs.couch.element,
        editable && h('p', { class: 'hint' }, reference.approved_by ? text.approvedHint : text.approveHint),
        h('div', { class: 'row' }, editable && save, may('approve') && !reference.approved_by && approve)))));
  changed();
  const begun = inputs.written();
  return { isEdited: () => inputs.written() !== begun };
}

export async function showPlan(place, id) {
  const text = S.plan;
  let reference;
  let shown;
  let busy = false;  // with a change of our own, which is told to us too
  const load = async () => {
    reference = await get(`references/${id}`);
    shown = await draft(place, reference, store);
  };
  const differs = async () => {
    const stored = await get(`references/${id}`, true);
    return stored.revision !== reference.revision || stored.approved_by !== reference.approved_by;
  };
  const store = async (request, words) => {
    busy = true;
    try {
      const answer = await request();
      done(words);
      if (answer.id && answer.id !== id) location.hash = `#/plan/${answer.id}`;
      else await load();
    } catch (error) {
      if (error.status !== 409 || !await differs()) throw error;
      await load();
      throw new Error(text.changedMeanwhile);
    } finally {
      busy = false;
    }
  };
  const follow = async () => {
    if (busy || !await differs() || busy) return;
    if (shown.isEdited()) {
      warn(text.changedWhileEditing);
      return;
    }
    await load();
    say(text.reloaded, true);
  };
  await load();
  return live.listen((kind) => { if (kind === 'data') follow().catch(() => {}); });
}
