// The texts of the chosen language. Screens read S when they draw: after useLanguage() they must be
// drawn again.
import { en } from './strings/en.js';
import { es } from './strings/es.js';

export const kLanguages = { en, es };
export const S = { ...en };

const key = (who) => `plumb-language-${who}`;
const stored = (name) => { try { return localStorage.getItem(name); } catch { return null; } };

/// The choice of an account on this browser, or of the room's screen ("room"); else the browser's.
export function languageOf(who) {
  const chosen = stored(key(who));
  if (kLanguages[chosen]) return chosen;
  return kLanguages[navigator.language?.slice(0, 2)] ? navigator.language.slice(0, 2) : 'en';
}

export function useLanguage(name) {
  delete S.translate;
  Object.assign(S, kLanguages[name]);
  document.documentElement.lang = name;
}

export function chooseLanguage(who, name) {
  try { localStorage.setItem(key(who), name); } catch { /* private window: for this page only */ }
  useLanguage(name);
}

/// Words that come from the appliance (directions, parts of the body, reasons), in this language.
export const translated = (text) => S.translate?.(text) ?? text;
