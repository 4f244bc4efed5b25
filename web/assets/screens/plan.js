// The plan of a reference: region, isocentre, tolerances; and its approval, which signs exactly
// what is stored.
import { get, live, may, post, put } from '../api.js';
import {
  action, checkbox, clear, done, enable, field, h, keepFocus, localTime, say, select, svg, warn,
} from '../dom.js';
import { guardLeaving } from '../leave.js';
import { compassOf, mapFrame, marksNote, viewOf } from '../map_frame.js';
import { cellAt, loadMap, paintHeights } from '../maps.js';
import { S } from '../strings.js';
import { blockNote } from './common.js';
import { templateOf } from './plan_template.js';

const kStep_m = 0.005;

const kSnap_m = 0.012;
const kUndoSteps = 200;
const distance = ([ax, ay], [bx, by]) => Math.hypot(ax - bx, ay - by);

/// Area in square centimetres and length of the outline in centimetres.
function measure(region) {
  let area = 0;
  let round = 0;
  region.forEach(([ax, ay], i) => {
    const [bx, by] = region[(i + 1) % region.length];
    area += (ax * by - bx * ay) / 2;
    round += Math.hypot(bx - ax, by - ay);
  });
  return { cm2: Math.round(1e4 * Math.abs(area)), cm: Math.round(100 * round) };
}

