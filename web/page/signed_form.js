// SPDX-License-Identifier: Apache-2.0
// Forms that a person signs.
import { currentSession } from './api.js';
import { codeInput, field, form, passwordInput } from './dom.js';
import { S } from './words.js';

/// The fields by which a logged-in person proves who they are: the own password, and the code of
/// the authenticator of one who has it. `take` gives both for a request and clears them.
/// @param name  The password's name in the request.
export function ownProof(name = 'password', label = S.result.acceptPassword) {
  const password = passwordInput('current-password', { required: true });
  const code = currentSession()?.second_factor ? codeInput({ required: true }) : null;
  const take = () => {
    const proof = { [name]: password.value, ...(code && { second_factor: code.value.trim() }) };
    password.value = '';
    if (code) code.value = '';
    return proof;
  };
  return {
    take,
    fields: [field(label, password),
      code && field(S.login.secondFactor, code, S.login.secondFactorHint)],
  };
}

/// A form that a person signs by typing their own password again, below the other fields.
/// @param send  Is called with a function that gives the fields of ownProof() and clears them.
/// @param button  The button, or an element that holds it.
export function signedForm(properties, send, button, ...fields) {
  const proof = ownProof();
  (button.matches('button') ? button : button.querySelector('button')).classList.add('signs');
  return form(properties, () => send(proof.take), fields, proof.fields, button);
}
