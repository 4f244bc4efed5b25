// SPDX-License-Identifier: Apache-2.0
// The planning CT as reference: its upload, and what its files state.
import { post, sendFile } from '../api.js';
import {
  action, checkbox, clear, field, fixed, form, h, hint, localTime, redraw, row, table,
} from '../dom.js';
import { kReason } from '../limits.js';
import { S, said, saidEach } from '../words.js';
import { sentence, whenSettled } from './common.js';

const kDicom = '.dcm,application/dicom';

/// Files that the planning system has sent. @param take  Imports a plan with its structure set;
/// rows of other patients have no button for it.
function receivedList(patient, take) {
  const text = S.planning;
  const list = h('div', {});
  const became = (file) => {
    if (file.reference_id) return h('a', { href: `#/plan/${file.reference_id}` }, text.draftMade);
    if (file.fault) return h('span', { class: 'caution' }, sentence(said(file, 'fault')));
    if (!file.is_read) return text.notRead;
    if (file.kind !== 'plan') return text.waits;
    if (!file.structures) return text.noStructures;
    return file.patient_id && file.patient_id !== patient ? text.waits
      : action(text.take, () => take(file), {});
  };
  const show = (found) => {
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
      found.unlisted > 0 && hint(text.unlisted(found.unlisted)));
  };
  return { element: list, load: () => whenSettled('planning/received', list, show) };
}

/// Sends structure set and plan, or takes those that were received; the plan screen then shows the
/// draft made of them.
export function planningUpload(patient) {
  const text = S.planning;
  const file = () => h('input', { type: 'file', accept: kDicom, required: true });
  const [structures, plan] = [file(), file()];
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
  for (const input of [structures, plan]) input.addEventListener('change', forget);
  const bar = h('progress', { max: 1, value: 0, 'aria-label': text.sending, hidden: true });
  /// What is said of the files, beside them. @param which  Names them.
  const askWith = async (which, send) => {
    if (doubted !== which) forget();
    doubted = which;
    const inputs = { roi, isocentre_of: beam, reason };
    const fields = Object.fromEntries(Object.entries(inputs)
      .map(([key, input]) => [key, input.value.trim()]).filter(([, value]) => value));
    try {
      const { id } = await send(fields, !doubt.hidden && same.box.checked);
      location.hash = `#/plan/${id}`;
    } catch (error) {
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
  const received = receivedList(patient, (taken) => askWith(taken.name, (fields, isSame) =>
    post(`patients/${patient}/planning/received`, {
      structures: taken.structures, plan: taken.name, ...fields,
      ...(isSame && { same_patient: true }),
    })));
  const element = h('details', { class: 'planning-upload below' }, h('summary', {}, text.title),
    hint(text.hint), received.element,
    form({ class: 'form' }, () => askWith('', async (fields, isSame) => {
      bar.hidden = false;
      const [first, second] = [structures.files[0], plan.files[0]];
      const query = new URLSearchParams({ structures_bytes: first.size, ...fields,
        ...(isSame && { same_patient: 'yes' }) });
      return sendFile(`patients/${patient}/planning`, new Blob([first, second]), text.failed,
        (share) => { bar.value = share; }, { 'X-Plumb-Planning': `${query}` });
    }), field(text.structures, structures), field(text.plan, plan),
    field(text.roi, roi, text.roiHint), field(text.beam, beam, text.beamHint),
    field(S.patients.reason, reason), doubt, h('button', {}, text.send), bar));
  element.addEventListener('toggle', () => { if (element.open) received.load(); });
  return element;
}

/// What the files state, read-only. Nothing where the reference is a sweep.
export function planningFacts(scene) {
  const planning = scene?.planning;
  if (!planning) return null;
  const text = S.planning;
  const fact = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
  const warnings = saidEach(scene, 'warnings');
  return h('div', { class: 'planning-facts' }, h('h2', {}, text.fromCt),
    h('dl', { class: 'facts' }, fact(text.skin, planning.roi),
      fact(text.label, `${planning.plan_label} ${planning.plan_date} ${planning.approval}`),
      fact(text.slices, text.slicesOf(planning.slices,
        Number((1000 * planning.slice_spacing_m).toFixed(2)))),
      fact(text.inCt, `${planning.isocentre_lps_mm.map((v) => fixed(v, 1)).join('; ')} mm`)),
    hint(text.fixed),
    warnings.length > 0 && [h('p', {}, text.warnings),
      h('ul', {}, warnings.map((words) => h('li', { class: 'caution' }, words)))]);
}
