import { currentSession, get, may, post, put } from '../api.js';
import { checkbox, clear, done, field, form, h, localTime, select, table, warn } from '../dom.js';
import { S } from '../strings.js';

const password = (properties) => h('input', { type: 'password', autocomplete: 'new-password', maxlength: 128, ...properties });

function ownPassword() {
  const text = S.users;
  const old = password({ required: true, autocomplete: 'current-password' });
  const fresh = password({ required: true, minlength: 10 });
  return h('section', { class: 'card' }, h('h2', {}, text.own), form({ class: 'form inline' }, async () => {
    await post('session/password', { old_password: old.value, password: fresh.value });
    old.value = fresh.value = '';
    done(S.saved);
  }, field(text.oldPassword, old), field(text.password, fresh, S.login.passwordHint), h('button', {}, text.changeOwn)));
}

function userRow(user, reload) {
  const text = S.users;
  const role = select(S.roles, user.role, { 'aria-label': `${text.role}, ${user.name}` });
  const disabled = checkbox(text.disable, user.disabled, {});
  const fresh = password({ minlength: 10 });
  return h('tr', {}, h('td', {}, user.name), h('td', {}, S.roles[user.role]), h('td', {}, user.disabled ? text.disabled : `✓ ${text.active}`), h('td', {}, localTime(user.created_at)),
    h('td', {}, h('details', {}, h('summary', { 'aria-label': `${text.change} ${user.name}` }, text.change), form({ class: 'form' }, async () => {
      // Only what this person changed: the rest may have been changed by somebody else since it was read.
      const changes = {};
      if (role.value !== user.role) changes.role = role.value;
      if (disabled.box.checked !== user.disabled) changes.disabled = disabled.box.checked;
      if (fresh.value) changes.password = fresh.value;
      if (!Object.keys(changes).length) throw new Error(text.unchanged);
      await put(`users/${user.name}`, changes);
      done(S.saved);
      if (user.name !== currentSession()?.user) await reload();
    }, field(text.role, role), disabled.element, field(text.newPassword, fresh), h('button', { class: 'primary' }, S.save)))));
}

export async function showUsers(place) {
  const text = S.users;
  const list = h('div', {});
  const name = h('input', { required: true, maxlength: 32, autocomplete: 'off', spellcheck: 'false', autocapitalize: 'none' });
  const role = select(S.roles, 'technician', {});
  const fresh = password({ required: true, minlength: 10 });
  const load = async () => {
    const { users } = await get('users');
    clear(list, table([text.name, text.role, text.state, S.patients.added, S.action], users.map((user) => userRow(user, () => load())), text.title));
  };
  clear(place, h('h1', {}, text.title),
    may('users') && h('section', { class: 'card' }, list),
    may('users') && h('section', { class: 'card' }, h('h2', {}, text.add), form({ class: 'form inline' }, async () => {
      await post('users', { name: name.value.trim(), role: role.value, password: fresh.value });
      name.value = fresh.value = '';
      done(S.saved);
      await load();
    }, field(text.name, name, text.nameHint), field(text.role, role), field(text.password, fresh, S.login.passwordHint), h('button', { class: 'primary' }, text.submit))),
    ownPassword());
  if (may('users')) await load().catch((error) => warn(error.message));
}
