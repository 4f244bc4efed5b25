// SPDX-License-Identifier: Apache-2.0
// How the room's couch counts the six numbers, as the appliance says: what it was signed for.
import { live } from '../api.js';
import { h } from '../dom.js';
import { said, saidEach } from '../words.js';

/// @param applies  Whether the numbers run along the couch: in an unknown room they do not.
export function couchAxis(axis, applies = true) {
  const known = applies ? live.status?.couch?.axes[axis.name] : null;
  return known ?? { factor: 1, unit: axis.unit, digits: axis.shift ? 1 : 2, moves: true };
}

export const couchVersion = () => live.status?.couch?.version ?? 0;

/// A row that the couch cannot apply is left out only while it is in tolerance.
export const isLeftOut = (axis, row, applies) => Boolean(live.status?.couch?.hides_rest)
  && !couchAxis(axis, applies).moves && row.judgement === 'in_tolerance';

/// What a correction asks for, and what is said in place of a direction that the couch cannot go.
export const couchApply = () => (live.status?.couch ? said(live.status.couch, 'apply') : '');
export const couchCannot = () => said(live.status.couch, 'cannot');

/// Beside the numbers: how they are counted, and what the couch cannot do.
export function couchNotes(applies = true) {
  const notes = applies && live.status?.couch ? saidEach(live.status.couch, 'notes') : [];
  return notes.length > 0 && h('p', { class: 'couch-notes' }, notes.join(' '));
}
