// SPDX-License-Identifier: Apache-2.0
// Deleting one scan for good: a reason, the scan's number typed, and what stays said before.
import { get, may, removeFor } from '../api.js';
import { clear, done, field, form, h, hint } from '../dom.js';
import { kReason } from '../limits.js';
import { S } from '../words.js';

/// Nothing where this account may not, or there is nothing to delete.
export function removeScan({ scan, patient }) {
  if (!may('wipe') || scan.outcome === 'running') return null;
  const text = S.removeScan;
  const body = h('div', {}, hint(S.loading));
  const element = h('details', { class: 'remove-scan' }, h('summary', {}, `${text.open}…`), body);
  const draw = async () => {
    const references = patient
      ? (await get(`patients/${patient.id}/references`, true)).references : [];
    const made = references.find(({ scan_id: id }) => id === scan.id);
    if (made) {
      clear(body, h('p', { class: 'caution' }, text.isReference(made.version)));
      return;
    }
    const reason = h('input', { required: true, autocomplete: 'off', ...kReason });
    const number = h('input', { required: true, autocomplete: 'off', spellcheck: 'false' });
    clear(body, h('p', {}, text.goes), hint(text.stays),
      form({ class: 'form inline' }, async () => {
        if (number.value.trim() !== scan.id) throw new Error(text.differs(scan.id));
        await removeFor(`scans/${scan.id}`, { reason: reason.value.trim() });
        location.hash = patient ? `#/patient/${patient.id}` : '#/status';
        done(text.gone(scan.id));
      }, field(text.reason, reason), field(text.type(scan.id), number),
      h('button', { class: 'danger' }, text.submit)));
  };
  element.addEventListener('toggle', () => {
    if (element.open) draw().catch((error) => clear(body, h('p', {}, error.message)));
  });
  return element;
}
