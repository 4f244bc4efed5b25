// SPDX-License-Identifier: Apache-2.0
// What a form does not accept is said at its field, in the language of the page: the bubbles of
// browsers speak that of the browser, and are gone after some seconds.
import { h } from './dom.js';
import { S } from './words.js';

let counter = 0;
const written = (limit) => limit.replace('.', S.decimal);

function wordsFor({ validity, dataset, min, max, minLength, step }) {
  const text = S.invalid;
  if (validity.badInput) return text.number;  // its value counts as missing, too
  if (validity.valueMissing) return text.missing;
  if (validity.tooShort) return text.short(minLength);
  if (validity.patternMismatch && dataset.code !== undefined) return text.code;
  if (validity.stepMismatch) return text.step(written(step || '1'));
  return min && max ? text.range(written(min), written(max)) : text.other;
}

const errorOf = (control) => document.getElementById(`${control.id}e`);

function forget(control) {
  const error = control.id && errorOf(control);
  if (!error) return;
  error.remove();
  control.removeAttribute('aria-invalid');
  const hints = control.getAttribute('aria-describedby').split(' ').filter((id) => id !== error.id);
  if (hints.length) control.setAttribute('aria-describedby', hints.join(' '));
  else control.removeAttribute('aria-describedby');
}

/// Called once for the page.
export function tellFieldErrors() {
  let hasFocused = false;  // the first field of a form that is not accepted
  document.addEventListener('invalid', (event) => {
    event.preventDefault();
    const { target: control } = event;
    forget(control);
    control.id ||= `v${++counter}`;
    const error = h('p', { class: 'field-error', id: `${control.id}e` }, wordsFor(control));
    (control.closest('.field, .check') ?? control.parentElement).append(error);
    control.setAttribute('aria-invalid', 'true');
    control.setAttribute('aria-describedby',
      [error.id, control.getAttribute('aria-describedby')].filter(Boolean).join(' '));
    if (hasFocused) return;
    hasFocused = true;
    control.focus();
    control.scrollIntoView({ block: 'nearest' });
    setTimeout(() => { hasFocused = false; });
  }, true);
  document.addEventListener('input', ({ target }) => forget(target), true);
  // What another control asks for no longer, or is accepted after all. A listener of the screen
  // may decide that, so that this one comes after it.
  const forgetAccepted = () => document.querySelectorAll('[aria-invalid]').forEach((control) => {
    if (!control.willValidate || control.validity.valid) forget(control);
  });
  for (const event of ['change', 'submit']) document.addEventListener(event, forgetAccepted);
}
