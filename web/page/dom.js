// SPDX-License-Identifier: Apache-2.0
// Elements without markup in strings: what comes from outside is always text.
import { kPassword } from './limits.js';
import { S } from './words.js';

const kSvg = 'http://www.w3.org/2000/svg';

function fill(element, properties, children) {
  for (const [name, value] of Object.entries(properties ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name === 'value') element.value = value;
    else element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children.flat(3).filter(isShown));
  return element;
}

const isShown = (child) => child !== null && child !== undefined && child !== false;
export const h = (tag, properties, ...children) =>
  fill(document.createElement(tag), properties, children);
export const svg = (tag, properties, ...children) =>
  fill(document.createElementNS(kSvg, tag), properties, children);

export const clear = (element, ...children) => {
  element.replaceChildren(...children.flat(3).filter(isShown));
  return element;
};

export const hint = (...words) => h('p', { class: 'hint' }, words);
/// A titled part of a screen.
export const card = (title, ...content) =>
  h('section', { class: 'card' }, h('h2', {}, title), content);
/// A row of a table. A cell that has a class or is a heading is made by the caller.
export const row = (...cells) => h('tr', {}, cells.map((cell) =>
  (cell instanceof HTMLTableCellElement ? cell : h('td', {}, cell))));
export const rowHead = (text) => h('th', { scope: 'row' }, text);

let counter = 0;
/// A label above its control, with an optional hint that belongs to it.
export function field(label, control, words) {
  control.id ||= `f${++counter}`;
  const hintId = `${control.id}h`;
  if (words) control.setAttribute('aria-describedby', hintId);
  return h('div', { class: 'field' }, h('label', { for: control.id }, label), control,
    words && h('p', { class: 'hint', id: hintId }, words));
}

/// Fills in a number that is stored. It is accepted as it is, also beyond the bounds or between the
/// steps of what people enter: a file may have set it, and it must not hold up everything else.
export function fillNumber(input, value, { min, max, step }) {
  const isOutside = value < min || value > max;
  Object.assign(input, {
    min: isOutside ? Math.min(min, value) : min,
    max: isOutside ? Math.max(max, value) : max,
    step: isOutside ? 'any' : step,
    value: value ?? '',
  });
  if (input.validity.stepMismatch) input.step = 'any';
  return input;
}

export const checkbox = (label, checked, properties) => {
  const box = h('input', { type: 'checkbox', ...properties });
  box.checked = checked;
  return { box, element: h('label', { class: 'check' }, box, ' ', label) };
};

export const select = (choices, value, properties) => {
  const element = h('select', properties,
    ...Object.entries(choices).map(([key, text]) => h('option', { value: key }, text)));
  element.value = value;
  return element;
};

const kToast_ms = 4000;
let toastTimer = 0;
/// Tells screen readers; `seen` shows it for a while too.
export function say(text, seen = false) {
  const place = document.getElementById('status');
  clearTimeout(toastTimer);
  place.textContent = text;
  place.className = seen ? 'toast' : 'visually-hidden';
  if (seen) toastTimer = setTimeout(() => say(''), kToast_ms);
}
/// Says that what a person just did has worked.
export const done = (text) => say(text, true);

export function warn(what) {
  const place = document.getElementById('alert');
  // A request that was under way when the connection ended does not hide that it has ended.
  const isLost = what === S.noAnswer && document.body.classList.contains('disconnected');
  const text = isLost ? S.offline : what;
  if (text) say('');  // what worked before is not shown beside what did not
  const close = () => h('button', {
    class: 'quiet', onclick: () => warn(''), 'aria-label': S.close,
  }, '✕');
  clear(place, text ? h('p', { class: 'alert' },
    h('span', {}, text[0].toUpperCase() + text.slice(1)), close()) : '');
}

/// Removes that warning if it is the one shown, because its cause is over.
export function forgetWarning(text) {
  const shown = document.querySelector('#alert .alert span');
  if (shown?.textContent === text) warn('');
}

/// A form that calls `submit` with its button off meanwhile.
export function form(properties, submit, ...children) {
  const element = h('form', { ...properties, novalidate: false }, ...children);
  const button = element.querySelector('button:not([type=button])');
  element.addEventListener('submit', (event) => {
    event.preventDefault();
    if (button) work(button, submit);
  });
  return element;
}

