// SPDX-License-Identifier: Apache-2.0
// What a reference was made of; and how far a captured surface lies from the planning CT that it
// was compared with when it was captured.
import { getOrNull } from '../api.js';
import { card, h, hint, localDate } from '../dom.js';
import { digitsOf, kAxes, mostDigits, signed, withUnit } from '../numbers.js';
import { S, said } from '../words.js';
import { isAdvice } from './common.js';

/// "planning CT, version 1"
export const sourceVersion = ({ source, version }) =>
  S.session.sourceVersion[source === 'planning_ct' ? source : 'sweep'](version);

/// The version that a session compares with and its date, and of which source it is where that is
/// not plain.
export const comparesWith = ({ reference, other_reference: other }) => `${
  other || reference.source === 'planning_ct' ? S.session.compares(sourceVersion(reference))
    : S.session.referenceIs(reference.version)}, ${localDate(reference.created_at)}`;

/// The scan that `reference` was captured from and the planning CT that it was compared with; null
/// where it was not made so.
export async function capturedAgainst(reference) {
  if (reference?.source !== 'sweep') return null;
  const scan = await getOrNull(`scans/${reference.scan_id}`);
  const before = scan?.reference_id && await getOrNull(`references/${scan.reference_id}`);
  return before?.source === 'planning_ct' ? { reference, scan, before } : null;
}

const one = ({ value, u95, unit }, i) => (value === null ? S.none
  : withUnit(signed(value, digitsOf(u95 ?? NaN, mostDigits(kAxes[i]))), unit)
    + (u95 === null ? ' ±?' : ` ±${withUnit(u95.toFixed(2).replace('.', S.decimal), unit)}`));

/// The correction between both: of the surface against the CT.
export function capturedCard(captured) {
  if (!captured) return null;
  const { reference, scan, before } = captured;
  const text = S.result;
  const words = isAdvice(scan) ? text.capturedHint : text.capturedUnknown;
  return card(text.captured, hint(words(reference.version, before.version)),
    isAdvice(scan) && h('dl', { class: 'facts captured' }, scan.result.numbers.map((row, i) =>
      [h('dt', {}, said(scan.result.axes, row.name)), h('dd', {}, one(row, i))])));
}