/// Height map with a polygon and a point that people draw, by pointer or keys. `model` is {region,
/// isocentre}; `changed` is called after each change.
function editor(grid, map, model, editable, changed, compass) {
  const text = S.plan;
  const canvas = h('canvas', { class: 'map', 'aria-hidden': 'true' });
  paintHeights(canvas, map, grid.step);
  const width = grid.width * grid.step;
  const height = grid.height * grid.step;
  const overlay = svg('svg', {
    viewBox: `0 0 ${width} ${height}`, class: 'draw', tabindex: '0', role: 'application',
    'aria-label': text.mapLabel,
  });
  const box = mapFrame({ grid, view: viewOf(grid, null), canvas, compass, cross: overlay });
  box.style.setProperty('max-width', `${75 * width / height}vh`);
  const state = { chosen: -1, dragging: false, picking: false };
  const before = [];  // for undo
  const remember = () => {
    before.push(JSON.stringify([model.region, model.isocentre]));
    if (before.length > kUndoSteps) before.shift();
  };
  const toMap = ([x, y]) => [x - grid.x_min, height - (y - grid.y_min)];
  const round = (value) => Math.round(value * 1000) / 1000;
  const fromEvent = (event) => {
    const area = overlay.getBoundingClientRect();
    return [round(grid.x_min + (event.clientX - area.left) / area.width * width),
      round(grid.y_min + (1 - (event.clientY - area.top) / area.height) * height)];
  };
  /// A corner that is dragged lies straight beside its neighbours where it nearly does.
  const snapped = (point, i) => {
    const n = model.region.length;
    for (const other of [model.region[(i + n - 1) % n], model.region[(i + 1) % n]]) {
      for (const k of [0, 1]) if (Math.abs(point[k] - other[k]) < kSnap_m) point[k] = other[k];
    }
    return point;
  };
  const lengths = (points, size) => points.length > 1 && points.map(([ax, ay], i) => {
    if (i + 1 === points.length && points.length < 3) return null;
    const [bx, by] = points[(i + 1) % points.length];
    const cm = 100 * Math.hypot(bx - ax, by - ay);
    return cm > 4 && svg('text', {
      x: (ax + bx) / 2, y: (ay + by) / 2, class: 'length', 'font-size': 1.6 * size,
    }, `${cm.toFixed(0)} cm`);
  });
  const draw = () => {
    const points = model.region.map(toMap);
    const size = width / 110;
    clear(overlay,
      points.length > 1 && svg(points.length > 2 ? 'polygon' : 'polyline', {
        points: points.map((point) => point.join(',')).join(' '), class: 'region',
      }),
      lengths(points, size),
      editable && points.map(([x, y], i) => svg('circle', {
        cx: x, cy: y, r: size, class: i === state.chosen ? 'corner chosen' : 'corner',
        'data-corner': i,
      })),
      model.isocentre && (() => {
        const [x, y] = toMap(model.isocentre);
        return svg('path', {
          d: `M${x - 2 * size} ${y}h${4 * size}M${x} ${y - 2 * size}v${4 * size}`,
          class: 'isocentre',
        });
      })());
  };
  const update = () => { draw(); changed(); };
  const undo = () => {
    const last = before.pop();
    if (!last) return;
    const [region, isocentre] = JSON.parse(last);
    model.region.splice(0, model.region.length, ...region);
    model.isocentre = isocentre;
    state.chosen = Math.min(state.chosen, region.length - 1);
    update();
  };
  if (editable) {
    overlay.addEventListener('pointerdown', (event) => {
      overlay.focus();
      const point = fromEvent(event);
      remember();
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
      model.region[state.chosen] = snapped(fromEvent(event), state.chosen);
      update();
    });
    overlay.addEventListener('pointerup', () => { state.dragging = false; });
    overlay.addEventListener('keydown', (event) => {
      const chosen = model.region[state.chosen];
      const direction = {
        ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
      }[event.key];
      const changes = event.key === 'Enter' || (chosen && (direction
        || event.key === 'Delete' || event.key === 'Backspace'));
      if (changes) remember();
      if (event.key.toLowerCase() === 'u' || (event.key === 'z' && event.ctrlKey)) {
        undo();
      } else if (event.key === 'Enter') {
        model.region.push([round(grid.x_min + width / 2), round(grid.y_min + height / 2)]);
        state.chosen = model.region.length - 1;
      } else if (event.key.toLowerCase() === 'n' && model.region.length) {
        state.chosen = (state.chosen + 1) % model.region.length;
      } else if ((event.key === 'Delete' || event.key === 'Backspace') && chosen) {
        model.region.splice(state.chosen, 1);
        state.chosen = Math.min(state.chosen, model.region.length - 1);
      } else if (direction && chosen) {
        const by = kStep_m * (event.shiftKey ? 10 : 1);
        model.region[state.chosen] = [round(chosen[0] + by * direction[0]),
          round(chosen[1] + by * direction[1])];
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
  return {
    element: box, draw, undo,
    /// In place of all corners; can be undone.
    set: (region) => {
      remember();
      model.region.splice(0, model.region.length, ...region);
      state.chosen = -1;
      update();
    },
    clear: () => {
      remember();
      model.region.length = 0;
      state.chosen = -1;
      update();
    },
    pick: () => {
      state.picking = true;
      overlay.classList.add('picking');
      overlay.focus();
      say(text.picking);
    },
  };
}

function nearestEdge(region, [x, y]) {
  if (region.length < 3) return region.length;
  let best = [Infinity, region.length];
  region.forEach(([ax, ay], i) => {
    const [bx, by] = region[(i + 1) % region.length];
    const length2 = (bx - ax) ** 2 + (by - ay) ** 2 || 1e-9;
    const along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2;
    const share = Math.max(0, Math.min(1, along));
    const away = distance([x, y], [ax + share * (bx - ax), ay + share * (by - ay)]);
    if (away < best[0]) best = [away, i + 1];
  });
  return best[1];
}

async function loadHeights(reference) {
  const scene = await get(`scans/${reference.scan_id}/files/scene.json`);
  const map = await loadMap(reference.scan_id, 'heightmap');
  if (!scene.heightmap || scene.heightmap.width !== map.width) throw new Error(S.plan.noMap);
  return { grid: scene.heightmap, map, scene };
}

function isInside(region, [x, y]) {
  let inside = false;
  region.forEach(([ax, ay], i) => {
    const [bx, by] = region[(i + 1) % region.length];
    if ((ay > y) !== (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax) inside = !inside;
  });
  return inside;
}

/// @param plan  What the fields begin with: what is stored, or what was typed before.
function controls(reference, model, plan, editable) {
  const text = S.plan;
  const number = (value, step, properties) => h('input', {
    type: 'number', step, value: value ?? '', disabled: !editable, inputmode: 'decimal',
    ...properties,
  });
  const bad = h('p', { class: 'caution', id: 'isocentre-bad', role: 'alert' });
  const axes = ['x', 'y', 'z'].map((axis, i) => number(model.isocentre?.[i], '0.001', {
    'aria-label': `${text.isocentre} ${axis}`, placeholder: axis, 'aria-describedby': bad.id,
  }));
  const shift = number(plan.shift_tolerance_mm, '0.1', { min: 0.1, max: 50 });
  const rotation = number(plan.rotation_tolerance_deg, '0.1', { min: 0.1, max: 20 });
  const posture = select(text.postures, plan.posture, { disabled: !editable });
  const couch = checkbox(text.couch, plan.couch_markers, { disabled: !editable });
  /// The field that makes the isocentre neither three numbers nor none.
  const wrongAxis = () => axes.find((axis) => axis.validity.badInput)
    ?? (axes.some((axis) => axis.value !== '') ? axes.find((axis) => axis.value === '')
      : undefined);
  /// Says at the fields what is wrong; false then.
  const judge = () => {
    const wrong = wrongAxis();
    bad.textContent = wrong ? text.isocentreBad : '';
    for (const axis of axes) axis.setAttribute('aria-invalid', String(axis === wrong));
    wrong?.focus();
    return !wrong;
  };
  const isocentre = () => (wrongAxis() || axes[0].value === '' ? null
    : axes.map((axis) => Number(axis.value)));
  const body = () => ({
    region_m: model.region, isocentre_m: isocentre(), revision: reference.revision,
    shift_tolerance_mm: Number(shift.value), rotation_tolerance_deg: Number(rotation.value),
    posture: posture.value, couch_markers: couch.box.checked,
  });
  /// All that a person can change, to tell whether they did.
  const typed = (axis) => [axis.value, axis.validity.badInput];
  const written = () => JSON.stringify([body(), axes.map(typed)]);
  const all = [...axes, shift, rotation, posture, couch.box];
  return { axes, bad, shift, rotation, posture, couch, judge, isocentre, body, written, all };
}

const storedPlan = (reference) => ({
  region_m: reference.plan.region_m, isocentre_m: reference.plan.isocentre_m,
  shift_tolerance_mm: reference.plan.tolerance.shift_mm,
  rotation_tolerance_deg: reference.plan.tolerance.rotation_deg,
  posture: reference.plan.posture, couch_markers: reference.plan.couch_markers,
});

/// Unsaved work of this revision, kept over a lost session or a reload.
const draftKey = (reference) => `plumb-plan-${reference.id}-${reference.revision}`;
const drafts = {
  read: (reference) => {
    try { return JSON.parse(sessionStorage.getItem(draftKey(reference))); } catch { return null; }
  },
  write: (reference, plan) => {
    try { sessionStorage.setItem(draftKey(reference), JSON.stringify(plan)); } catch { /* full */ }
  },
  remove: (reference) => {
    try { sessionStorage.removeItem(draftKey(reference)); } catch { /* there is none */ }
  },
};

/// What an approval signs, read-only and complete, with the checksum that goes into the log.
function summary(reference, patient, scene, picture, approve) {
  const text = S.plan;
  const { plan } = reference;
  const row = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
  const metres = (point) => point.map((v) => v.toFixed(3)).join(', ');
  const size = measure(plan.region_m);
  const frames = scene?.frames;
  const button = action(text.summarySubmit, approve, { class: 'primary' });
  const element = h('section', { class: 'card summary', 'aria-label': text.summary },
    h('h2', {}, text.summary), picture,
    h('dl', { class: 'facts' },
      row(S.patients.code, patient.code), row(S.patients.version, `${reference.version}`),
      row(S.patients.made, `${localTime(reference.created_at)}, ${reference.created_by}`),
      row(text.planned, reference.planned_by ?? reference.created_by),
      row(S.patients.reasonShort, reference.reason || S.none),
      row(text.region, plan.region_m.length
        ? `${text.corners(plan.region_m.length)}, ${text.area(size.cm2, size.cm)}`
        : text.wholeBody),
      row(text.isocentre, plan.isocentre_m ? `${metres(plan.isocentre_m)} m` : text.middle),
      row(text.shift, `±${plan.tolerance.shift_mm}`),
      row(text.rotation, `±${plan.tolerance.rotation_deg}`),
      row(text.posture, text.postures[plan.posture]),
      row(text.markerKind, plan.couch_markers ? text.couchMarkers : text.roomMarkers),
      frames && row(text.scanQuality,
        `${S.result.frames} ${frames.tracked} / ${frames.total}, `
          + `${S.result.views} ${scene.keyframes}`),
      row(text.signature, h('code', {}, reference.digest))),
    h('p', { class: 'hint' }, text.approveHint), button);
  return { element, button };
}

/// One stored plan and what is edited of it. `store(request)` sends a change.
async function draft(place, reference, store) {
  const text = S.plan;
  const patient = await get(`patients/${reference.patient_id}`);
  const editable = may('plan');
  const kept = editable ? drafts.read(reference) : null;
  const plan = kept ?? storedPlan(reference);
  const model = { region: plan.region_m.map((point) => [...point]), isocentre: plan.isocentre_m };
  const inputs = controls(reference, model, plan, editable);
  const corners = h('p', { class: 'hint' });
  const outside = h('p', { class: 'caution' });
  const mapPlace = h('div', {});
  const signPlace = h('div', {});
  const templatePlace = h('div', {});
  let stored;  // as written when nothing is edited
  let drawing = null;
  let loaded = null;
  // Nothing has been compared: whether the body lies as the plan says, nobody has looked at yet.
  const compass = compassOf(live.status?.room, null);
  const isEdited = () => stored !== undefined && inputs.written() !== stored;
  const sign = may('approve') && !reference.approved_by
    && action(text.summaryReview, async () => showSummary(), {});
  let blocked = null;
  const block = sign && blockNote((why) => {
    blocked = why;
    if (stored !== undefined) note();
  });
  const note = () => {
    const point = model.isocentre;
    outside.textContent = point && model.region.length > 2 && !isInside(model.region, point)
      ? text.isocentreOutside : '';
    const size = measure(model.region);
    corners.textContent = model.region.length > 2
      ? `${text.corners(model.region.length)}, ${text.area(size.cm2, size.cm)}`
      : text.corners(model.region.length);
    if (stored === undefined) return;
    const edited = isEdited();
    if (edited) drafts.write(reference, inputs.body());
    else drafts.remove(reference);
    if (sign) enable(sign, !edited && !blocked);
    unsaved.textContent = edited && sign ? text.unsaved : '';
    if (edited) clear(signPlace);
  };
  const changed = () => {
    // Without a picked point the fields keep what was typed: it may be half of one.
    if (model.isocentre) inputs.axes.forEach((input, i) => { input.value = model.isocentre[i]; });
    note();
  };
  const unsaved = h('p', { class: 'caution', role: 'status' });
  try {
    loaded = await loadHeights(reference);
    drawing = editor(loaded.grid, loaded.map, model, editable, changed, compass);
    clear(mapPlace, drawing.element, marksNote(compass));
  } catch (error) {
    clear(mapPlace, h('p', { class: 'hint' }, error.message));
  }
  const picture = () => {
    if (!loaded) return null;
    const shown = { region: reference.plan.region_m, isocentre: reference.plan.isocentre_m };
    return editor(loaded.grid, loaded.map, shown, false, () => {}, compass).element;
  };
  const showSummary = () => {
    const { element, button } = summary(reference, patient, loaded?.scene, picture(), () => store(
      () => post(`references/${reference.id}/approve`, {
        revision: reference.revision, digest: reference.digest,
      }), text.approved));
    clear(signPlace, element);
    element.scrollIntoView({ block: 'nearest' });
    button.focus();
  };
  inputs.axes.forEach((input) => input.addEventListener('input', () => {
    model.isocentre = inputs.isocentre();
    inputs.bad.textContent = '';
    drawing?.draw();
  }));
  for (const input of inputs.all) {
    input.addEventListener('input', note);
    input.addEventListener('change', note);
  }
  const save = action(text.save, async () => {
    if (!inputs.judge()) return;
    const body = inputs.body();
    await store(() => put(`references/${reference.id}/plan`, body), text.saved,
      () => drafts.remove(reference));
  }, { class: 'primary' });
  const approval = reference.approved_by
    ? S.patients.approvedBy(reference.approved_by, localTime(reference.approved_at))
    : [h('span', { class: 'badge move' }, S.patients.draft),
      ` ${localTime(reference.created_at)}, ${reference.created_by}`];
  const tools = editable && drawing && h('div', { class: 'row' },
    action(text.undo, async () => drawing.undo(), {}),
    action(text.clear, async () => drawing.clear(), {}),
    action(text.pick, async () => drawing.pick(), {}));
  keepFocus(place, () => clear(place,
    h('h1', {}, `${text.reference} ${reference.version} · `,
      h('a', { href: `#/patient/${patient.id}` }, patient.code)),
    h('p', { class: 'lead' }, approval),
    kept && h('p', { class: 'old-note' }, text.draftKept),
    h('div', { class: 'plan-grid' },
      h('section', { class: 'card' }, h('h2', {}, text.region),
        editable && h('p', { class: 'hint' }, text.regionHint), mapPlace, corners, tools),
      h('section', { class: 'card form' },
        h('fieldset', {}, h('legend', {}, text.isocentre),
          h('p', { class: 'hint' }, text.isocentreHint),
          editable && h('p', { class: 'hint' }, text.pickHint),
          h('div', { class: 'triple' }, inputs.axes), inputs.bad, outside),
        h('fieldset', {}, h('legend', {}, text.tolerance), field(text.shift, inputs.shift),
          field(text.rotation, inputs.rotation)),
        templatePlace, field(text.posture, inputs.posture), inputs.couch.element,
        editable && h('p', { class: 'hint' },
          reference.approved_by ? text.approvedHint : text.approveHint),
        unsaved, block, h('div', { class: 'row' }, editable && save, sign))),
    signPlace));
  if (editable && drawing) {
    templateOf(patient, loaded.grid, model, inputs, drawing, changed)
      .then((element) => clear(templatePlace, element), (error) => warn(error.message));
  }
  if (kept) {
    // What was stored is what an edit is compared with, not what was kept.
    const blank = controls(reference,
      { region: reference.plan.region_m, isocentre: reference.plan.isocentre_m },
      storedPlan(reference), editable);
    stored = blank.written();
  }
  changed();
  stored ??= inputs.written();
  note();
  return { isEdited };
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
  const store = async (request, words, succeeded = () => {}) => {
    busy = true;
    try {
      const answer = await request();
      succeeded();
      done(words);
      if (answer.id && answer.id !== id) {
        guardLeaving(null);
        location.hash = `#/plan/${answer.id}`;
      } else await load();
    } catch (error) {
      if (error.status !== 409 || !await differs()) throw error;
      drafts.remove(reference);
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
  guardLeaving(() => shown.isEdited());
  const stop = live.listen((kind) => { if (kind === 'data') follow().catch(() => {}); });
  return () => {
    guardLeaving(null);
    stop();
  };
}
