// SPDX-License-Identifier: Apache-2.0
import { get, loadSession, post, put } from '../api.js';
import {
  action, clear, codeInput, field, form, h, hint, passwordInput, select,
} from '../dom.js';
import { kName, kNewPassword } from '../limits.js';
import { S } from '../words.js';
import { quickLogIn, quickPeople } from './quick_login.js';

const kAskAgain_ms = 5000;

/// Safe mode in which no account can be looked up: no one can log in, and the page says why.
/// Returns when the appliance has recovered.
export async function showFault(main, fault) {
  for (let why = fault; why;) {
    const text = S.login;  // in a language that may be chosen meanwhile
    document.title = `${text.faultTitle} · ${S.product}`;
    clear(main, h('section', { class: 'login card', role: 'alert' }, h('h1', {}, text.faultTitle),
      h('p', {}, text.faultText), h('p', { class: 'caution' }, why)));
    await new Promise((done) => { setTimeout(done, kAskAgain_ms); });
    // While it restarts nothing answers, and what was said last stays.
    why = (await loadSession().catch(() => ({ fault: why }))).fault;
  }
}

/// The people of the shift first, where there are any: a PIN is typed sooner than a password.
export async function showLogin(main, setupRequired, certificate, done) {
  const people = setupRequired ? [] : await quickPeople();
  if (!people.length) {
    showPasswordLogin(main, setupRequired, certificate, done);
    return;
  }
  const place = h('section', { class: 'login card' });
  clear(main, place);
  quickLogIn(place, people, async (entered) => {
    await post('login/pin', entered);
    await loadSession();
    await done();
  }, action(S.login.withPassword,
    async () => showPasswordLogin(main, setupRequired, certificate, done), {}));
}

function showPasswordLogin(main, setupRequired, certificate, done) {
  const text = S.login;
  const name = h('input', {
    name: 'name', autocomplete: 'username', required: true, spellcheck: 'false',
    autocapitalize: 'none', ...kName,
  });
  const password = passwordInput(setupRequired ? 'new-password' : 'current-password',
    { name: 'password', required: true, ...(setupRequired && kNewPassword) });
  const finish = async () => {
    await loadSession();
    await done();
  };
  if (!setupRequired) {
    // Each is shown as soon as the appliance says that it is needed.
    const factor = codeInput();
    const presence = codeInput({ autocomplete: 'off', autocapitalize: 'characters' });
    const asked = (control, ...words) => {
      const place = field(words[0], control, words[1]);
      place.hidden = true;
      return place;
    };
    const factorField = asked(factor, text.secondFactor, text.secondFactorHint);
    const presenceField = asked(presence, text.presence, text.presenceHint);
    const logIn = async () => {
      try {
        await post('login', { name: name.value, password: password.value,
          ...(factor.value && { second_factor: factor.value.trim() }),
          ...(presence.value && { presence: presence.value.trim() }) });
      } catch (error) {
        const place = error.body?.second_factor_required ? factorField
          : error.status === 429 ? presenceField : null;
        if (!place) throw error;
        const wasShown = !place.hidden;
        place.hidden = false;
        place.querySelector('input').focus();
        // Being asked for the code the first time is not an error.
        if (place === factorField && !wasShown) return;
        throw error;
      }
      await finish();
    };
    clear(main, h('section', { class: 'login card' }, h('h1', {}, text.title),
      form({ class: 'form' }, logIn, field(text.name, name), field(text.password, password),
        factorField, presenceField, h('button', { class: 'primary' }, text.submit))));
    name.focus();
    return;
  }
  const code = h('input', {
    required: true, maxlength: 16, placeholder: text.codeHint, spellcheck: 'false',
    autocomplete: 'off', autocapitalize: 'characters', class: 'code',
  });
  code.addEventListener('input', () => { code.value = code.value.toUpperCase(); });
  const repeat = passwordInput('new-password', { required: true });
  const retention = select(text.retentions, '0');
  clear(main, h('section', { class: 'login card' }, h('h1', {}, text.setupTitle),
    h('p', {}, text.setupText),
    certificate && hint(text.certificate, ' ',
      h('code', { class: 'fingerprint' }, certificate)),
    form({ class: 'form' }, async () => {
      if (password.value !== repeat.value) throw new Error(text.differ);
      await post('setup', { code: code.value.trim(), name: name.value, password: password.value });
      await loadSession();
      if (retention.value !== '0') {
        await put('settings', {
          ...await get('settings'), retention_days: Number(retention.value),
        });
      }
      await done();
    }, field(text.code, code), field(text.name, name, S.users.nameHint),
    field(text.password, password, text.passwordHint), field(text.repeat, repeat),
    field(text.retention, retention, text.retentionHint),
    h('button', { class: 'primary' }, text.setupSubmit))));
  code.focus();
}

/// Somebody else chose the password: the person takes one of their own before anything else.
export function showFirstPassword(main, user, done) {
  const text = S.login;
  const name = h('input', { name: 'name', autocomplete: 'username', readonly: true, value: user });
  const old = passwordInput('current-password', { required: true });
  const fresh = passwordInput('new-password', { required: true, ...kNewPassword });
  const repeat = passwordInput('new-password', { required: true });
  clear(main, h('section', { class: 'login card' }, h('h1', {}, text.firstTitle),
    h('p', {}, text.firstText),
    form({ class: 'form' }, async () => {
      if (fresh.value !== repeat.value) throw new Error(text.differ);
      await post('session/password', { old_password: old.value, password: fresh.value });
      await loadSession();
      await done();
    }, field(text.name, name), field(text.firstOld, old),
    field(text.firstNew, fresh, text.passwordHint), field(text.repeat, repeat),
    h('button', { class: 'primary' }, text.firstSubmit))));
  old.focus();
}
