// SPDX-License-Identifier: Apache-2.0
// Which system runs, updates of it, the restart into them, and the diagnostics.
import { get, live, may, post, postForFile, remove, sendFile } from '../api.js';
import {
  action, card, clear, done, enable, field, form, h, hint, redraw, saveBlob,
} from '../dom.js';
import { signedForm } from '../signed_form.js';
import { S, said } from '../words.js';
import { follow } from './common.js';

/// Sends a bundle with a progress bar.
function upload() {
  const text = S.update;
  const input = h('input', { type: 'file', accept: '.raucb', required: true });
  const bar = h('progress', { max: 1, value: 0, 'aria-label': text.uploading, hidden: true });
  const send = (file) => sendFile(`update/bundles/${encodeURIComponent(file.name)}`, file,
    text.uploadFailed, (share) => { bar.value = share; });
  return h('section', { class: 'card', hidden: true }, h('h2', {}, text.upload),
    hint(text.uploadHint),
    form({ class: 'form inline' }, async () => {
      bar.hidden = false;
      try {
        await send(input.files[0]);
        input.value = '';
        done(text.uploaded);
      } finally {
        bar.hidden = true;
      }
    }, field(text.bundle, input), h('button', {}, text.send)), bar);
}

/// Only for who may, and with the password again: the machine goes down.
function restart() {
  const text = S.update;
  return h('section', { class: 'card restart', hidden: true }, h('h2', {}, text.restart),
    h('p', { class: 'lead' }, text.restartNeeded), hint(text.restartHint),
    signedForm({ class: 'form inline' }, async (sign) => {
      await post('update/restart', sign());
      done(text.restarting);
    }, h('button', { class: 'danger' }, text.restartSubmit)));
}

/// Both kinds ask for the password again; wiping, which cannot be undone, also for a typed word.
function factoryReset() {
  const text = S.update;
  const kind = h('select', { required: true }, h('option', { value: '' }, text.resetChoose),
    h('option', { value: 'keep_records' }, text.resetKeep),
    h('option', { value: 'wipe' }, text.resetWipe));
  const word = h('input', { autocomplete: 'off', pattern: text.resetWord, required: true });
  const typed = field(text.resetType, word);
  const effect = hint();
  const show = () => {
    const wipe = kind.value === 'wipe';
    typed.hidden = !wipe;
    word.disabled = !wipe;
    const hints = { keep_records: text.resetKeepHint, wipe: text.resetWipeHint };
    effect.textContent = hints[kind.value] ?? '';
  };
  kind.addEventListener('change', show);
  show();
  return card(text.reset,
    hint(text.resetHint), signedForm({ class: 'form' }, async (sign) => {
      await post('system/factory-reset', { kind: kind.value, ...sign() });
      done(text.resetting);
    }, h('button', { class: 'danger' }, text.resetSubmit), field(text.resetKind, kind), effect,
    typed));
}

function diagnostics() {
  const text = S.update;
  return card(text.diagnostics,
    h('p', {}, text.diagnosticsText), action(text.download, async () => {
      const { blob, name } = await postForFile('diagnostics');
      saveBlob(blob, name);
    }, {}));
}

/// Buttons that are rebuilt while the action that they started is still running: they stay disabled
/// until it is done. A disabled button keeps the focus.
function lastingButtons(redrawn) {
  const running = new Set();
  return (label, what, task, { isOff, ...properties }) => {
    const name = `${label} ${what}`;
    const button = action(label, async () => {
      running.add(name);
      try {
        await task();
      } finally {
        running.delete(name);
        redrawn();
      }
    }, { 'aria-label': name, ...properties });
    enable(button, !isOff && !running.has(name));
    return button;
  };
}

function bundles(update, button) {
  const text = S.update;
  const isOff = update.installing;
  const rows = update.bundles.map((name) => h('li', { class: 'row' },
    h('span', { class: 'bundle' }, name), may('update') && [
      button(text.install, name, () => post('update', { bundle: name }),
        { class: 'primary', isOff }),
      button(text.remove, name, () => remove(`update/bundles/${name}`), { isOff })]));
  return [h('h2', {}, text.bundles),
    rows.length ? h('ul', { class: 'files' }, rows) : hint(text.noBundles)];
}

/// Bundles on a USB stick are only offered: the user decides whether to install one.
function onStick(update, button) {
  const text = S.update;
  if (!update.stick.length || !may('update')) return null;
  return [h('h2', {}, text.stick), h('ul', { class: 'files' }, update.stick.map((name) => h('li',
    { class: 'row' }, h('span', { class: 'bundle' }, name), button(text.install,
      `${name} ${text.fromStick}`, () => post('update', { bundle: name, from_stick: true }),
      { isOff: update.installing }))))];
}

export async function showUpdate(place) {
  const text = S.update;
  const body = h('div', {});
  const sender = upload();
  const starter = restart();
  const button = lastingButtons(() => draw().catch(() => {}));
  const draw = async () => {
    const update = await get('update', true);
    const { supported, installing } = update;
    const [message, failure] = [said(update, 'message'), said(update, 'failure')];
    redraw(body,
      update.rolled_back && h('div', { class: 'rolled-back' },
        h('p', { class: 'caution' }, said(update, 'rolled_back')),
        may('update') && action(text.seen, () => post('update/seen'), {})),
      h('dl', { class: 'facts' },
        h('dt', {}, text.installed), h('dd', {}, live.status?.version ?? S.none),
        update.slot && [h('dt', {}, text.slot), h('dd', {}, text.runs(update.slot))]),
      installing && [h('p', { class: 'lead' }, text.installing, ' ', message),
        h('progress', { max: 1, value: update.fraction, 'aria-label': text.installing })],
      failure && !installing && h('p', { class: 'caution' }, failure),
      update.offered && !installing && h('p', { class: 'lead' }, said(update, 'offered')),
      update.channel_failure && h('p', { class: 'caution' }, said(update, 'channel_failure')),
      supported && onStick(update, button),
      supported ? bundles(update, button)
        : h('p', { class: 'caution' }, `${text.unsupported}: ${message}`),
      supported && !installing && message && message !== failure
        && h('p', { class: 'lead' }, message));
    sender.hidden = !supported || !may('update');
    starter.hidden = !update.restart_needed || installing || !may('update');
  };
  clear(place, h('h1', {}, text.title), h('section', { class: 'card' }, body), starter, sender,
    may('diagnostics') && diagnostics(), may('update') && factoryReset());
  await draw();
  return follow((kind) => {
    if (kind === 'update' || kind === 'connection') draw().catch(() => {});
  }, () => draw().catch(() => {}), 5000);  // a stick sends no event
}