/// A button that is off says so, but can be focused: one that is `disabled` loses the focus, and
/// people who work with the keyboard would have to start again.
export function enable(button, enabled) {
  button.dataset.off = enabled ? '' : 'yes';
  mark(button);
}
const isOff = (button) => button.dataset.off === 'yes' || button.dataset.busy === 'yes';
function mark(button) {
  if (isOff(button)) button.setAttribute('aria-disabled', 'true');
  else button.removeAttribute('aria-disabled');
}

/// One thing at a time for each button; errors go to the alert region.
async function work(button, task) {
  if (isOff(button)) return;
  button.dataset.busy = 'yes';
  mark(button);
  try {
    warn('');
    await task();
  } catch (error) {
    warn(error.message);
  } finally {
    button.dataset.busy = '';
    mark(button);
  }
}

export const passwordInput = (autocomplete, properties) => h('input', {
  type: 'password', autocomplete, ...kPassword, ...properties,
});

export const codeInput = (properties) => h('input', {
  autocomplete: 'one-time-code', spellcheck: 'false', maxlength: 32, class: 'code', ...properties,
});

export function action(label, task, properties) {
  const button = h('button', { type: 'button', ...properties }, label);
  button.addEventListener('click', () => work(button, task));
  return button;
}

/// Identifies a control after it was built again.
const nameOf = (control) => [control.tagName, control.getAttribute('href'),
  control.getAttribute('aria-label') ?? control.textContent].join(' ');

/// Changes what is in `element`; the focus stays on the same control, where there still is one.
export function keepFocus(element, change) {
  const focused = element.contains(document.activeElement) ? nameOf(document.activeElement) : null;
  change();
  if (focused === null || element.contains(document.activeElement)) return;
  [...element.querySelectorAll('a, button, input, select, summary, [tabindex]')]
    .find((control) => nameOf(control) === focused)?.focus({ preventScroll: true });
}

const drawn = new WeakMap();
/// As clear(), but what is there stays when nothing differs: neither the focus nor what a reader
/// reads is taken away. A child may be there already: copies are compared, so that it stays. It
/// has to be a child itself: within a new one it would be gone together with that.
export function redraw(element, ...children) {
  const all = children.flat(Infinity);
  const copies = all.map((child) => (child instanceof Node ? child.cloneNode(true) : child));
  const html = clear(element.cloneNode(false), ...copies).innerHTML;
  if (drawn.get(element) === html && element.hasChildNodes()) return;
  drawn.set(element, html);
  keepFocus(element, () => clear(element, ...all));
}

export function table(headings, rows, caption) {
  // A narrow window shows each cell with its heading, and not what is empty.
  for (const line of rows.flat(2).filter(isShown)) {
    [...line.children].forEach((cell, i) => {
      cell.dataset.label = headings[i] ?? '';
      if (['', S.none].includes(cell.textContent) && !cell.children.length) cell.dataset.empty = '';
    });
  }
  return h('div', { class: 'scroll', tabindex: '0', role: 'region', 'aria-label': caption },
    h('table', {}, h('caption', { class: 'visually-hidden' }, caption),
      h('thead', {}, h('tr', {}, headings.map((text) => h('th', { scope: 'col' }, text)))),
      h('tbody', {}, rows)));
}

/// The direction of an arrow key, x right, y up; nothing for another key.
export const arrowOf = ({ key }) => ({
  ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
}[key]);

/// Lets the browser save what is at the address as a file.
export const saveFrom = (href, name) => h('a', { href, download: name }).click();
export function saveBlob(blob, name) {
  const url = URL.createObjectURL(blob);
  saveFrom(url, name);
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

/// With the decimal sign of the language, and a minus that is one.
export const fixed = (value, digits) =>
  value.toFixed(digits).replace('-', '−').replace('.', S.decimal);

const kMinute = {
  year: 'numeric', month: 'short', day: '2-digit', hour: '2-digit', minute: '2-digit',
};
export const localTime = (iso) => (iso ? new Date(iso).toLocaleString(S.locale, kMinute) : '–');
/// When something was signed or accepted: with its time zone, as in the reports, which are written
/// in the appliance's zone and not in the browser's.
export const signedTime = (iso) => (iso
  ? new Date(iso).toLocaleString(S.locale, { ...kMinute, timeZoneName: 'short' }) : '–');
export const localDate = (iso) => (iso ? new Date(iso).toLocaleDateString(S.locale, {
  year: 'numeric', month: 'short', day: '2-digit',
}) : S.none);
export const localDay = (iso) => (iso ? new Date(iso).toLocaleDateString(S.locale, {
  month: 'short', day: '2-digit',
}) : '–');
