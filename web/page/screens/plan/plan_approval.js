// SPDX-License-Identifier: Apache-2.0
// The approval of a plan: what it signs, who may sign it.
import { currentSession, may, post } from '../../api.js';
import { checkbox, clear, field, fixed, h, hint, signedTime } from '../../dom.js';
import { compassOfPlan, marksNote } from '../../drawings/map_frame.js';
import { doubtsOf, movableCuts, sideViews } from '../../drawings/side_view.js';
import { kReason } from '../../limits.js';
import { kAxes } from '../../numbers.js';
import { signedForm } from '../../signed_form.js';
import { S, said } from '../../words.js';
import { capturedCard } from '../captured.js';
import { flagList } from '../common.js';
import { planningFacts, skinThreshold } from '../planning.js';
import { editor, measure } from './plan_editor.js';

/// The body from the side; of a planning CT wherever one cuts it.
export const sidesOf = (heights, point) =>
  (heights?.scene.planning ? movableCuts : sideViews)(heights, point);

/// Why the person who is logged in does not approve this draft; nothing where they may, or where it
/// is approved already.
export function whyNotApprove(reference) {
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

/// The map as it is stored, for the summary that is signed.
function storedPicture({ reference, heights }) {
  if (!heights) return null;
  const { region_m: region, isocentre_m: isocentre, posture } = reference.plan;
  const compass = compassOfPlan(reference.room, posture);
  const map = editor({ ...heights, compass }, { region, isocentre }, false, () => {});
  return h('div', {}, map.element, marksNote(compass));
}

/// Shows the summary in `place`, with the form that signs it.
export function showSummary(place, known, store) {
  const { reference } = known;
  const approve = (signature) => store(() => post(`references/${reference.id}/approve`, {
    revision: reference.revision, digest: reference.digest, ...signature,
  }), S.plan.approved);
  const element = summary(reference, known.patient, { ...known, picture: storedPicture(known) },
    approve);
  clear(place, element);
  element.scrollIntoView({ block: 'nearest' });
  element.querySelector('form input').focus();
}
