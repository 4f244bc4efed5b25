// SPDX-License-Identifier: Apache-2.0
// One's own authenticator, and where one is logged in.
import { currentSession, get, loadSession, post, put, remove, removeFor } from '../api.js';
import {
  action, card, clear, codeInput, done, field, form, h, hint, row, table, warn,
} from '../dom.js';
import { signedForm } from '../signed_form.js';
import { S } from '../words.js';
import { ageText } from './common.js';
import { pinInput, rememberQuickPeople } from './quick_login.js';

/// Set up: the password, then the secret, then a first code; the recovery codes are shown once.
export function ownAuthenticator() {
  const text = S.authenticator;
  const session = currentSession();
  if (session.role === 'technician') return false;
  const place = h('div', {});
  const draw = () => {
    const has = currentSession().second_factor;
    clear(place, h('p', {}, has ? text.on : text.off),
      signedForm({ class: 'form inline' }, has ? takeAway : offer,
        h('button', { class: has ? 'danger' : '' }, has ? text.remove : text.begin)));
  };
  const takeAway = async (sign) => {
    await removeFor('session/second-factor', sign());
    await loadSession();
    done(text.removed);
    draw();
  };
  const offer = async (sign) => {
    const { secret, uri } = await post('session/second-factor/offer', sign());
    const code = codeInput({ required: true, inputmode: 'numeric' });
    clear(place, h('p', {}, text.secretText), h('p', {}, h('code', { class: 'secret' }, secret)),
      hint(text.uri, ' ', h('code', {}, uri)),
      form({ class: 'form inline' }, async () => {
        const { recovery_codes: codes } =
          await post('session/second-factor', { code: code.value.trim() });
        await loadSession();
        done(text.saved);
        clear(place, h('p', {}, text.saved), h('p', {}, text.recovery),
          h('ul', { class: 'recovery' }, codes.map((one) => h('li', {}, h('code', {}, one)))));
      }, field(text.code, code), h('button', { class: 'primary' }, text.finish)));
    code.focus();
  };
  draw();
  return card(text.title, hint(text.hint), place);
}

/// A PIN or a badge for the rest of a shift.
export function ownPin() {
  const text = S.pin;
  const place = h('div', {});
  const saved = async (words) => {
    await loadSession();
    rememberQuickPeople();
    done(words);
    draw();
  };
  const draw = () => {
    const has = currentSession().has_pin;
    const [fresh, again] = [pinInput(), pinInput()];
    clear(place, h('p', {}, has ? text.on : text.off),
      signedForm({ class: 'form inline' }, async (sign) => {
        if (fresh.value !== again.value) throw new Error(text.differ);
        await put('session/pin', { pin: fresh.value, ...sign() });
        await saved(S.saved);
      }, h('button', {}, text.set), field(text.fresh, fresh, text.freshHint),
      field(text.repeat, again)),
      has && h('details', {}, h('summary', {}, `${text.remove}…`),
        signedForm({ class: 'form inline' }, async (sign) => {
          await removeFor('session/pin', sign());
          await saved(text.removed);
        }, h('button', { class: 'danger' }, text.remove))));
  };
  draw();
  return card(text.title, hint(text.hint), place);
}

export function ownSessions() {
  const text = S.sessions;
  const place = h('div', {});
  const load = async () => {
    const { sessions } = await get('session/list', true);
    const rows = sessions.map((one) => row(
      one.is_this ? `${one.address} (${text.thisOne})` : one.address,
      ageText(one.begun_s_ago), ageText(one.used_s_ago),
      one.is_this ? '' : action(text.end, async () => {
        await remove(`session/list/${one.id}`);
        await load();
        done(text.ended);
      }, { 'aria-label': `${text.end} ${one.address}` })));
    clear(place, table([text.address, text.begun, text.used, S.action], rows, text.title),
      sessions.length > 1 && action(text.endOthers, async () => {
        await post('session/end-others');
        await load();
        done(text.ended);
      }));
  };
  load().catch((error) => warn(error.message));
  return card(text.title, place);
}
