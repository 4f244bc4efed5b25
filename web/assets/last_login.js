// The log-in before this one: who sees a time that was not theirs, or failed attempts, knows that
// somebody else knows or guesses their password.
import { currentSession, get } from './api.js';
import { localTime } from './dom.js';
import { S } from './strings.js';

let asked = null;  // the session that was asked about, and the answer

/// {last: {time, address} or null, failed}, asked once for each session; null where not known.
export async function lastLogin() {
  const session = currentSession();
  if (asked?.session !== session) {
    asked = { session, answer: get('session/last-login', true).catch(() => null) };
  }
  return asked.answer;
}

export function lastLoginWords({ last, failed }) {
  const text = S.login;
  const when = last ? text.last(localTime(last.time), last.address) : text.first;
  return failed > 0 ? `${when} ${text.failedSince(failed)}` : when;
}
