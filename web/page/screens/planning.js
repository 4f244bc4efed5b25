// SPDX-License-Identifier: Apache-2.0
// The planning CT as reference: its upload, and what its files state.
import { sendFile } from '../api.js';
import { checkbox, clear, field, fixed, form, h, hint } from '../dom.js';
import { kReason } from '../limits.js';
import { S, saidEach } from '../words.js';
import { sentence } from './common.js';

const kDicom = '.dcm,application/dicom';

/// Sends structure set and plan; the plan screen then shows the draft made of them.
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
  for (const input of [structures, plan]) {
    input.addEventListener('change', () => {  // other files, another question
      doubt.hidden = true;
      same.box.checked = false;
    });
  }
  const bar = h('progress', { max: 1, value: 0, 'aria-label': text.sending, hidden: true });
  return h('details', { class: 'planning-upload below' }, h('summary', {}, text.title),
    hint(text.hint),
    form({ class: 'form' }, async () => {
      bar.hidden = false;
      try {
        const [first, second] = [structures.files[0], plan.files[0]];
        const query = new URLSearchParams({ structures_bytes: first.size });
        const more = { roi, isocentre_of: beam, reason };
        if (!doubt.hidden && same.box.checked) query.set('same_patient', 'yes');
        for (const [key, input] of Object.entries(more)) {
          if (input.value.trim()) query.set(key, input.value.trim());
        }
        const { id } = await sendFile(`patients/${patient}/planning`,
          new Blob([first, second]), text.failed, (share) => { bar.value = share; },
          { 'X-Plumb-Planning': `${query}` });
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
    }, field(text.structures, structures), field(text.plan, plan),
    field(text.roi, roi, text.roiHint), field(text.beam, beam, text.beamHint),
    field(S.patients.reason, reason), doubt, h('button', {}, text.send), bar));
}

/// What the files state, read-only. Nothing where the reference is a sweep.
export function planningFacts(scene) {
  const planning = scene?.planning;
  if (!planning) return null;
  const text = S.planning;
  const row = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
  const warnings = saidEach(scene, 'warnings');
  return h('div', { class: 'planning-facts' }, h('h2', {}, text.fromCt),
    h('dl', { class: 'facts' }, row(text.skin, planning.roi),
      row(text.label, `${planning.plan_label} ${planning.plan_date} ${planning.approval}`),
      row(text.slices, text.slicesOf(planning.slices,
        Number((1000 * planning.slice_spacing_m).toFixed(2)))),
      row(text.inCt, `${planning.isocentre_lps_mm.map((v) => fixed(v, 1)).join('; ')} mm`)),
    hint(text.fixed),
    warnings.length > 0 && [h('p', {}, text.warnings),
      h('ul', {}, warnings.map((words) => h('li', { class: 'caution' }, words)))]);
}
