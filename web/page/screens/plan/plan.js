// SPDX-License-Identifier: Apache-2.0
// The plan of a reference: region, isocentre, tolerances, posture.
import { get, live, may, put } from '../../api.js';
import {
  action, card, checkbox, clear, done, enable, field, fixed, h, hint, keepFocus, localTime, say,
  select, signedTime, warn,
} from '../../dom.js';
import { guardLeaving } from '../../leave.js';
import { kBounds, kStated } from '../../limits.js';
import { compassOfPlan, marksNote } from '../../drawings/map_frame.js';
import { loadMap } from '../../drawings/maps.js';
import { doubtsOf } from '../../drawings/side_view.js';
import { drafts } from '../../plan_drafts.js';
import { S } from '../../words.js';
import { capturedAgainst, capturedCard } from '../captured.js';
import { blockNote, qualityOf } from '../common.js';
import { meshView } from '../mesh_view.js';
import { planningFacts } from '../planning.js';
import { showSummary, sidesOf, whyNotApprove } from './plan_approval.js';
import { editor, inMillimetres, measure } from './plan_editor.js';
import { templateOf } from './plan_template.js';

async function loadHeights(reference) {
  const scene = await get(`scans/${reference.scan_id}/files/scene.json`);
  const [map, body] = await Promise.all([loadMap(reference.scan_id, 'heightmap'),
    loadMap(reference.scan_id, 'body').catch(() => null)]);
  if (!scene.heightmap || scene.heightmap.width !== map.width) throw new Error(S.plan.noMap);
  return { grid: scene.heightmap, map, body, scene };
}

/// Where a marker of the scan was laid at the lasers, its middle is the isocentre.
function markerChoice(scene, take) {
  const text = S.plan;
  const found = Object.entries(scene?.markers ?? {});
  if (!found.length) return null;
  const middleOf = (corners) => [0, 1, 2].map((axis) =>
    Number((corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length).toFixed(4)));
  // With where it lies on the map: markers are rarely known by their numbers.
  const names = Object.fromEntries(found.map(([id, corners]) => {
    const [x, y] = middleOf(corners).map((value) => fixed(1000 * value, 0));
    return [id, `${text.marker(id)}: x ${x}, y ${y} mm`];
  }));
  const marker = select(names, found[0][0]);
  return h('div', { class: 'row' }, field(text.markerAtLasers, marker),
    action(text.takeMarker, async () => take(middleOf(scene.markers[marker.value])), {}));
}

/// What is stated of a planning CT's surface; nothing for other references.
function statedFields({ stated }) {
  const text = S.plan;
  return stated.clothing_mm && h('fieldset', {}, h('legend', {}, text.surface),
    hint(text.surfaceHint),
    field(text.clothing, stated.clothing_mm, text.clothingHint),
    field(text.ctBreathing, stated.ct_breathing_mm, text.ctBreathingHint));
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
  const number = (value, properties) => h('input', {
    type: 'number', value: value ?? '', disabled: !editable, inputmode: 'decimal',
    ...properties,
  });
  const bad = h('p', { class: 'caution', id: 'isocentre-bad', role: 'alert' });
  const axes = ['x', 'y', 'z'].map((axis, i) => number(inMillimetres(model.isocentre)?.[i], {
    step: '0.1', 'aria-label': `${text.isocentre} ${axis} (mm)`, 'aria-describedby': bad.id,
  }));
  const shift = number(plan.shift_tolerance_mm, kBounds.shift_tolerance_mm);
  const rotation = number(plan.rotation_tolerance_deg, kBounds.rotation_tolerance_deg);
  const posture = select(text.postures, plan.posture, { disabled: !editable });
  const couch = checkbox(text.couch, plan.couch_markers, { disabled: !editable });
  // What is stated of the surface of a planning CT; otherwise they are not shown, and not sent.
  const stated = reference.source !== 'planning_ct' ? {}
    : Object.fromEntries(Object.entries(kStated).map(([name, limits]) =>
      [name, number(plan[name] ?? 0, { required: true, ...limits })]));
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
    return !wrong && Object.values(stated).every((input) => input.reportValidity());
  };
  const isocentre = () => (wrongAxis() || axes[0].value === '' ? null
    : axes.map((axis) => Number(axis.value) / 1000));
  const body = () => ({
    region_m: model.region, isocentre_m: isocentre(), revision: reference.revision,
    shift_tolerance_mm: Number(shift.value), rotation_tolerance_deg: Number(rotation.value),
    posture: posture.value, couch_markers: couch.box.checked,
    ...Object.fromEntries(Object.entries(stated).map(([name, input]) =>
      [name, Number(input.value)])),
  });
  /// Everything that a person can change, to find out whether they did.
  const typed = (axis) => [axis.value, axis.validity.badInput];
  const written = () =>
    JSON.stringify([body(), [...axes, ...Object.values(stated)].map(typed)]);
  const all = [...axes, shift, rotation, posture, couch.box, ...Object.values(stated)];
  return { axes, bad, shift, rotation, posture, couch, stated, judge, isocentre, body, written,
    all };
}

