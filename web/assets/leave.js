// Asks before unsaved work is left.
import { S } from './strings.js';

let guard = null;  // of the screen that is shown

/// @param isEdited  Whether there is unsaved work now; null: no guard.
export function guardLeaving(isEdited) { guard = isEdited; }

export function mayLeave() {
  if (!guard?.()) {
    guard = null;
    return true;
  }
  if (!window.confirm(S.plan.leave)) return false;
  guard = null;
  return true;
}

window.addEventListener('beforeunload', (event) => { if (guard?.()) event.preventDefault(); });
