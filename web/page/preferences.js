// SPDX-License-Identifier: Apache-2.0
// A person's choice of language and theme. They belong to the account; this browser keeps a
// copy for when the account cannot be read.
import { currentSession, put } from './api.js';
import { clear, field, h, select } from './dom.js';
import { kLanguages, kNobody, keepLanguage, languageOf } from './language.js';
import { S } from './words.js';

const kThemes = ['auto', 'dark', 'light'];
const key = (who) => `plumb-theme-${who}`;
const themeOf = (who) => {
  try {
    return localStorage.getItem(key(who)) ?? localStorage.getItem(key(kNobody)) ?? 'dark';
  } catch {
    return 'dark';
  }
};

const keepTheme = (who, theme) => {
  try { localStorage.setItem(key(who), theme); } catch { /* for this page only */ }
};

/// For a screen that nobody logs in at.
export function chooseTheme(who, theme) {
  if (kThemes.includes(theme)) keepTheme(who, theme);
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
  const themes = select(
    Object.fromEntries(kThemes.map((one) => [one, S.themes[one]])), themeOf(who));
  // Without a connection the choice holds until the account is asked again.
  const save = () => currentSession()
    && put('session/preferences', { language: language.value, theme: themes.value })
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

/// The same choices behind one small button, for the bar above every screen.
export function looks(who) {
  const panel = h('div', { class: 'card looks-panel' });
  const again = () => window.dispatchEvent(new Event('plumb-language'));
  const place = h('details', { class: 'looks' },
    h('summary', {}, h('span', { class: 'visually-hidden' }, S.languageAndTheme),
      h('span', { 'aria-hidden': 'true' }, `${document.documentElement.lang.toUpperCase()} ◐`)),
    panel);
  // Nothing in it while it is closed: My preferences has fields of the same names.
  place.addEventListener('toggle', () => clear(panel, place.open && preferences(who, again)));
  place.addEventListener('keydown', ({ key: pressed }) => {
    if (pressed !== 'Escape' || !place.open) return;
    place.open = false;
    place.querySelector('summary').focus();
  });
  return place;
}
document.addEventListener('pointerdown', ({ target }) => {
  const open = document.querySelector('.looks[open]');
  if (open && !open.contains(target)) open.open = false;
});
