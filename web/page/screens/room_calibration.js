// SPDX-License-Identifier: Apache-2.0
// Where the room's axes lie: the board to print, its three scans, by how much they differ, and who
// signed.
import { get, live, may, post } from '../api.js';
import {
  action, clear, done, fixed, h, hint, localTime, row, rowHead, signedTime, table,
} from '../dom.js';
import { boardHelp } from '../help/drawings.js';
import { signedForm } from '../signed_form.js';
import { S, said } from '../words.js';
import { sentence } from './common.js';

function scanRow(scan) {
  if (scan.fault) {
    return row(rowHead(localTime(scan.time)),
      h('td', { colspan: 4, class: 'judged-out' }, `▲ ${sentence(said(scan, 'fault'))}`));
  }
  return row(rowHead(localTime(scan.time)), scan.num_markers, `${fixed(scan.rms_mm, 2)} mm`,
    `${fixed(scan.scale_percent, 1)} %`,
    `±${fixed(scan.shift_uncertainty_mm, 1)} mm, ±${fixed(scan.turn_uncertainty_deg, 2)}°`);
}

function state(room) {
  const text = S.room_calibration;
  const { versions: [newest], due, configured } = room;
  if (due) return h('p', { class: 'judged-out' }, `▲ ${text.due} ${sentence(said(room, 'due'))}`);
  if (newest) {
    return h('p', { class: 'judged-in' }, `✓ ${text.holds(newest.version, newest.signed_by,
      signedTime(newest.signed_at))}`, configured && ` ${text.notTheConfigurations}`);
  }
  return h('p', {}, configured ? text.configured
    : `${S.result.roomUnknown} ${text.none}`);
}

function steps() {
  const text = S.room_calibration;
  return h('ol', { class: 'steps' },
    h('li', {}, h('a', { href: '/api/v1/room-calibration/board.pdf', download: '' }, text.print),
      ' ', text.printHint),
    h('li', {}, text.place), h('li', {}, text.scan));
}

function spread(room) {
  const text = S.room_calibration;
  const counted = room.scans.filter((scan) => !scan.fault).length;
  if (room.shift_mm === null || counted < 2) return null;
  const within = room.shift_mm <= room.max_shift_mm && room.turn_deg <= room.max_turn_deg;
  return h('p', { class: within ? 'judged-in' : 'judged-out' }, within ? '✓ ' : '▲ ',
    text.differ(Math.min(counted, room.num_wanted), fixed(room.shift_mm, 2),
      fixed(room.turn_deg, 2), fixed(room.max_shift_mm, 1), fixed(room.max_turn_deg, 1)));
}

/// With the password again: from then on it gives every comparison its directions.
function signature(room, load) {
  const text = S.room_calibration;
  return signedForm({ class: 'form inline below' }, async (sign) => {
    await post('room-calibration/sign', { digest: room.digest, ...sign() });
    done(text.signed);
    await load();
  }, h('button', { class: 'primary' }, text.sign));
}

const versionRow = (one) => row(rowHead(one.version), signedTime(one.signed_at), one.signed_by,
  `${fixed(one.shift_mm, 2)} mm`, `${fixed(one.turn_deg, 2)}°`,
  h('code', {}, one.digest.slice(0, 12)));

/// @returns the card, and what ends it.
export function roomCard() {
  const text = S.room_calibration;
  const place = h('section', { class: 'card room-calibration' });
  let shown = '';
  let requests = 0;
  const load = async () => {
    const request = ++requests;
    const room = await get('room-calibration', true);
    if (request !== requests) return;  // the answer to a later one is newer
    if (JSON.stringify(room) === shown) return;  // somebody may be typing
    shown = JSON.stringify(room);
    const { scans, versions } = room;
    clear(place, h('h2', {}, text.title), state(room), may('calibrate') && [
      steps(), boardHelp(),
      action(text.start, async () => {
        await post('checks/open');
        location.hash = '#/scan/board';
      }, {}),
      hint(text.isCheck),
    ], scans.length > 0 && table([text.when, text.markers, text.misfit, text.size,
      text.uncertainty], scans.map(scanRow), text.scans),
    spread(room),
    scans.length > 0 && room.why_not_sign
      && hint(sentence(said(room, 'why_not_sign'))),
    may('calibrate') && !room.why_not_sign && signature(room, load),
    versions.length > 0 && table([text.version, text.signedAt, text.signedBy, text.shift,
      text.turn, text.digest], versions.map(versionRow), text.versions));
  };
  const reload = () => load().catch((error) => {
    shown = '';
    clear(place, h('h2', {}, text.title), h('p', {}, error.message));
  });
  reload();
  const end = live.listen((kind) => {
    if (kind === 'data' || kind === 'result') reload();
  });
  return { place, end };
}
