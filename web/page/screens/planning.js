// SPDX-License-Identifier: Apache-2.0
// The planning CT as reference: its upload, and what its files state.
import { postLong, sendFile } from '../api.js';
import {
  action, checkbox, clear, done, field, fixed, form, h, hint, localTime, redraw, row, table,
} from '../dom.js';
import { kReason, kThreshold } from '../limits.js';
import { S, said, saidEach } from '../words.js';
import { sentence, whenSettled } from './common.js';

const kDicom = '.dcm,application/dicom';

/// Whether, and at which threshold, the skin is that of CT images. A person decides it each time.
function skinOfImages() {
  const text = S.planning;
  const wanted = checkbox(text.useImages, false);
  const threshold = h('input', { type: 'number', step: 'any', required: true, ...kThreshold });
  const files = h('input', { type: 'file', accept: kDicom, multiple: true });
  const chosen = h('fieldset', {}, h('legend', {}, text.imagesTitle),
    hint(text.useImagesHint), field(text.threshold, threshold, text.thresholdHint),
    field(text.imageFiles, files, text.imageFilesHint));
  const isOn = () => wanted.box.checked;
  const follow = () => {
    chosen.hidden = threshold.disabled = !isOn();  // what is hidden must not hold the form up
  };
  wanted.box.addEventListener('change', follow);
  follow();
  return {
    box: wanted.box, files, isOn, element: h('div', {}, wanted.element, chosen),
    /// The threshold. @throws {Error} for what is none.
    hu() {
      if (threshold.reportValidity()) return threshold.valueAsNumber;
      throw new Error(text.thresholdHint);
    },
  };
}

/// Each image behind its size, as the upload takes them.
function withSizes(files) {
  return [...files].flatMap((file) => {
    const size = new DataView(new ArrayBuffer(8));
    size.setBigUint64(0, BigInt(file.size), true);
    return [size, file];
  });
}

/// Files that the planning system has sent.
/// @param skin  As skinOfImages() made it.
/// @param take  Imports a plan with its structure set, or with the images of a series; rows of
/// other patients have no button for it.
function receivedList(patient, skin, take) {
  const text = S.planning;
  const list = h('div', {});
  let found = null;
  /// What may be done with a plan of this patient, or of no known patient yet.
  const choices = (file) => {
    const withContour = action(text.take, () => take(file), {});
    if (file.structures && file.has_skin) return withContour;
    const series = found.series.filter((one) => file.series.includes(one.uid));
    const why = file.structures ? text.noSkin : text.noStructures;
    if (!skin.isOn()) {
      return [file.structures && withContour, ` ${why}`,
        series.length > 0 && ` ${text.imagesThere}`];
    }
    if (!series.length) return `${why} ${text.noImages}`;
    return series.map((one) => action(text.takeImages(one.images),
      () => take(file, one.uid), { 'data-series': one.uid }));
  };
  const became = (file) => {
    if (file.reference_id) return h('a', { href: `#/plan/${file.reference_id}` }, text.draftMade);
    if (file.fault) return h('span', { class: 'caution' }, sentence(said(file, 'fault')));
    if (!file.is_read) return text.notRead;
    const isOthers = file.patient_id && file.patient_id !== patient;
    return file.kind !== 'plan' || isOthers ? text.waits : choices(file);
  };
  const draw = () => {
    if (!found) return;
    list.hidden = !found.is_on;
    const rows = found.files.map((file) => row(
      file.is_read ? `${text.kinds[file.kind]} ${file.label}` : S.none,
      localTime(file.received_at), `${file.sender}, ${file.address}`,
      file.patient_code || text.unknownPatient, became(file)));
    redraw(list, h('h3', {}, text.received),
      found.fault && h('p', { class: 'caution' }, sentence(said(found, 'fault'))),
      rows.length
        ? table([text.what, text.receivedAt, text.from, text.whose, text.became], rows,
          text.received)
        : hint(text.noneReceived),
      found.images > 0 && hint(text.images(found.images)),
      found.unread > 0 && hint(text.unread(found.unread)),
      found.damaged_images > 0 && h('p', { class: 'caution' },
        text.damagedImages(found.damaged_images), ' ', sentence(said(found, 'image_fault') ?? '')),
      found.unlisted > 0 && hint(text.unlisted(found.unlisted)));
  };
  skin.box.addEventListener('change', draw);
  const show = (now) => {
    found = now;
    draw();
  };
  return { element: list, load: () => whenSettled('planning/received', list, show) };
}

