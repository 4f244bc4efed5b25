// SPDX-License-Identifier: Apache-2.0
// Lets users act on a result: scan again, accept it, make it a reference, download it.
import { fileUrl, live, may, post } from '../api.js';
import { action, clear, done, field, form, h, hint, signedTime } from '../dom.js';
import { kReason } from '../limits.js';
import { signedForm } from '../signed_form.js';
import { S, said, wordOf } from '../words.js';
import { closeSession } from '../treatment.js';
import { acceptanceMark } from './common.js';
import { removeScan } from './remove_scan.js';
import { whyNotValid } from './verdict.js';

/// Opens no session: that is done on the patient's page, where it is confirmed who is on the couch.
function rescanButton({ scan, patient }) {
  return action(S.result.rescan, async () => {
    const purpose = scan.purpose === 'reference' ? 'reference' : 'fraction';
    const { session, next_purpose: next } = live.status ?? {};
    const isOpen = session?.patient_id === patient.id && session.purpose === purpose
      && next === purpose;
    location.hash = isOpen ? '#/scan' : `#/patient/${patient.id}`;
  }, { class: 'primary' });
}

function outsideForm(scan, reload) {
  const text = S.result;
  const isUnsure = scan.result.verdict === 'unsure';
  const label = isUnsure ? text.acceptUnsure : text.acceptOutside;
  const reason = h('input', {
    required: true, autocomplete: 'off', list: 'usual-reasons', ...kReason,
  });
  return h('details', { class: 'accept-outside' }, h('summary', {}, `${label}…`),
    h('datalist', { id: 'usual-reasons' },
      Object.values(text.usualReasons).map((words) => h('option', { value: words }))),
    hint(text.acceptOutsideHint),
    signedForm({ class: 'form inline' }, async (sign) => {
      await post(`scans/${scan.id}/accept-outside`, { reason: reason.value.trim(), ...sign() });
      done(S.saved);
      await reload();
    }, h('button', { class: 'danger' }, label), field(text.acceptReason, reason)));
}

/// Only a valid result can be accepted: one tap in tolerance, else a reason and the password.
function acceptance({ scan, received, quality }, reload) {
  const text = S.result;
  if (scan.accepted_by) return accepted(scan);
  const element = h('div', { class: 'acceptance' });
  if (scan.result && quality?.why_not_accept) {
    clear(element, h('p', { class: 'caution' }, said(quality, 'why_not_accept')));
    return { element, tick: () => {} };
  }
  const possible = may('accept') && scan.result && scan.result.verdict !== 'no_answer';
  // Kept, so that a half-typed reason survives a short loss of the connection.
  let offer = null;
  let shown = null;
  const tick = () => {
    if (!possible) return;
    const valid = !whyNotValid(scan, received);
    if (shown === valid) return;
    shown = valid;
    if (!valid) {
      clear(element, hint(text.cannotAccept));
      return;
    }
    offer ??= scan.result.verdict === 'in_tolerance' ? action(text.accept, async () => {
      await post(`scans/${scan.id}/accept`);
      done(S.saved);
      await reload();
    }, { class: 'primary' }) : outsideForm(scan, reload);
    clear(element, offer);
  };
  return { element, tick };
}

/// Who accepted it, and a button to close its session, which usually comes next.
function accepted(scan) {
  const text = S.result;
  const { accepted_by: who, accepted_reason: why } = scan;
  const signed = scan.accepted_at ? `${who}, ${signedTime(scan.accepted_at)}` : who;
  const isUnsure = scan.result?.verdict === 'unsure';
  const words = !why ? text.acceptedBy(signed)
    : (isUnsure ? text.acceptedUnsure : text.acceptedOutside)(signed, why);
  const close = h('div', { class: 'acceptance' });
  let shown;
  const tick = () => {
    const { session, state } = live.status ?? {};
    const isRunning = state === 'scanning' || state === 'working';
    const open = may('scan') && !isRunning && session && session.id === scan.session_id
      ? session : null;
    if (shown === open?.id) return;
    shown = open?.id;
    clear(close, open && action(S.session.close, () => closeSession(open), {}));
  };
  return {
    element: h('div', { class: 'acceptance' },
      h('p', { class: `badge wide ${why ? 'move' : 'in_tolerance'}` },
        `${acceptanceMark(scan)} ${words}`), close),
    tick,
  };
}

const kFiles = ['result.json', 'error_map.png', 'overlay.png', 'deviation.tiff',
  'deviation_after.tiff', 'deformation.ply', 'distance.tiff', 'mesh.ply', 'cloud.ply',
  'heightmap.tiff'];

function files(scan) {
  const ofResult = /result|map\.png|overlay|deviation|deformation|distance/;
  const rows = kFiles.filter((name) => scan.result || !ofResult.test(name))
    .map((name) => h('li', {}, h('a', { href: fileUrl(scan.id, name, true), download: '' },
      wordOf(S.result.files, name))));
  return h('details', {}, h('summary', {}, S.result.export), h('ul', { class: 'files' }, rows));
}

/// A reference scan has made its draft by itself; this says whose turn it is.
function nextStep({ scan, draft }) {
  const text = S.result;
  if (scan.purpose !== 'reference' || scan.outcome !== 'done' || !draft) return null;
  const words = draft.approved_by ? '' : `${text.draftSaved(draft.version)} ${text.draftNext} `;
  return h('p', { class: 'lead next-step' }, words,
    may('plan') && h('a', { class: 'button', href: `#/plan/${draft.id}` }, text.draftLink));
}

/// Calls tick() when the validity may have changed.
export function actions(data, reload) {
  const text = S.result;
  const { scan, patient } = data;
  const reason = h('input', { required: true, autocomplete: 'off', ...kReason });
  const accept = acceptance(data, reload);
  // After verification by imaging, the position that was compared with the planning CT.
  const isCapture = data.reference?.source === 'planning_ct';
  const newReference = may('plan') && scan.outcome === 'done' && patient
    && scan.purpose !== 'reference'
    && h('div', { class: 'below' }, isCapture && hint(text.captureHint),
      form({ class: 'form inline' }, async () => {
        const body = { scan_id: scan.id, reason: reason.value.trim() };
        const { id } = await post('references', body);
        location.hash = `#/plan/${id}`;
      }, field(text.newReferenceReason, reason),
      h('button', {}, isCapture ? text.capture : text.newReference)));
  const element = h('div', {}, nextStep(data),
    h('div', { class: 'row' }, may('scan') && patient && rescanButton(data), accept.element,
      scan.outcome === 'done' && h('a', {
        class: 'button', download: '',
        href: `/api/v1/scans/${scan.id}/report.pdf?language=${document.documentElement.lang}`,
      }, text.report),
      scan.result && h('a', {
        class: 'button',
        href: `/result?scan=${scan.id}&language=${document.documentElement.lang}`,
      }, text.print)),
    newReference, files(scan), removeScan(data));
  return { element, tick: accept.tick };
}
