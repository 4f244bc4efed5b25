// Elements without markup in strings: what comes from outside is always text.
const kSvg = 'http://www.w3.org/2000/svg';

function fill(element, properties, children) {
  for (const [name, value] of Object.entries(properties ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name === 'value') element.value = value;
    else element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children.flat(3).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export const h = (tag, properties, ...children) => fill(document.createElement(tag), properties, children);
export const svg = (tag, properties, ...children) => fill(document.createElementNS(kSvg, tag), properties, children);

export const clear = (element, ...children) => {
  element.replaceChildren(...children.flat(3).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
};

let counter = 0;
/// A label above its control, with an optional hint that belongs to it.
export function field(label, control, hint) {
  control.id ||= `f${++counter}`;
  const hintId = `${control.id}h`;
  if (hint) control.setAttribute('aria-describedby', hintId);
  return h('div', { class: 'field' }, h('label', { for: control.id }, label), control, hint && h('p', { class: 'hint', id: hintId }, hint));
}

export const checkbox = (label, checked, properties) => {
  const box = h('input', { type: 'checkbox', ...properties });
  box.checked = checked;
  return { box, element: h('label', { class: 'check' }, box, ' ', label) };
};

export const select = (choices, value, properties) => {
  const element = h('select', properties, ...Object.entries(choices).map(([key, text]) => h('option', { value: key }, text)));
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
/// What a person just did has worked.
export const done = (text) => say(text, true);

export function warn(text) {
  const place = document.getElementById('alert');
  clear(place, text ? h('p', { class: 'alert' }, h('span', {}, text), h('button', { class: 'quiet', onclick: () => warn(''), 'aria-label': 'Close' }, '✕')) : '');
}

/// A form that calls `submit` with its button disabled meanwhile; errors go to the alert region.
export function form(properties, submit, ...children) {
  const element = h('form', { ...properties, novalidate: false }, ...children);
  element.addEventListener('submit', async (event) => {
    event.preventDefault();
    const button = element.querySelector('button:not([type=button])');
    if (button) button.disabled = true;
    try {
      warn('');
      await submit();
    } catch (error) {
      warn(error.message);
    } finally {
      if (button) button.disabled = false;
    }
  });
  return element;
}

export function action(label, work, properties) {
  const button = h('button', { type: 'button', ...properties }, label);
  button.addEventListener('click', async () => {
    button.disabled = true;
    try {
      warn('');
      await work();
    } catch (error) {
      warn(error.message);
    } finally {
      button.disabled = false;
    }
  });
  return button;
}

export function table(headings, rows, caption) {
  return h('div', { class: 'scroll', tabindex: '0', role: 'region', 'aria-label': caption },
    h('table', {}, h('caption', { class: 'visually-hidden' }, caption), h('thead', {}, h('tr', {}, headings.map((text) => h('th', { scope: 'col' }, text)))), h('tbody', {}, rows)));
}

export const localTime = (iso) => (iso ? new Date(iso).toLocaleString('en-GB', { year: 'numeric', month: 'short', day: '2-digit', hour: '2-digit', minute: '2-digit' }) : '–');