const storedPlan = (reference) => ({
  region_m: reference.plan.region_m, isocentre_m: reference.plan.isocentre_m,
  shift_tolerance_mm: reference.plan.tolerance.shift_mm,
  rotation_tolerance_deg: reference.plan.tolerance.rotation_deg,
  posture: reference.plan.posture, couch_markers: reference.plan.couch_markers,
  clothing_mm: reference.plan.clothing_mm, ct_breathing_mm: reference.plan.ct_breathing_mm,
});

/// All that the screen shows of a reference; without `heights` where its map cannot be read, and
/// then `noMap` says why.
async function readAll(reference) {
  const patient = await get(`patients/${reference.patient_id}`);
  const scan = await get(`scans/${reference.scan_id}`).catch(() => null);
  const quality = scan && await qualityOf(scan);
  const captured = await capturedAgainst(reference);
  const known = { reference, patient, scan, quality, captured, heights: null };
  try {
    known.heights = await loadHeights(reference);
  } catch (error) {
    known.noMap = error.message;
  }
  return known;
}

/// What the fields begin with: what was typed before, or what is stored. Nobody has planned it yet:
/// what the calibration has measured of the lasers, unless somebody says otherwise.
function beginning(reference, editable) {
  const kept = editable ? drafts.read(reference) : null;
  const plan = kept ?? storedPlan(reference);
  const lasers = reference.room?.lasers_m?.map((value) => Number(value.toFixed(4))) ?? null;
  const byLasers = Boolean(lasers && editable && !kept && !reference.planned_by
    && !plan.isocentre_m);
  const model = { region: plan.region_m.map((point) => [...point]),
    isocentre: byLasers ? lasers : plan.isocentre_m };
  return { kept, plan, lasers, byLasers, model };
}

/// The isocentre from the side, and what is implausible about it.
function isocentreSide(heights, planning, editable) {
  const place = h('div', {});
  const meant = checkbox(S.plan.isocentreMeant, false, { disabled: !editable });
  let doubts = { refused: false, words: [] };
  let drawn = '';
  const draw = (point) => {
    const shown = JSON.stringify(point);
    if (shown === drawn) return;
    drawn = shown;
    meant.box.checked = false;
    doubts = point && heights && !planning ? doubtsOf(heights, point)
      : { refused: false, words: [] };
    clear(place, sidesOf(heights, point),
      doubts.words.map((words) => h('p', { class: 'caution isocentre-doubt' }, words)),
      doubts.words.length > 0 && !doubts.refused && editable && meant.element);
  };
  /// Throws what keeps the drawn point from being stored.
  const check = (isStored) => {
    if (doubts.refused) throw new Error(doubts.words[0]);
    if (!doubts.words.length || isStored || meant.box.checked) return;
    meant.box.focus();
    throw new Error(S.plan.isocentreConfirm);
  };
  return { place, draw, check };
}

