import { loadSession, post } from '../api.js';
import { clear, field, form, h } from '../dom.js';
import { S } from '../strings.js';

export function showLogin(main, setupRequired, done) {
  const text = S.login;
  const name = h('input', { name: 'name', autocomplete: 'username', required: true, maxlength: 32, spellcheck: 'false', autocapitalize: 'none' });
  const password = h('input', { name: 'password', type: 'password', required: true, maxlength: 128, autocomplete: setupRequired ? 'new-password' : 'current-password', minlength: setupRequired ? 10 : undefined });
  const finish = async () => {
    await loadSession();
    await done();
  };
  if (!setupRequired) {
    clear(main, h('section', { class: 'login card' }, h('h1', {}, text.title),
      form({ class: 'form' }, async () => {
        await post('login', { name: name.value, password: password.value });
        await finish();
      }, field(text.name, name), field(text.password, password), h('button', { class: 'primary' }, text.submit))));
    name.focus();
    return;
  }
  const code = h('input', { required: true, maxlength: 9, placeholder: text.codeHint, spellcheck: 'false', autocomplete: 'off', autocapitalize: 'characters', class: 'code' });
  code.addEventListener('input', () => { code.value = code.value.toUpperCase(); });
  const repeat = h('input', { type: 'password', required: true, maxlength: 128, autocomplete: 'new-password' });
  clear(main, h('section', { class: 'login card' }, h('h1', {}, text.setupTitle), h('p', {}, text.setupText),
    form({ class: 'form' }, async () => {
      if (password.value !== repeat.value) throw new Error(text.differ);
      await post('setup', { code: code.value.trim(), name: name.value, password: password.value });
      await finish();
    }, field(text.code, code), field(text.name, name, S.users.nameHint), field(text.password, password, text.passwordHint), field(text.repeat, repeat), h('button', { class: 'primary' }, text.setupSubmit))));
  code.focus();
}
