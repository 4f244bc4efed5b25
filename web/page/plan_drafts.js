// SPDX-License-Identifier: Apache-2.0
// Unsaved work at plans, kept in this tab over a reload and a session that ends by itself; not over
// what a person decides: saving, leaving without saving, logging out.
import { currentSession } from './api.js';

const prefixOf = (user) => `plumb-plan-${user}/`;
/// Another person's work is never shown, and none that was done on another revision.
const keyOf = (reference) =>
  `${prefixOf(currentSession()?.user)}${reference.id}-${reference.revision}`;

export const drafts = {
  read: (reference) => {
    try { return JSON.parse(sessionStorage.getItem(keyOf(reference))); } catch { return null; }
  },
  write: (reference, plan) => {
    try { sessionStorage.setItem(keyOf(reference), JSON.stringify(plan)); } catch { /* full */ }
  },
  remove: (reference) => {
    try { sessionStorage.removeItem(keyOf(reference)); } catch { /* there is none */ }
  },
  /// All of this person.
  removeAll: () => {
    const prefix = prefixOf(currentSession()?.user);
    try {
      for (const key of Object.keys(sessionStorage)) {
        if (key.startsWith(prefix)) sessionStorage.removeItem(key);
      }
    } catch { /* there is none */ }
  },
};
