// SPDX-License-Identifier: Apache-2.0
// Asks before unsaved work is left.
import { S } from './words.js';

let guard = null;  // of the screen that is shown

/// @param isEdited  Whether there is unsaved work now; null: no guard.
/// @param forget    Called once a person has decided to leave it.
export function guardLeaving(isEdited, forget = () => {}) {
  guard = isEdited && { isEdited, forget };
}

export function mayLeave() {
  if (guard?.isEdited()) {
    if (!window.confirm(S.plan.leave)) return false;
    guard.forget();
  }
  guard = null;
  return true;
}

window.addEventListener('beforeunload', (event) => {
  if (guard?.isEdited()) event.preventDefault();
});
