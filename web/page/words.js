// SPDX-License-Identifier: Apache-2.0
// Messages and texts in the chosen language: what algo/base/message.cpp does with the same
// catalogues (web/words), which catalogue_test.mjs compares with it.

/// The texts of the section "page", as nested in the catalogue: a string, or a function of the
/// text's arguments in their order in English. Screens read S when they draw: after another
/// language was chosen they must be drawn again.
export const S = {};

const kPlain = new Set(['text', 'int', 'words', 'ints', 'texts', 'list']);
let catalogue = { language: {}, texts: {}, arguments: {} };

/// A message that cannot be said in this language: its id or one of its arguments is missing.
class Unsayable extends Error {}

/// As %.Nf of C: a tie goes to the even digit, where toFixed() rounds it up.
function rounded(value, decimals) {
  const exact = value.toFixed(60);
  const end = exact.length - 60 + decimals;
  const cut = exact.slice(0, end).replace(/\.$/, '');
  const isEvenTie = /^50*$/.test(exact.slice(end)) && Number(cut.at(-1)) % 2 === 0;
  return isEvenTie ? cut : value.toFixed(decimals);
}

/// As %g of C: six digits, without zeros at the end.
function general(value) {
  const [digits, power] = value.toExponential(5).split('e');
  const exponent = Number(power);
  const trimmed = (number) => (number.includes('.') ? number.replace(/\.?0+$/, '') : number);
  if (exponent >= -4 && exponent < 6) return trimmed(rounded(value, 5 - exponent));
  return `${trimmed(digits)}e${power[0]}${power.slice(1).padStart(2, '0')}`;
}

/// UNIT[+][.DECIMALS][!]: with its sign, with fixed decimals, without the unit.
function quantity({ value: stated, unit }, type) {
  const value = stated ?? NaN;
  const decimals = /\.(\d)/.exec(type)?.[1];
  const size = Math.abs(value);
  const digits = Number.isNaN(size) ? 'nan' : size === Infinity ? 'inf'
    : decimals === undefined ? general(size) : rounded(size, Number(decimals));
  const sign = value < 0 || Object.is(value, -0) ? '-' : type.includes('+') ? '+' : '';
  const number = `${sign}${digits}`.replace('.', catalogue.language.decimal);
  if (!unit || type.includes('!')) return number;
  return (catalogue.texts[`unit.${unit}`] ?? `{value} ${unit}`).replace('{value}', () => number);
}

function formatted(value, type) {
  if (Array.isArray(value)) return value.map((one) => formatted(one, type)).join(', ');
  if (typeof value !== 'object') return String(value);
  return value.id === undefined ? quantity(value, type) : written(value);
}

/// Index behind the group in braces that begins at `start`.
function groupEnd(text, start) {
  let depth = 0;
  for (let i = start; i < text.length; ++i) {
    if (text[i] === '{') ++depth;
    if (text[i] === '}' && --depth === 0) return i + 1;
  }
  throw new Unsayable(text);
}

/// The text of the case that fits, in "one {...} other {...}".
function caseOf(cases, key) {
  let other = '';
  for (let open = cases.indexOf('{'), at = 0; open >= 0; open = cases.indexOf('{', at)) {
    const name = cases.slice(at, open).trim();
    at = groupEnd(cases, open);
    const text = cases.slice(open + 1, at - 1);
    if (name === key) return text;
    if (name === 'other') other = text;
  }
  return other;
}

const isOne = (count) =>
  count === 1 || (count === 0 && catalogue.language.plural === 'zero_is_one');

/// What stands in braces: NAME:TYPE, or NAME:TYPE, plural or select, and the cases.
function placeholder(inside, values) {
  const [, name, type, kind, cases] =
    /^(\w+):([^,]*)(?:, (plural|select), ([^]*))?$/.exec(inside) ?? [];
  const value = values[name];
  if (value === undefined || value === null) throw new Unsayable(inside);
  if (!kind) return formatted(value, type);
  if (kind === 'plural') {
    return filled(caseOf(cases, isOne(value) ? 'one' : 'other'), values, formatted(value, type));
  }
  return filled(caseOf(cases, value.id?.split('.').at(-1) ?? String(value)), values);
}

/// @param count  What "#" stands for; null where it is itself.
function filled(text, values, count = null) {
  let said = '';
  for (let i = 0; i < text.length;) {
    if (text[i] === '{') {
      const end = groupEnd(text, i);
      said += placeholder(text.slice(i + 1, end - 1), values);
      i = end;
    } else said += text[i] === '#' && count !== null ? (++i, count) : text[i++];
  }
  return said;
}

function written({ id, arguments: values }) {
  const text = Object.hasOwn(catalogue.texts, id) ? catalogue.texts[id] : null;
  if (text === null) throw new Unsayable(id);
  return filled(text, values ?? {});
}

/// The message, {id, arguments}, in this language. Without a message (in records of 0.2.0), and
/// where this version does not know it, it is the English sentence that was sent beside it.
export function textOf(message, english) {
  if (!message?.id) return english;
  try {
    return written(message);
  } catch (error) {
    if (error instanceof Unsayable) return english;
    throw error;
  }
}

/// The sentence `from[key]` by the message beside it, and a list of them, such as "reasons".
export const said = (from, key) => textOf(from?.[`${key}_message`], from?.[key]);
export const saidEach = (from, key) => (from?.[key] ?? []).map((english, i) =>
  textOf(from[`${key.replace(/s$/, '')}_messages`]?.[i], english));

/// The word for an identifier, such as "scan.start"; what is not known stays as it is.
export function wordOf(words, stored) {
  const key = `${stored}`.replaceAll(/[. ]/g, '_');
  return Object.hasOwn(words, key) ? words[key] : stored;
}

/// A text of the page, or the function that fills it in.
function pageText(text, types) {
  if (!types) return text;
  const value = (given, unit) => (kPlain.has(unit) ? given ?? S.none
    : { value: given, unit: unit === 'number' ? '' : unit });
  return (...given) => filled(text, Object.fromEntries(Object.entries(types).map(
    ([name, type], i) => [name, value(given[i], type.split(/[+.!]/)[0])])));
}

let tellWords;
/// Done once there are words. What is asked of the appliance before then waits with its error.
export const haveWords = new Promise((done) => { tellWords = done; });

/// @param chosen  What web/words/generate.py made of the language's file for the page.
export function useCatalogue(chosen) {
  catalogue = chosen;
  const { name, locale, decimal } = chosen.language;
  Object.assign(S, { languageName: name, locale, decimal });
  for (const [id, text] of Object.entries(chosen.texts)) {
    const path = id.split('.');
    if (path.shift() !== 'page') continue;
    const last = path.pop();
    let node = S;
    for (const part of path) node = node[part] ??= {};
    node[last] = pageText(text, chosen.arguments[id]);
  }
  tellWords();
}
