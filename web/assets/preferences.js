// What a person chooses for this browser: language and theme.
import { field, select } from './dom.js';
import { chooseLanguage, kLanguages, languageOf, S } from './strings.js';

const key = (who) => `plumb-theme-${who}`;
const themeOf = (who) => {
  try { return localStorage.getItem(key(who)) ?? 'dark'; } catch { return 'dark'; }
};

/// The room is dark: dark is the default; "auto" follows the system.
export function applyTheme(who) { document.documentElement.dataset.theme = themeOf(who); }

/// Two choices; `changed` is called after each.
export function preferences(who, changed) {
  const names = Object.fromEntries(Object.entries(kLanguages)
    .map(([name, texts]) => [name, texts.languageName]));
  const language = select(names, languageOf(who));
  language.addEventListener('change', () => {
    chooseLanguage(who, language.value);
    changed();
  });
  const theme = select(S.themes, themeOf(who));
  theme.addEventListener('change', () => {
    try { localStorage.setItem(key(who), theme.value); } catch { /* for this page only */ }
    document.documentElement.dataset.theme = theme.value;
  });
  return [field(S.language, language), field(S.theme, theme)];
}