/// The map on which the region is drawn. Nothing has been compared: whoever plans and approves sees
/// by its marks whether the posture is right.
function regionMap({ reference, heights, noMap }, planning, model, posture, editable, changed) {
  if (!heights) return { element: hint(noMap), drawing: null };
  const compassFor = (wanted) => compassOfPlan(reference.room, wanted);
  const compass = compassFor(posture.value);
  const marks = h('div', {}, marksNote(compass));
  const drawing = editor({ ...heights, compass }, model, editable, changed, Boolean(planning));
  posture.addEventListener('change', () => {
    const wanted = compassFor(posture.value);
    drawing.mark(wanted);
    clear(marks, marksNote(wanted));
  });
  return { element: [drawing.element, marks], drawing, compass };
}

/// The fields of the isocentre with what sets them.
function isocentreFields({ heights }, { lasers, byLasers }, planning, inputs, drawing, editable,
  notes) {
  const text = S.plan;
  const movable = editable && !planning;
  const set = (point) => {
    inputs.bad.textContent = '';
    drawing.setIsocentre(point);
  };
  return h('fieldset', {}, h('legend', {}, text.isocentre),
    !planning && hint(text.isocentreHint),
    movable && hint(text.pickHint),
    h('div', { class: 'triple' }, inputs.axes.map((input, i) =>
      field(`${'xyz'[i]} (mm)`, input))), inputs.bad, notes,
    byLasers && hint(text.lasersTaken),
    movable && drawing && [lasers && action(text.lasers, async () => set([...lasers]), {}),
      action(text.pick, async () => drawing.pick(), {}),
      markerChoice(heights.scene, set)]);
}

/// What was stored, as controls() would write it.
const writtenOf = (reference, editable) => controls(reference,
  { region: reference.plan.region_m, isocentre: reference.plan.isocentre_m },
  storedPlan(reference), editable).written();

