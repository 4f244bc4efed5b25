// SPDX-License-Identifier: Apache-2.0
// A person's choice of language and theme. They belong to the account; this browser keeps a
// copy for when the account cannot be read.
import { put } from './api.js';
import { field, select } from './dom.js';
import { kLanguages, keepLanguage, languageOf } from './language.js';
import { S } from './words.js';

const key = (who) => `plumb-theme-${who}`;
const themeOf = (who) => {
  try { return localStorage.getItem(key(who)) ?? 'dark'; } catch { return 'dark'; }
};

const keepTheme = (who, theme) => {
  try { localStorage.setItem(key(who), theme); } catch { /* for this page only */ }
};

/// For a screen that nobody logs in at.
export function chooseTheme(who, theme) {
  if (Object.hasOwn(S.themes, theme)) keepTheme(who, theme);
}

/// At a login: what the account chose, perhaps in another browser.
export function adoptPreferences({ user, preferences: chosen }) {
  keepLanguage(user, chosen?.language);
  chooseTheme(user, chosen?.theme);
}

const isSystemLight = matchMedia('(prefers-color-scheme: light)');
let theme = 'dark';

/// The room is dark: dark is the default; "auto" follows the system.
function showTheme(chosen) {
  theme = chosen;
  const isLight = theme === 'light' || (theme === 'auto' && isSystemLight.matches);
  document.documentElement.dataset.theme = isLight ? 'light' : 'dark';
}
isSystemLight.addEventListener('change', () => showTheme(theme));

export function applyTheme(who) { showTheme(themeOf(who)); }

/// Two choices; `changed` is called after each.
export function preferences(who, changed) {
  const names = Object.fromEntries(Object.entries(kLanguages)
    .map(([code, { name }]) => [code, name]));
  const language = select(names, languageOf(who));
  const themes = select(S.themes, themeOf(who));
  // Without a connection the choice holds until the account is asked again.
  const save = () => put('session/preferences', { language: language.value, theme: themes.value })
    .catch(() => {});
  language.addEventListener('change', () => {
    keepLanguage(who, language.value);
    save();
    changed();
  });
  themes.addEventListener('change', () => {
    keepTheme(who, themes.value);
    showTheme(themes.value);
    save();
  });
  return [field(S.language, language), field(S.theme, themes)];
}
