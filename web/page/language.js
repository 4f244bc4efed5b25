// SPDX-License-Identifier: Apache-2.0
// Which language the page is in. build.mjs lists the languages, each with its name and the address
// of its words; only those of the chosen one are loaded.
import { useCatalogue } from './words.js';

export const kLanguages = PLUMB_LANGUAGES;

/// Whose choice holds before anybody has logged in, and for those who have made none.
export const kNobody = 'login';

const kAgain_ms = 3000;
const key = (who) => `plumb-language-${who}`;
const kept = new Map();  // for this page, where the browser stores nothing
const stored = (name) => { try { return localStorage.getItem(name); } catch { return null; } };
export const isLanguage = (name) => Object.hasOwn(kLanguages, name ?? '');

/// The choice of an account on this browser, or of the room's screen ("room"); else that of the
/// log-in, else the browser's.
export function languageOf(who) {
  for (const one of [who, kNobody]) {
    const chosen = stored(key(one)) ?? kept.get(one);
    if (isLanguage(chosen)) return chosen;
  }
  const preferred = navigator.language?.slice(0, 2);
  return isLanguage(preferred) ? preferred : 'en';
}

/// Keeps the choice of an account, if there is such a language.
export function keepLanguage(who, name) {
  if (!isLanguage(name)) return;
  kept.set(who, name);
  try { localStorage.setItem(key(who), name); } catch { /* private window: for this page only */ }
}

const asked = new Map();  // each language's words are asked for once; null: not had
let wanted = null;
let used = null;

async function wordsOf(name) {
  try {
    const answer = await fetch(kLanguages[name].words);
    if (answer.ok) return await answer.json();
  } catch { /* no connection */ }
  asked.delete(name);
  return null;
}

/// True when the texts are in that language, false when one was asked for later. Without a
/// connection the words of before stay until these have come.
export async function useLanguage(name) {
  wanted = name;
  for (;;) {
    if (!asked.has(name)) asked.set(name, wordsOf(name));
    const words = await asked.get(name);
    if (wanted !== name) return false;
    if (words) {
      if (used !== words) useCatalogue(words);
      used = words;
      document.documentElement.lang = name;
      return true;
    }
    await new Promise((ready) => { setTimeout(ready, kAgain_ms); });
  }
}
