// What a person chooses: language and theme. They belong to the account; this browser keeps a
// copy for when the account cannot be read.
import { put } from './api.js';
import { field, select } from './dom.js';
import { chooseLanguage, kLanguages, languageOf, S } from './strings.js';

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
  if (kLanguages[chosen?.language]) chooseLanguage(user, chosen.language);
  chooseTheme(user, chosen?.theme);
}

/// The room is dark: dark is the default; "auto" follows the system.
export function applyTheme(who) { document.documentElement.dataset.theme = themeOf(who); }

/// Two choices; `changed` is called after each.
export function preferences(who, changed) {
  const names = Object.fromEntries(Object.entries(kLanguages)
    .map(([name, texts]) => [name, texts.languageName]));
  const language = select(names, languageOf(who));
  const theme = select(S.themes, themeOf(who));
  // Without a connection the choice holds until the account is asked again.
  const save = () => put('session/preferences', { language: language.value, theme: theme.value })
    .catch(() => {});
  language.addEventListener('change', () => {
    chooseLanguage(who, language.value);
    save();
    changed();
  });
  theme.addEventListener('change', () => {
    keepTheme(who, theme.value);
    document.documentElement.dataset.theme = theme.value;
    save();
  });
  return [field(S.language, language), field(S.theme, theme)];
}
