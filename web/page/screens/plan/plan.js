// SPDX-License-Identifier: Apache-2.0
// The plan of a reference: region, isocentre, tolerances; and its approval, which signs exactly
// what is stored.
import { currentSession, get, live, may, post, put } from '../../api.js';
import {
  action, card, checkbox, clear, done, enable, field, fixed, h, hint, keepFocus, localTime, say,
  select, signedTime, warn,
} from '../../dom.js';
import { guardLeaving } from '../../leave.js';
import { kBounds, kReason, kStated } from '../../limits.js';
import { compassOfPlan, marksNote } from '../../drawings/map_frame.js';
import { loadMap } from '../../drawings/maps.js';
import { doubtsOf, movableCuts, sideViews } from '../../drawings/side_view.js';
import { kAxes } from '../../numbers.js';
import { drafts } from '../../plan_drafts.js';
import { signedForm } from '../../signed_form.js';
import { S, said } from '../../words.js';
import { capturedAgainst, capturedCard } from '../captured.js';
import { blockNote, flagList, qualityOf } from '../common.js';
import { meshView } from '../mesh_view.js';
import { planningFacts, skinThreshold } from '../planning.js';
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

/// The body from the side; of a planning CT wherever one cuts it.
const sidesOf = (heights, point) =>
  (heights?.scene.planning ? movableCuts : sideViews)(heights, point);

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

/// Why the person who is logged in does not approve this draft; nothing where they may, or where it
/// is approved already.
function whyNotApprove(reference) {
  if (reference.approved_by) return null;
  if (!reference.planned_by) return S.plan.unplanned;
  const isOwn = [reference.created_by, reference.planned_by].includes(currentSession()?.user);
  return isOwn && may('approve') ? S.plan.secondPerson : null;
}

/// Shows what an approval signs, read-only and complete, with the checksum that goes into the log.
function summary(reference, patient, { scan, quality, picture, heights, captured }, approve) {
  const text = S.plan;
  const { plan } = reference;
  const row = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
  const placed = (point) => point.map((v, i) => `${'xyz'[i]} ${fixed(1000 * v, 1)}`).join('; ');
  const number = (value) => `${value}`.replace('.', S.decimal);
  const size = measure(plan.region_m);
  const flags = scan && flagList(scan, quality);
  const planning = planningFacts(heights?.scene);
  // The map of a planning CT shows no couch to judge the isocentre by.
  const doubts = heights && plan.isocentre_m && !planning
    ? doubtsOf(heights, plan.isocentre_m).words : [];
  const reason = flags && h('input', { required: true, autocomplete: 'off', ...kReason });
  const posture = reference.room?.contradicts_posture
    && checkbox(text.postureConfirm, false, { required: true });
  const hu = skinThreshold(heights?.scene);
  const skin = hu !== null && checkbox(text.imagesConfirm, false, { required: true });
  const signature = signedForm({ class: 'form inline below' },
    (sign) => approve({ ...sign(), ...(reason && { reason: reason.value.trim() }),
      ...(posture && { posture_confirmed: posture.box.checked }),
      ...(skin && { images_confirmed: skin.box.checked }) }),
    h('button', { class: 'primary' }, text.summarySubmit),
    reason ? field(text.flagsReason, reason) : [],
    posture ? h('div', {}, h('p', { class: 'caution' }, text.postureContradicted),
      posture.element) : [],
    skin ? h('div', {}, h('p', { class: 'caution' }, text.imagesUsed(hu)), skin.element) : []);
  return h('section', { class: 'card summary', 'aria-label': text.summary },
    h('h2', {}, text.summary), h('div', { class: 'summary-grid' },
      picture, h('dl', { class: 'facts' },
      row(S.patients.code, patient.code), row(S.patients.version, `${reference.version}`),
      row(S.patients.made, `${signedTime(reference.created_at)}, ${reference.created_by}`),
      row(text.planned, reference.planned_by),
      row(S.patients.reasonShort, reference.reason || S.none),
      row(text.region, plan.region_m.length
        ? `${text.corners(plan.region_m.length)}, ${text.area(size.cm2, size.mm)}`
        : text.wholeBody),
      row(text.isocentre, plan.isocentre_m ? `${placed(plan.isocentre_m)} mm` : text.middle),
      kAxes.map((axis) => row(text.toleranceSigned(S.result.axes[axis.name].toLowerCase()),
        axis.shift ? `±${number(plan.tolerance.shift_mm)} mm`
          : `±${number(plan.tolerance.rotation_deg)}°`)),
      row(text.posture, text.postures[plan.posture]),
      row(text.markerKind, plan.couch_markers ? text.couchMarkers : text.roomMarkers),
      planning && [row(text.clothing, `±${number(plan.clothing_mm)} mm`),
        row(text.ctBreathing, `±${number(plan.ct_breathing_mm)} mm`)],
      quality && row(text.scanQuality, quality.rows.map((one) =>
        `${said(one, 'name')}: ${said(one, 'value')}`).join('; ')),
      row(text.signature, h('code', {}, reference.digest)))),
    planning, capturedCard(captured), sidesOf(heights, plan.isocentre_m),
    doubts.map((words) => h('p', { class: 'caution' }, words)),
    flags, hint(text.approveHint), signature);
}

