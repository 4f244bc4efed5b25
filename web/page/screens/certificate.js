// SPDX-License-Identifier: Apache-2.0
// Shows and replaces the TLS certificate.
import { get, post, put } from '../api.js';
import { clear, done, field, h, hint, localTime, select } from '../dom.js';
import { authority } from '../set_up/authority.js';
import { signedForm } from '../signed_form.js';
import { S } from '../words.js';

const kMaxChain = 32 * 1024;
const kMaxKey = 16 * 1024;

/// Accepts CR-LF line ends.
async function pemOf(input, max) {
  const [file] = input.files;
  if (file.size > max) throw new Error(S.certificate.tooLarge(file.name));
  return (await file.text()).replaceAll('\r', '');
}

function fileInput() {
  return h('input', { type: 'file', accept: '.pem,.crt,.cer,.key', required: true });
}

/// Asks for the password again: whoever holds the key can impersonate the appliance.
function change(load) {
  const text = S.certificate;
  const chain = fileInput();
  const key = fileInput();
  const files = h('div', {}, field(text.chain, chain), field(text.key, key));
  const choice = select(text.choices, 'given', {
    onchange: () => {
      const given = choice.value === 'given';
      files.hidden = !given;
      for (const input of [chain, key]) input.disabled = !given;
    },
  });
  return signedForm({ class: 'form' }, async (sign) => {
    const body = sign();
    if (choice.value === 'given') {
      body.certificate = await pemOf(chain, kMaxChain);
      body.key = await pemOf(key, kMaxKey);
      await put('certificate', body);
    } else {
      await post('certificate/new', body);
    }
    done(choice.value === 'given' ? text.trial : text.replaced);
    await load();
  }, h('div', { class: 'row' }, h('button', { class: 'danger' }, text.submit)),
  field(text.which, choice), files);
}

export function certificateCard() {
  const text = S.certificate;
  const place = h('section', { class: 'card certificate' });
  const load = async () => {
    const now = await get('certificate', true);
    clear(place, h('h2', {}, text.title), hint(text.hint),
      now.on_trial && h('p', { class: 'caution', role: 'status' }, text.trial),
      now.fingerprint && h('p', {}, `${text.fingerprint}: `, h('code', {}, now.fingerprint)),
      now.subject && h('p', {}, `${text.subject}: ${now.subject}. ${text.validUntil}: `,
        `${localTime(now.valid_until)}.`),
      now.authority && authority(now.authority),
      now.replaceable ? change(load) : h('p', {}, text.fixed));
  };
  load().catch((error) => clear(place, error.message));
  return place;
}