/// Sends structure set and plan, or takes those that were received; the plan screen then shows the
/// draft made of them, unless another screen is shown by then: an import may take minutes.
/// @param code  Names the patient there.
export function planningUpload(patient, code) {
  const text = S.planning;
  const file = () => h('input', { type: 'file', accept: kDicom, required: true });
  const [structures, plan] = [file(), file()];
  const skin = skinOfImages();
  skin.box.addEventListener('change', () => {
    structures.required = !skin.isOn();
    skin.files.required = skin.isOn();
  });
  const name = () => h('input', { autocomplete: 'off', maxlength: 64 });
  const [roi, beam] = [name(), name()];
  const reason = h('input', { autocomplete: 'off', maxlength: kReason.maxlength });
  // Shown where nothing proves that the files are this patient's.
  const same = checkbox(text.samePatient, false);
  const doubt = h('div', { class: 'below', hidden: true });
  let doubted = '';  // which files the question is about
  const forget = () => {  // other files, another question
    doubt.hidden = true;
    same.box.checked = false;
  };
  for (const input of [structures, plan, skin.files]) input.addEventListener('change', forget);
  const bar = h('progress', { max: 1, value: 0, 'aria-label': text.sending, hidden: true });
  /// What is said of the files, beside them. @param which  Names them.
  const askWith = async (which, send) => {
    if (doubted !== which) forget();
    doubted = which;
    const inputs = { roi, isocentre_of: beam, reason };
    const fields = Object.fromEntries(Object.entries(inputs)
      .map(([key, input]) => [key, input.value.trim()]).filter(([, value]) => value));
    const begun = location.hash;
    const isHere = () => location.hash === begun;
    try {
      const { id } = await send(fields, !doubt.hidden && same.box.checked);
      if (isHere()) location.hash = `#/plan/${id}`;
      else done(text.imported(code));
    } catch (error) {
      if (!isHere()) throw new Error(text.notImported(code, error.message));
      if (error.body?.error_message?.id.startsWith('store.planning_patient')) {
        clear(doubt, h('h3', {}, text.otherTitle),
          h('p', { class: 'caution' }, sentence(error.message)), same.element);
        doubt.hidden = false;
      }
      throw error;
    } finally {
      bar.hidden = true;
    }
  };
  const received = receivedList(patient, skin, (taken, series) => askWith(taken.name,
    (fields, isSame) => postLong(`patients/${patient}/planning/received`, {
      structures: taken.structures, plan: taken.name, ...fields,
      ...(series && { series, threshold_hu: skin.hu() }),
      ...(isSame && { same_patient: true }),
    })));
  const element = h('details', { class: 'planning-upload below' }, h('summary', {}, text.title),
    hint(text.hint), received.element,
    form({ class: 'form' }, () => askWith('', async (fields, isSame) => {
      const parts = [...structures.files, plan.files[0]];
      const images = skin.isOn() ? withSizes(skin.files.files) : [];
      const query = new URLSearchParams({
        structures_bytes: structures.files[0]?.size ?? 0, ...fields,
        ...(skin.isOn() && { plan_bytes: plan.files[0].size, threshold_hu: skin.hu() }),
        ...(isSame && { same_patient: 'yes' }),
      });
      bar.hidden = false;
      return sendFile(`patients/${patient}/planning`, new Blob([...parts, ...images]), text.failed,
        (share) => { bar.value = share; }, { 'X-Plumb-Planning': `${query}` });
    }), field(text.structures, structures), field(text.plan, plan), skin.element,
    field(text.roi, roi, text.roiHint), field(text.beam, beam, text.beamHint),
    field(S.patients.reason, reason), doubt, h('button', {}, text.send), bar));
  element.addEventListener('toggle', () => { if (element.open) received.load(); });
  return element;
}

/// The threshold in HU by which the skin was found in CT images; null where it is a contour.
export const skinThreshold = (scene) => scene?.planning?.skin_threshold_hu ?? null;

/// What the files state, read-only. Nothing where the reference is a sweep.
export function planningFacts(scene) {
  const planning = scene?.planning;
  if (!planning) return null;
  const text = S.planning;
  const fact = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
  const warnings = saidEach(scene, 'warnings');
  const hu = skinThreshold(scene);
  const skin = hu === null ? planning.roi
    : h('span', { class: 'caution' },
      text.skinAt(hu, Number((1000 * planning.skin_u95_m).toFixed(2))));
  return h('div', { class: 'planning-facts' }, h('h2', {}, text.fromCt),
    h('dl', { class: 'facts' }, fact(hu === null ? text.skin : text.skinName, skin),
      fact(text.label, `${planning.plan_label} ${planning.plan_date} ${planning.approval}`),
      fact(text.slices, text.slicesOf(planning.slices,
        Number((1000 * planning.slice_spacing_m).toFixed(2)))),
      fact(text.inCt, `${planning.isocentre_lps_mm.map((v) => fixed(v, 1)).join('; ')} mm`)),
    hint(text.fixed),
    warnings.length > 0 && [h('p', {}, text.warnings),
      h('ul', {}, warnings.map((words) => h('li', { class: 'caution' }, words)))]);
}
