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

const loaded = new Map();
let wanted = null;

/// Done when the texts are in that language, or in one that was asked for later. Without a
/// connection the words of before stay until these have come.
export async function useLanguage(name) {
  wanted = name;
  while (!loaded.has(name)) {
    try {
      const answer = await fetch(kLanguages[name].words);
      if (answer.ok) loaded.set(name, await answer.json());
    } catch { /* no connection */ }
    if (wanted !== name) return;
    if (!loaded.has(name)) await new Promise((ready) => { setTimeout(ready, kAgain_ms); });
  }
  useCatalogue(loaded.get(name));
  document.documentElement.lang = name;
}
