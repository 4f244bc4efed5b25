// SPDX-License-Identifier: Apache-2.0
import {
  get, live, may, post, postLong, put,
} from '../api.js';
import {
  action, card, checkbox, clear, done, field, fillNumber, form, h, hint, localTime, select,
} from '../dom.js';
import { kBounds } from '../limits.js';
import { S, said, saidEach } from '../words.js';
import { certificateCard } from './certificate.js';
import { profileCard } from './sensor_profile.js';

const kFlags = ['couch_markers', 'keep_recordings', 'scan_wristband', 'code_check_character'];

/// When the last backup was made and how it went, and one more now.
function backupCard() {
  const text = S.settings;
  const last = h('p', { class: 'last-backup' });
  const lastVerified = h('p', { class: 'last-verified' });
  const running = h('p', { class: 'hint', role: 'status' });
  const draw = async () => {
    const { last: entry, verified } = await get('backup', true);
    lastVerified.textContent = verified
      ? text.backupVerified(localTime(verified.time), verified.user) : text.backupNotVerified;
    // A plain one is opened by the unit itself.
    forKey.hidden = entry?.detail_message?.id !== 'backup.log_encrypted';
    const warnings = saidEach(live.status?.storage, 'warnings');
    clear(last, entry ? text.backupLast(localTime(entry.time), entry.user || S.product)
      : text.backupNone, entry && [' ', h('code', {}, said(entry, 'detail'))],
    warnings.map((one) => h('span', { class: 'caution' }, ' ', one)));
  };
  const now = action(text.backupNow, async () => {
    running.textContent = text.backupRunning;
    try {
      await postLong('backup');
      done(text.backupDone);
    } finally {
      running.textContent = '';
      await draw().catch(() => {});
    }
  }, {});
  const verified = action(text.backupVerify, async () => {
    await post('backup/verified');
    done(S.saved);
    await draw();
  }, {});
  const forKey = h('div', { hidden: true }, hint(text.backupVerifyHint), lastVerified, verified);
  draw().catch((error) => clear(last, error.message));
  return card(text.backup, hint(text.backupHint), last, now, running, forKey);
}

/// Who outside is told of what needs a person, and whether that works.
function messagesCard() {
  const text = S.settings;
  const list = h('ul', { class: 'message-ways' });
  const running = h('p', { class: 'hint', role: 'status' });
  const draw = async () => {
    const { ways } = await get('messages', true);
    clear(list, ways.length === 0 && h('li', {}, text.messagesNone), ways.map((way) => h('li', {},
      text.messageWay(way.name, way.sent, way.failed),
      way.failure && [' ', h('span', { class: 'caution' }, said(way, 'failure'))])));
  };
  const test = action(text.messageTest, async () => {
    running.textContent = text.messageSending;
    try {
      await postLong('messages/test');
      done(text.messageSent);
    } finally {
      running.textContent = '';
      await draw().catch(() => {});
    }
  }, {});
  draw().catch((error) => clear(list, error.message));
  return card(text.messages, hint(text.messagesHint), list, test, running);
}

const kCannotRead = /the stored settings cannot be read/;

/// Returns what is stored, or why it cannot be read: then nothing is filled in, since a default
/// would look like a value that somebody set.
async function readSettings() {
  try {
    return { settings: await get('settings'), fault: null };
  } catch (error) {
    if (!kCannotRead.test(error.body?.error ?? '')) throw error;
    return { settings: {}, fault: error.message };
  }
}

export async function showSettings(place) {
  const text = S.settings;
  const { settings, fault } = await readSettings();
  const editable = may('settings');
  const inputs = {};
  const numbers = Object.entries(kBounds).map(([name, bounds]) => {
    inputs[name] = fillNumber(
      h('input', { type: 'number', required: true, disabled: !editable }), settings[name], bounds,
    );
    return field(text[name], inputs[name]);
  });
  const flags = kFlags.map((name) => {
    if (fault) {  // A box is never empty, a choice can be.
      const choice = select({ true: S.audit.yes, false: S.audit.no }, undefined,
        { required: true, disabled: !editable });
      inputs[name] = {
        isOn: () => choice.value === 'true', turn: (on) => { choice.value = String(on); },
      };
      return field(text[name], choice);
    }
    const { box, element } = checkbox(text[name], settings[name], { disabled: !editable });
    inputs[name] = { isOn: () => box.checked, turn: (on) => { box.checked = on; } };
    return element;
  });
  const posture = select(S.plan.postures, settings.posture,
    { required: true, disabled: !editable });
  const acceptLive = select(text.acceptLiveBy, settings.accept_live,
    { required: true, disabled: !editable });
  const paper = select(text.papers, settings.paper, { required: true, disabled: !editable });
  const alert = fault && h('p', { class: 'caution', role: 'alert' }, text.enterAll, ' ',
    h('code', {}, fault));
  let stored = settings;
  const entered = () => ({
    posture: posture.value, accept_live: acceptLive.value, paper: paper.value,
    ...Object.fromEntries(Object.keys(kBounds).map((name) => [name, Number(inputs[name].value)])),
    ...Object.fromEntries(kFlags.map((name) => [name, inputs[name].isOn()])),
  });
  /// Sends only what was changed here: somebody else may have changed other settings since they
  /// were read. Those are then shown, too.
  const save = async () => {
    const wanted = entered();
    const changed = Object.entries(wanted).filter(([name, value]) => value !== stored[name]);
    if (changed.length) await put('settings', Object.fromEntries(changed));
    stored = await get('settings').catch(() => ({ ...stored, ...wanted }));
    posture.value = stored.posture;
    acceptLive.value = stored.accept_live;
    paper.value = stored.paper;
    for (const [name, bounds] of Object.entries(kBounds)) {
      fillNumber(inputs[name], stored[name], bounds);
    }
    for (const name of kFlags) inputs[name].turn(stored[name]);
    alert?.remove();
    done(S.saved);
  };
  clear(place, h('h1', {}, text.title), !editable && h('p', { class: 'lead' }, text.readOnly),
    alert,
    h('section', { class: 'card' }, form({ class: 'form columns' }, save, numbers,
      field(text.posture, posture), field(text.accept_live, acceptLive),
      field(text.paper, paper), flags,
      editable && h('div', { class: 'row' }, h('button', { class: 'primary' }, S.save)))),
    profileCard(), editable && backupCard(), editable && messagesCard(),
    editable && certificateCard());
}
