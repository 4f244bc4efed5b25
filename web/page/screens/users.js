// SPDX-License-Identifier: Apache-2.0
// Accounts, one's own password and preferences, and the screens in the room.
import { currentSession, get, may, post, put, removeFor } from '../api.js';
import {
  card, checkbox, clear, done, field, form, h, hint, localTime, passwordInput, row, select, table,
  warn,
} from '../dom.js';
import { kName, kNewPassword } from '../limits.js';
import { preferences } from '../preferences.js';
import { ownProof, signedForm } from '../signed_form.js';
import { S } from '../words.js';
import { ownAuthenticator, ownPin, ownSessions } from './own_account.js';

const accountRoles = () => Object.fromEntries(
  Object.entries(S.roles).filter(([name]) => name !== 'display'));

function ownPreferences() {
  const again = () => window.dispatchEvent(new Event('plumb-language'));
  return card(S.users.preferences,
    h('div', { class: 'form inline' }, preferences(currentSession().user, again)));
}

/// Screens are paired by the code that they show.
function displays() {
  const text = S.displays;
  const code = h('input', {
    required: true, maxlength: 16, autocomplete: 'off', spellcheck: 'false', class: 'code',
  });
  const name = h('input', { required: true, autocomplete: 'off', ...kName });
  const list = h('div', {});
  const load = async () => {
    const { displays: paired } = await get('displays');
    const rows = paired.map((one) => row(one.name, localTime(one.paired_at), one.paired_by,
      h('details', {}, h('summary', { 'aria-label': `${text.remove} ${one.name}` }, text.remove),
        signedForm({ class: 'form' }, async (sign) => {
          await removeFor(`displays/${one.id}`, sign());
          await load();
        }, h('button', { class: 'danger' }, text.remove)))));
    clear(list, rows.length ? table([text.name, text.when, text.by, S.action], rows, text.title)
      : hint(text.none));
  };
  load().catch((error) => warn(error.message));
  return card(text.title,
    hint(text.hint), list, signedForm({ class: 'form inline' }, async (sign) => {
      await post('displays', { code: code.value.trim(), name: name.value.trim(), ...sign() });
      code.value = name.value = '';
      done(text.paired);
      await load();
    }, h('button', {}, text.pair), field(text.code, code), field(text.name, name)));
}

function ownPassword() {
  const text = S.users;
  if (currentSession().in_directory) return card(text.own, hint(text.ownInDirectory));
  const old = ownProof('old_password', text.oldPassword);
  const fresh = passwordInput('new-password', { required: true, ...kNewPassword });
  const change = async () => {
    await post('session/password', { ...old.take(), password: fresh.value });
    fresh.value = '';
    done(S.saved);
  };
  return card(text.own,
    form({ class: 'form inline' }, change, old.fields,
      field(text.password, fresh, S.login.passwordHint), h('button', {}, text.changeOwn)));
}

/// @param {boolean} hasDirectory  The unit asks the clinic's directory.
function userRow(user, hasDirectory, reload) {
  const text = S.users;
  const isKnownThere = user.in_directory && hasDirectory;
  const role = select(accountRoles(), user.role, { 'aria-label': `${text.role}, ${user.name}` });
  const disabled = checkbox(text.disable, user.disabled, {});
  const fresh = passwordInput('new-password', kNewPassword);
  const withoutFactor = checkbox(text.removeSecondFactor, false, {});
  const proof = ownProof('own_password');
  const change = async () => {
    // Only what this person changed: somebody else may have changed the rest since it was read.
    const changes = {};
    if (role.value !== user.role) changes.role = role.value;
    if (disabled.box.checked !== user.disabled) changes.disabled = disabled.box.checked;
    if (fresh.value) changes.password = fresh.value;
    if (withoutFactor.box.checked) changes.remove_second_factor = true;
    if (!Object.keys(changes).length) throw new Error(text.unchanged);
    await put(`users/${user.name}`, { ...changes, ...proof.take() });
    done(S.saved);
    if (user.name !== currentSession()?.user) await reload();
  };
  const editor = h('details', {},
    h('summary', { 'aria-label': `${text.change} ${user.name}` }, text.change),
    form({ class: 'form' }, change, !isKnownThere && field(text.role, role), disabled.element,
      !isKnownThere && user.name !== currentSession()?.user && field(text.newPassword, fresh),
      user.second_factor && withoutFactor.element, proof.fields,
      h('button', { class: 'primary' }, S.save)));
  const roleWords = [S.roles[user.role],
    user.in_directory && (hasDirectory ? text.inDirectory : text.withoutDirectory),
    user.second_factor && text.hasSecondFactor].filter(Boolean);
  return row(user.name, roleWords.join(', '), user.disabled ? text.disabled : `✓ ${text.active}`,
    localTime(user.created_at), editor);
}

export async function showUsers(place) {
  const text = S.users;
  const list = h('div', {});
  const name = h('input', {
    required: true, autocomplete: 'off', spellcheck: 'false', autocapitalize: 'none',
    ...kName,
  });
  const role = select(accountRoles(), 'technician', {});
  const fresh = passwordInput('new-password', { required: true, ...kNewPassword });
  const proof = ownProof('own_password');
  const load = async () => {
    const { users, directory } = await get('users');
    const heads = [text.name, text.role, text.state, S.patients.added, S.action];
    clear(list, table(heads, users.map((user) => userRow(user, directory, load)), text.title));
  };
  const add = async () => {
    await post('users', { name: name.value.trim(), role: role.value, password: fresh.value,
      ...proof.take() });
    name.value = fresh.value = '';
    done(S.saved);
    await load();
  };
  clear(place, h('h1', {}, text.title),
    may('users') && h('section', { class: 'card' }, list),
    may('users') && card(text.add,
      form({ class: 'form inline' }, add, field(text.name, name, text.nameHint),
        field(text.role, role), field(text.password, fresh, S.login.passwordHint), proof.fields,
        h('button', { class: 'primary' }, text.submit))),
    may('users') && displays(), ownPreferences(), ownPassword(), ownPin(),
    ownAuthenticator(), ownSessions());
  if (may('users')) await load().catch((error) => warn(error.message));
}
