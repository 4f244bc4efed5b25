// What several screens show.
import { get } from '../api.js';
import { h } from '../dom.js';
import { S } from '../strings.js';

/// What is wrong and what to do about it; nothing where nothing is.
export const faultWords = ({ fault, fault_kind: kind }) => (fault ? `${fault.charAt(0).toUpperCase()}${fault.slice(1).replace(/[.!]$/, '')}. ${S.faultHints[kind] ?? ''}`.trim() : null);

export const verdictIcon = (verdict) => ({ in_tolerance: '✓', move: '↔', no_answer: '?' })[verdict] ?? '–';

export const verdictBadge = (verdict) => h('span', { class: `badge ${verdict}` }, `${verdictIcon(verdict)} ${S.result.verdicts[verdict]}`);

export const outcomeBadge = (scan) => (scan.result ? verdictBadge(scan.result.verdict) : h('span', { class: 'badge' }, scan.outcome === 'done' ? S.purposes[scan.purpose] : S.outcomes[scan.outcome]));

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
