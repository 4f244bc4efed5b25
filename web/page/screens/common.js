// SPDX-License-Identifier: Apache-2.0
// Parts that several screens show.
import {
  get, getIfThere, getOrNull, live, since_s,
} from '../api.js';
import { clear, h } from '../dom.js';
import { kMarks } from '../numbers.js';
import { S, said, saidEach } from '../words.js';

/// Whether a sensor is cold that has been on for this time; how long it must be on is a setting of
/// the appliance.
export const isCold = (on_s) => on_s < live.status?.sensor.warm_up_s;
export const minutesOf = (seconds) => Math.round(seconds / 6) / 10;

const capital = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}`;
/// A reason as a sentence.
export const sentence = (reason = '') =>
  `${capital(reason).replaceAll('+-', '±')}${/[.!]$/.test(reason) || !reason ? '' : '.'}`;

/// What a daily check did not check.
export const cautionsOf = (check) =>
  saidEach(check, 'cautions').map((one) => h('p', { class: 'caution' }, sentence(one)));

/// Says what is wrong and what to do about it; null where nothing is.
export function faultWords(status) {
  if (!status.fault) return null;
  const words = capital(said(status, 'fault')).replace(/[.!]$/, '');
  return `${words}. ${S.faultHints[status.fault_kind] ?? ''}`.trim();
}

const kSettling_ms = 1000, kNoAnswer_ms = 5000;
/// Shows what the appliance knows at once, and again until it has finished looking, as long as
/// `element` is on the page. A question without an answer is asked again.
export async function whenSettled(path, element, show) {
  const found = await getOrNull(path);
  if (!element.isConnected) return;
  if (found) show(found);
  if (found?.is_settled) return;
  setTimeout(() => whenSettled(path, element, show), found ? kSettling_ms : kNoAnswer_ms);
}

/// The session that a scan belongs to, or null.
export const sessionOf = (scan) => scan.session_id ?? null;

/// The appliance's state as the open session sees it: a result of another session is none of its.
export function stateHere({ state, session, last_result: last }) {
  const isOthers = state === 'result' && (last ? sessionOf(last) : null) !== (session?.id ?? null);
  return isOthers ? 'ready' : state;
}

/// What to do in that state; where the sensor is at rest, what the next press starts.
export const stateHint = (status) => {
  if (status.press === 'monitoring') return S.stateHints.at_rest;
  const state = stateHere(status);
  const isHeld = status.wants_wristband && ['ready', 'result'].includes(state);
  return isHeld ? S.room.wristbandHint(status.session.patient_code) : S.stateHints[state];
};

export const verdictIcon = (verdict) =>
  ({ in_tolerance: '✓', unsure: '≈', move: '↔', no_answer: '?' })[verdict] ?? '–';

/// Mark of an accepted result. One that was accepted with a reason was outside tolerance, or
/// inconclusive.
export const acceptanceMark = (scan) => (!scan.accepted_reason ? kMarks.in_tolerance
  : scan.result?.verdict === 'unsure' ? kMarks.unsure : kMarks.outside);

const verdictBadge = (verdict) => h('span', { class: `badge ${verdict}` },
  `${verdictIcon(verdict)} ${S.result.verdicts[verdict] ?? verdict}`);

export const outcomeBadge = (scan) => (scan.result ? verdictBadge(scan.result.verdict)
  : h('span', { class: 'badge' }, scan.outcome === 'done'
    ? scan.patient_id || scan.purpose === 'daily_check' ? S.purposes[scan.purpose]
      : S.room.unassigned
    : S.outcomes[scan.outcome]));

/// NO ANSWER is a result, but none to act on: then no number, word or trend is shown that somebody
/// could apply.
export const isAdvice = (scan) =>
  Boolean(scan.result?.correction) && scan.result.verdict !== 'no_answer';

/// Where the comparison found the patient's sides and the room's, for the marks on pictures: no
/// answer, no side of the patient.
export function sidesOf(scan, details) {
  const body = details?.body;
  if (!body || isAdvice(scan) || body.named_by === 'axes') return body;
  return { ...body, named_by: 'room' };
}

/// Why no reference may be scanned or approved now, with the way to what is needed; follows the
/// status while it is shown. `tell(why)` is first called at once.
export function blockNote(tell) {
  const element = h('p', { class: 'caution reference-block', role: 'status' });
  let shown;
  const draw = () => {
    const why = said(live.status, 'reference_block') ?? null;
    if (why === shown) return;
    shown = why;
    clear(element, why && [sentence(why), live.status.check_overdue
      && [' ', h('a', { href: '#/check' }, S.nav.check)]]);
    tell(why);
  };
  draw();
  const stop = live.listen(() => {
    // Nobody says when a screen goes: what has been taken out of the page listens no more.
    if (shown !== undefined && element.dataset.seen && !element.isConnected) stop();
    else draw();
    if (element.isConnected) element.dataset.seen = 'yes';
  });
  return element;
}

/// The state that was known last, while there is no connection; draw() each second. Only the state
/// is announced: its age changes too often.
/// @param before  Gives words that stand before it.
export function lastKnownNote(look, role = 'status', before = () => '') {
  const state = h('span', { role });
  const age = h('span', {});
  const element = h('p', { class: 'visually-hidden' }, state, age);
  const draw = () => {
    const shown = !live.connected && live.status;
    element.className = shown ? look : 'visually-hidden';
    const words = shown ? `${before()}${S.lastKnown(S.states[stateHere(live.status)])}` : '';
    if (state.textContent !== words) state.textContent = words;
    age.textContent = shown ? S.lastKnownAge(Math.floor(since_s(live.received))) : '';
  };
  return { element, draw };
}

/// As `ask`, but nothing where the answer of a later call came before, which is newer, and where
/// this one fails while a later one goes on.
export function newestOf(ask) {
  let asked = 0;
  let answered = 0;
  return async (...rest) => {
    const mine = ++asked;
    try {
      const answer = await ask(...rest);
      if (mine < answered) return null;
      answered = mine;
      return answer;
    } catch (error) {
      if (mine < asked) return null;
      throw error;
    }
  };
}

/// As live.listen(); calls `tick` regularly besides. Returns what ends both.
export function follow(listener, tick, every_ms = 1000) {
  const stop = live.listen(listener);
  const timer = setInterval(tick, every_ms);
  return () => {
    clearInterval(timer);
    stop();
  };
}

/// What belongs to a scan; null where there is none, or it cannot be had.
export async function partsOf(scan) {
  const [reference, details, scene, quality] = await Promise.all([
    scan.reference_id ? getIfThere(`references/${scan.reference_id}`) : null,
    scan.result ? getIfThere(`results/${scan.id}`) : null,
    getOrNull(`scans/${scan.id}/files/scene.json`), qualityOf(scan)]);
  return { reference, details, scene, quality };
}

/// How good the scan is, as the appliance judges it; null if there is nothing to judge.
export const qualityOf = (scan) => getIfThere(`scans/${scan.id}/quality`);

/// Parts of the body, in words; none: every part is as in the reference.
export const findings = (parts) => h('ul', { class: 'findings' }, parts.length
  ? parts.map((part) => h('li', {}, part))
  : h('li', { class: 'fine-part' }, `✓ ${S.result.asReference}`));

/// Codes by patient id, for lists.
export async function patientCodes() {
  const { patients } = await get('patients', true);
  return new Map(patients.map((patient) => [patient.id, patient.code]));
}

export function ageText(seconds) {
  const text = S.result;
  if (seconds < 120) return text.seconds(Math.floor(seconds));
  if (seconds < 2 * 3600) return text.minutes(Math.floor(seconds / 60));
  if (seconds < 48 * 3600) return text.hours(Math.floor(seconds / 3600));
  return text.days(Math.floor(seconds / 86400));
}

/// What people should know about a scan besides its verdict.
export function flagList(scan, quality, valid = true) {
  const [part] = isAdvice(scan) ? saidEach(scan.result.body, 'after') : [];
  const text = S.result.flags;
  const flags = [part && (valid ? text.posture : text.postureThen)(part),
    ...saidEach(quality, 'cautions')].filter(Boolean);
  return flags.length > 0 && h('ul', { class: 'flags' }, flags.map((flag) => h('li', {}, flag)));
}