/// One stored plan and what is edited of it. `store(request)` sends a change, `reload` shows what
/// is stored.
async function draft(place, reference, store, reload) {
  const text = S.plan;
  const known = await readAll(reference);
  const { patient, scan, heights } = known;
  const editable = may('plan');
  const planning = planningFacts(heights?.scene);
  const begun = beginning(reference, editable);
  const { kept, plan, model } = begun;
  const inputs = controls(reference, model, plan, editable);
  if (planning) {  // The file states them.
    for (const input of [...inputs.axes, inputs.posture, inputs.couch.box]) input.disabled = true;
  }
  const side = isocentreSide(heights, planning, editable);
  const corners = hint();
  const outside = h('p', { class: 'caution' });
  const unsaved = h('p', { class: 'caution', role: 'status' });
  const signPlace = h('div', {});
  const templatePlace = h('div', {});
  let stored;  // as written when nothing is edited
  let hadIsocentre = Boolean(model.isocentre);
  const isEdited = () => stored !== undefined && inputs.written() !== stored;
  const refusal = whyNotApprove(reference);
  const sign = may('approve') && !reference.approved_by && !refusal
    && action(text.summaryReview, async () => showSummary(signPlace, known, store), {});
  let blocked = null;
  const block = sign && blockNote((why) => {
    blocked = why;
    if (stored !== undefined) note();
  });
  const note = () => {
    const point = model.isocentre;
    outside.textContent = point && model.region.length > 2 && !isInside(model.region, point)
      ? text.isocentreOutside : '';
    side.draw(point);
    const size = measure(model.region);
    corners.textContent = model.region.length > 2
      ? `${text.corners(model.region.length)}, ${text.area(size.cm2, size.mm)}`
      : text.corners(model.region.length);
    if (stored === undefined) return;
    const edited = isEdited();
    if (edited) drafts.write(reference, inputs.body());
    else drafts.remove(reference);
    if (sign) enable(sign, !edited && (planning || !blocked));
    if (deleteCorner) enable(deleteCorner, drawing.hasCorner());
    unsaved.textContent = edited && sign ? text.unsaved : '';
    if (edited) clear(signPlace);
  };
  const changed = () => {
    // Without a picked point the fields keep what was typed: it may be half of one.
    const shown = inMillimetres(model.isocentre);
    if (shown) inputs.axes.forEach((input, i) => { input.value = shown[i]; });
    else if (hadIsocentre) inputs.axes.forEach((input) => { input.value = ''; });
    hadIsocentre = Boolean(model.isocentre);
    note();
  };
  const { element: map, drawing, compass } = regionMap(known, planning, model, inputs.posture,
    editable, changed);
  // No other screen shows this surface before it is signed.
  const mesh = planning && scan ? meshView({ scan }, { compass }, 0) : null;
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
    side.check(JSON.stringify(reference.plan.isocentre_m) === JSON.stringify(model.isocentre));
    const body = inputs.body();
    await store(() => put(`references/${reference.id}/plan`, body), text.saved,
      () => drafts.remove(reference));
  }, { class: 'primary' });
  const approval = reference.approved_by
    ? S.patients.approvedBy(reference.approved_by, signedTime(reference.approved_at))
    : [h('span', { class: 'badge move' }, S.patients.draft),
      ` ${localTime(reference.created_at)}, ${reference.created_by}`];
  const deleteCorner = editable && drawing
    && action(text.deleteCorner, async () => drawing.deleteCorner(), {});
  const tools = deleteCorner && h('div', { class: 'row' },
    action(text.undo, async () => drawing.undo(), {}), deleteCorner,
    action(text.clear, async () => drawing.clear(), {}));
  const discard = action(text.discardDraft, async () => {
    drafts.remove(reference);
    await reload();
    done(text.draftDiscarded);
    // The button that was pressed is gone.
    document.getElementById('main').focus({ preventScroll: true });
  }, {});
  keepFocus(place, () => clear(place,
    h('h1', {}, `${text.reference} ${reference.version} · `,
      h('a', { href: `#/patient/${patient.id}` }, patient.code)),
    h('p', { class: 'lead' }, approval),
    kept && h('p', { class: 'old-note row' }, h('span', {}, text.draftKept), discard),
    h('div', { class: 'plan-grid' },
      card(text.region,
        editable && hint(text.regionHint), h('div', {}, map), corners, tools),
      h('section', { class: 'card form' },
        planning, capturedCard(known.captured),
        isocentreFields(known, begun, planning, inputs, drawing, editable, [outside, side.place]),
        h('fieldset', {}, h('legend', {}, text.tolerance), field(text.shift, inputs.shift),
          field(text.rotation, inputs.rotation)),
        statedFields(inputs),
        templatePlace, field(text.posture, inputs.posture), inputs.couch.element,
        editable && hint(reference.approved_by ? text.approvedHint : text.approveHint),
        refusal && h('p', { class: 'caution refusal' }, refusal),
        unsaved, !planning && block, h('div', { class: 'row' }, editable && save, sign))),
    mesh && card(S.result.mesh, mesh.element), signPlace));
  if (editable && drawing) {
    templateOf(patient, heights.grid, model, inputs, drawing, changed)
      .then((element) => clear(templatePlace, element), (error) => warn(error.message));
  }
  // An edit is compared with what was stored, not with what was kept.
  if (kept) stored = writtenOf(reference, editable);
  changed();
  stored ??= inputs.written();
  note();
  return { isEdited, stop: () => mesh?.stop() };
}

export async function showPlan(place, id) {
  const text = S.plan;
  let reference;
  let shown;
  let busy = false;  // with our own change, of which the stream notifies us too
  const load = async () => {
    reference = await get(`references/${id}`);
    const drawn = await draft(place, reference, store, load);
    shown?.stop();  // another load may have drawn meanwhile
    shown = drawn;
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
      if (answer.id && answer.id !== id) {
        done(words);
        guardLeaving(null);
        location.hash = `#/plan/${answer.id}`;
      } else {
        await load();
        done(words);  // what is typed from now on is typed into the fields that stay
      }
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
  guardLeaving(() => shown.isEdited(), () => drafts.remove(reference));
  const stop = live.listen((kind) => { if (kind === 'data') follow().catch(() => {}); });
  return () => {
    guardLeaving(null);
    shown.stop();
    stop();
  };
}
