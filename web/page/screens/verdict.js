// SPDX-License-Identifier: Apache-2.0
// The head of a result: whose it is, how old, the verdict, and whether it can be acted on.
import { live, may, since_s } from '../api.js';
import { couchApply } from '../couch/axes.js';
import { clear, h, localTime } from '../dom.js';
import { kResult } from '../limits.js';
import { S, said, saidEach } from '../words.js';
import { sourceVersion } from './captured.js';
import { ageText, flagList, sentence, sessionOf, verdictIcon } from './common.js';

/// Seconds since the scan ended; Infinity where that is not known: such a result is old.
export function ageOf(scan, received) {
  const last = live.status?.last_result;
  const told = last?.id === scan.id ? { age_s: last.age_s, at: live.received }
    : { age_s: scan.age_s, at: received };
  return (told.age_s ?? Infinity) + since_s(told.at);
}

/// Why this result must not be used: "running", "superseded" (another sweep of its session has
/// begun since), "other_reference" (the session compares with another one by now), "closed" (its
/// session is not the one that is open, even if that is the same patient's), "old", "offline"
/// (without a connection it is not known whether one of these holds by now); null: it is valid. The
/// appliance measures the age of its last result since its start by a steady clock. Any other age
/// is the wall clock's, which may have been changed, so it counts as old.
export function whyNotValid(scan, received) {
  if (!scan.result) return null;
  const { status } = live;
  if (status?.state === 'scanning' || status?.state === 'working') return 'running';
  const last = status?.last_result;
  if (last && sessionOf(last) === sessionOf(scan) && (last.id !== scan.id || last.superseded)) {
    return 'superseded';
  }
  if (ageOf(scan, received) > kResult.valid_s) return 'old';
  const isOpen = sessionOf(scan) === (status?.session?.id ?? null);
  if (status && scan.patient_id && !isOpen) return 'closed';
  const reference = status?.session?.reference;
  if (reference && scan.reference_id && reference.id !== scan.reference_id) {
    return 'other_reference';
  }
  if (status?.last_result?.id !== scan.id) return 'old';
  return live.connected ? null : 'offline';
}

export function identity({ scan, patient, reference, received }) {
  const text = S.result;
  const age = h('strong', {});
  const item = (label, ...value) => h('div', {}, h('dt', {}, label), h('dd', {}, ...value));
  const sinceScan = item(text.age, age);
  const scansSoFar = h('small', {});
  const element = h('dl', { class: 'identity' },
    item(text.patient, h('strong', { class: 'code' },
      patient ? h('a', { href: `#/patient/${patient.id}` }, patient.code) : S.none)),
    scan.fraction && item(text.fraction, `${scan.fraction}`, scansSoFar),
    item(text.reference, reference
      ? `${reference.source === 'planning_ct' ? sourceVersion(reference)
        : text.version(reference.version)}, ${localTime(reference.created_at)}` : S.none),
    item(text.scanned, localTime(scan.started_at)),
    sinceScan);
  const tick = () => {
    const seconds = ageOf(scan, received);
    // How often this session has been scanned by now.
    const { session } = live.status ?? {};
    const isOpen = session && session.id === scan.session_id;
    scansSoFar.textContent = isOpen ? ` · ${S.session.scans(session.num_scans)}` : '';
    sinceScan.hidden = !Number.isFinite(seconds);
    if (!sinceScan.hidden) age.textContent = ageText(seconds);
  };
  return { element, tick };
}

/// @param review  The result was opened from the history: it is read, not acted on.
export function validityNote(scan, received, review) {
  const text = S.result;
  const element = h('p', { class: 'old-note', role: 'status' });
  const words = {
    running: [text.running, text.runningText],
    superseded: [text.superseded, text.supersededText],
    closed: [text.closed, text.closedText],
    other_reference: [text.otherReference, text.otherReferenceText],
    old: [text.old, text.oldText],
    offline: [text.offline, text.offlineText],
  };
  const tick = () => {
    const why = whyNotValid(scan, received);
    const shown = why && review && why !== 'running' ? 'review' : why ?? '';
    if (element.dataset.shown === shown) return why;
    element.dataset.shown = shown;
    if (!shown) clear(element);
    else {
      const [word, ...rest] = shown === 'review'
        // On a narrow screen the time is left out here: it stands right above.
        ? [text.reviewTitle, h('span', { class: 'review-of' },
          text.review(localTime(scan.started_at)), ' '), text.reviewText] : words[shown];
      clear(element, h('strong', {}, word), ' ', rest,
        shown === 'running' && may('view')
          && [' ', h('a', { href: '#/scan' }, S.scan.toSweep)]);
    }
    return why;
  };
  return { element, tick };
}

function withoutResult({ scan, patient, quality }, valid) {
  const text = S.result;
  const unassigned = scan.outcome === 'done' && !scan.patient_id;
  const words = { failed: text.failed, cancelled: text.cancelled }[scan.outcome]
    ?? (unassigned ? `${text.unassigned} ${text.noReference}` : text.noReference);
  const draft = scan.purpose === 'reference' && scan.outcome === 'done' && patient;
  const flags = scan.outcome === 'done' && flagList(scan, quality, valid);
  const why = scan.outcome !== 'cancelled' && scan.failure ? said(scan, 'failure') : '';
  return h('section', { class: 'verdict none' },
    h('p', { class: 'word' }, unassigned ? S.room.unassigned : S.purposes[scan.purpose]),
    h('p', { class: 'why' }, why ? `${words.replace(/\.$/, '')}: ${why}` : draft ? '' : words),
    flags, flags && draft && h('p', { class: 'lead' }, text.referenceAgain));
}

/// @param valid  Whether it can be acted on; else it says what was found, and asks for nothing.
export function verdictStrip({ scan, quality, patient }, valid = true) {
  const text = S.result;
  const { result } = scan;
  if (!result) return withoutResult({ scan, patient, quality }, valid);
  const reasons = saidEach(result, 'reasons');
  // The first reason decides; a wall of text is not read.
  const [first, ...others] = result.verdict === 'no_answer' ? reasons
    : [valid && result.verdict === 'move' && result.along_couch ? couchApply()
      : (valid ? text.why : text.whyThen)[result.verdict] ?? reasons[0]];
  return h('section', { class: `verdict ${result.verdict}` },
    h('p', { class: 'word' },
      h('span', { class: 'icon', 'aria-hidden': 'true' }, verdictIcon(result.verdict)),
      (valid ? text.verdicts : text.verdictsThen)[result.verdict] ?? result.verdict),
    h('p', { class: 'why' }, sentence(first)),
    valid && result.verdict === 'no_answer' && h('p', { class: 'next-step' },
      S.result.noAnswerNext(live.status?.session?.patient_code ?? S.none)),
    flagList(scan, quality, valid),
    others.length > 0 && h('details', { class: 'other-reasons' },
      h('summary', {}, text.otherReasons(others.length)),
      h('ul', {}, others.map((reason) => h('li', {}, sentence(reason))))));
}
