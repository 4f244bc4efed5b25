// SPDX-License-Identifier: Apache-2.0
// The set-up sheet of a patient: alert, immobilisation, a photo that the sensor took when a person
// asked for it, and what was drawn on it.
import { get, live, may, post, put, removeFor } from '../../api.js';
import { action, card, done, enable, field, form, h, hint } from '../../dom.js';
import { kNote } from '../../limits.js';
import { S } from '../../words.js';
import { drawingForm, setUpPicture } from './set_up_drawing.js';

/// Where it is confirmed who is on the couch; null where the sheet is empty.
export function setUpNote(patient) {
  const { alert, immobilisation: devices } = patient;
  const picture = setUpPicture(patient);
  if (!alert && !devices && !picture) return null;
  return h('div', { class: 'set-up' },
    picture, h('div', {},
      alert && h('p', { class: 'lead caution' }, alert),
      devices && h('p', {}, h('strong', {}, S.setUp.devices), ` ${devices}`)));
}

/// For who may change it.
export function setUpCard(patient, reload) {
  const text = S.setUp;
  const area = (value) => {
    const input = h('textarea', { rows: 2, ...kNote });
    input.value = value;
    return input;
  };
  const [devices, alert] = [area(patient.immobilisation), area(patient.alert)];
  const plain = (input) => input.value.replace(/\s+/g, ' ').trim();
  const take = action(patient.has_photo ? text.photoAgain : text.photoTake, async () => {
    await post(`patients/${patient.id}/photo`);
    done(text.photoTaken);
    await reload();
  }, {});
  enable(take, live.status?.sensor.present ?? false);
  const write = may('patients') && form({ class: 'form' }, async () => {
    const { site, note } = await get(`patients/${patient.id}`);
    await put(`patients/${patient.id}`, {
      site, note, site_before: site, note_before: note, immobilisation: plain(devices),
      alert: plain(alert), immobilisation_before: patient.immobilisation,
      alert_before: patient.alert,
    });
    done(S.saved);
    await reload();
  }, field(text.alert, alert, text.alertHint), field(text.devices, devices, text.devicesHint),
  h('button', {}, S.save));
  const remove = action(text.photoRemove, async () => {
    await removeFor(`patients/${patient.id}/photo`);
    await reload();
  }, {});
  // What is being drawn belongs to this photo.
  const drawing = drawingForm(patient, reload,
    () => { for (const button of [take, remove]) enable(button, false); });
  const ofPhoto = may('patients') && h('div', { class: 'below' }, hint(text.photoHint),
    h('div', { class: 'row' }, take, patient.has_photo && remove), drawing);
  return card(text.title, setUpNote(patient), write, ofPhoto);
}