/// One stored plan and what is edited of it. `store(request)` sends a change, `reload` shows what
/// is stored.
async function draft(place, reference, store, reload) {
  const text = S.plan;
  const patient = await get(`patients/${reference.patient_id}`);
  const scan = await get(`scans/${reference.scan_id}`).catch(() => null);
  const quality = scan && await qualityOf(scan);
  const captured = await capturedAgainst(reference);
  const editable = may('plan');
  let planning = null;
  const kept = editable ? drafts.read(reference) : null;
  const plan = kept ?? storedPlan(reference);
  const lasers = reference.room?.lasers_m?.map((value) => Number(value.toFixed(4))) ?? null;
  // Nobody has planned it yet: what the calibration has measured, unless somebody says otherwise.
  const byLasers = Boolean(lasers && editable && !kept && !reference.planned_by
    && !plan.isocentre_m);
  const model = { region: plan.region_m.map((point) => [...point]),
    isocentre: byLasers ? lasers : plan.isocentre_m };
  const inputs = controls(reference, model, plan, editable);
  const corners = hint();
  const outside = h('p', { class: 'caution' });
  const sidePlace = h('div', {});
  const meant = checkbox(text.isocentreMeant, false, { disabled: !editable });
  let doubts = { refused: false, words: [] };
  let drawnPoint = '';
  /// The isocentre from the side, and what is implausible about it.
  const drawSide = () => {
    const point = model.isocentre;
    const shown = JSON.stringify([point, Boolean(loaded)]);
    if (shown === drawnPoint) return;
    drawnPoint = shown;
    meant.box.checked = false;
    doubts = point && loaded && !planning ? doubtsOf(loaded, point) : { refused: false, words: [] };
    clear(sidePlace, sidesOf(loaded, point),
      doubts.words.map((words) => h('p', { class: 'caution isocentre-doubt' }, words)),
      doubts.words.length > 0 && !doubts.refused && editable && meant.element);
  };
  const mapPlace = h('div', {});
  const signPlace = h('div', {});
  const templatePlace = h('div', {});
  let stored;  // as written when nothing is edited
  let mesh = null;
  let drawing = null;
  let hadIsocentre = Boolean(model.isocentre);
  let loaded = null;
  // Nothing has been compared: whoever plans and approves sees here whether the posture is right.
  const compassFor = (posture) => compassOfPlan(reference.room, posture);
  const isEdited = () => stored !== undefined && inputs.written() !== stored;
  const refusal = whyNotApprove(reference);
  const sign = may('approve') && !reference.approved_by && !refusal
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
    drawSide();
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
  const unsaved = h('p', { class: 'caution', role: 'status' });
  try {
    loaded = await loadHeights(reference);
    planning = planningFacts(loaded.scene);
    // The file states them.
    if (planning) {
      for (const input of [...inputs.axes, inputs.posture, inputs.couch.box]) {
        input.disabled = true;
      }
    }
    const compass = compassFor(plan.posture);
    // No other screen shows this surface before it is signed.
    if (planning && scan) mesh = meshView({ scan }, { compass }, 0);
    const marksPlace = h('div', {}, marksNote(compass));
    drawing = editor({ ...loaded, compass }, model, editable, changed, Boolean(planning));
    inputs.posture.addEventListener('change', () => {
      const wanted = compassFor(inputs.posture.value);
      drawing.mark(wanted);
      clear(marksPlace, marksNote(wanted));
    });
    clear(mapPlace, drawing.element, marksPlace);
  } catch (error) {
    clear(mapPlace, hint(error.message));
  }
  const picture = () => {
    if (!loaded) return null;
    const shown = { region: reference.plan.region_m, isocentre: reference.plan.isocentre_m };
    const compass = compassFor(reference.plan.posture);
    return h('div', {}, editor({ ...loaded, compass }, shown, false, () => {}).element,
      marksNote(compass));
  };
  const showSummary = () => {
    const approve = (signature) => store(() => post(`references/${reference.id}/approve`, {
      revision: reference.revision, digest: reference.digest, ...signature,
    }), text.approved);
    const element = summary(reference, patient, {
      scan, quality, picture: picture(), heights: loaded, captured,
    }, approve);
    clear(signPlace, element);
    element.scrollIntoView({ block: 'nearest' });
    element.querySelector('form input').focus();
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
    if (doubts.refused) throw new Error(doubts.words[0]);
    const isStored = JSON.stringify(reference.plan.isocentre_m) === JSON.stringify(model.isocentre);
    if (doubts.words.length && !isStored && !meant.box.checked) {
      meant.box.focus();
      throw new Error(text.isocentreConfirm);
    }
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
  const movable = editable && !planning;
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
        editable && hint(text.regionHint), mapPlace, corners, tools),
      h('section', { class: 'card form' },
        planning, capturedCard(captured),
        h('fieldset', {}, h('legend', {}, text.isocentre),
          !planning && hint(text.isocentreHint),
          movable && hint(text.pickHint),
          h('div', { class: 'triple' }, inputs.axes.map((input, i) =>
            field(`${'xyz'[i]} (mm)`, input))), inputs.bad, outside, sidePlace,
          byLasers && hint(text.lasersTaken),
          movable && drawing && lasers && action(text.lasers, async () => {
            inputs.bad.textContent = '';
            drawing.setIsocentre([...lasers]);
          }, {}),
          movable && drawing && action(text.pick, async () => drawing.pick(), {}),
          movable && drawing && markerChoice(loaded.scene, (point) => {
            inputs.bad.textContent = '';
            drawing.setIsocentre(point);
          })),
        h('fieldset', {}, h('legend', {}, text.tolerance), field(text.shift, inputs.shift),
          field(text.rotation, inputs.rotation)),
        statedFields(inputs),
        templatePlace, field(text.posture, inputs.posture), inputs.couch.element,
        editable && hint(reference.approved_by ? text.approvedHint : text.approveHint),
        refusal && h('p', { class: 'caution refusal' }, refusal),
        unsaved, !planning && block, h('div', { class: 'row' }, editable && save, sign))),
    mesh && card(S.result.mesh, mesh.element), signPlace));
  if (editable && drawing) {
    templateOf(patient, loaded.grid, model, inputs, drawing, changed)
      .then((element) => clear(templatePlace, element), (error) => warn(error.message));
  }
  if (kept) {
    // An edit is compared with what was stored, not with what was kept.
    const blank = controls(reference,
      { region: reference.plan.region_m, isocentre: reference.plan.isocentre_m },
      storedPlan(reference), editable);
    stored = blank.written();
  }
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
    const before = shown;
    shown = await draft(place, reference, store, load);
    before?.stop();
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
