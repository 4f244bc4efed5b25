// SPDX-License-Identifier: Apache-2.0
// The log-in before this one: who sees a time that was not theirs, or failed attempts, knows that
// somebody else knows or guesses their password.
import { currentSession, get } from './api.js';
import { userWords } from './audit_words.js';
import { localTime } from './dom.js';
import { S, wordOf } from './words.js';

let asked = null;  // the session that was asked about, and the answer

/// {last: {time, address} or null, failed, changes}, asked once for each session; null where not
/// known.
export async function lastLogin() {
  const session = currentSession();
  if (asked?.session !== session) {
    asked = { session, answer: get('session/last-login', true).catch(() => null) };
  }
  return asked.answer;
}

export function lastLoginWords({ last, failed, changes = [] }) {
  const text = S.login;
  const when = last ? text.last(localTime(last.time), last.address) : text.first;
  const said = changes.map((entry) => text.change(
    wordOf(S.audit.actions, entry.action.replace('.', '_')), localTime(entry.time),
    userWords(entry)));
  return [when, failed > 0 && text.failedSince(failed),
    said.length > 0 && text.changed(said.join('; '))].filter(Boolean).join(' ');
}
