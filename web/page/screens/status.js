// SPDX-License-Identifier: Apache-2.0
// Shows what the appliance does, what waits, and what lets people scan.
import { get, live, may } from '../api.js';
import { card, clear, h, hint, localTime, redraw, row, table } from '../dom.js';
import { lastLogin, lastLoginWords } from '../last_login.js';
import { sessionName } from '../treatment.js';
import { S, said, saidEach } from '../words.js';
import {
  cautionsOf, faultWords, follow, isCold, lastKnownNote, minutesOf, newestOf, outcomeBadge,
  patientCodes, stateHere, stateHint,
} from './common.js';

const gigabytes = (bytes) => Math.round(bytes / 2 ** 30);

/// Whether the room was checked today, and how that went.
function checkTile({ last_check: last, check_overdue: overdue, check_failed: failed }, tile) {
  const text = S.check;
  const good = last?.status === 'passed' && !overdue;
  const word = good ? text.verdicts.passed
    : last && last.status !== 'passed' ? text.verdicts[last.status] : text.overdue;
  return tile(text.tile, word.toLowerCase(), good ? 'good' : 'bad',
    last && h('p', {}, text.last(localTime(last.time), last.user)), cautionsOf(last),
    overdue && h('p', { class: 'caution' }, failed ? text.failedText : text.overdueText),
    h('p', {}, h('a', { href: '#/check' }, S.nav.check)));
}

/// Drafts that somebody has to plan or approve: whose turn it is.
function waitingTile({ waiting = [] }, tile) {
  const text = S.status;
  const rows = waiting.map((one) => h('li', {},
    one.planned_by ? text.waitingApproval : text.waitingPlan, ' ',
    h('a', { class: 'whole', href: `#/plan/${one.reference_id}` }, one.patient_code), ' ',
    text.waitingVersion(one.version)));
  return tile(text.waiting, waiting.length ? `${waiting.length}` : text.nothingWaits,
    waiting.length ? 'waits' : '',
    rows.length > 0 && [h('ul', {}, rows), h('p', {}, text.waitingHint)]);
}

function tiles(status) {
  const text = S.status;
  const { sensor, storage, session } = status;
  const used = storage.total_bytes > 0 ? 1 - storage.free_bytes / storage.total_bytes : 0;
  const tile = (title, value, tone, ...more) => h('section', { class: `card tile ${tone}` },
    h('h2', {}, title), h('p', { class: 'big' }, value), ...more);
  const isCheck = status.next_purpose === 'daily_check';
  return [
    tile(text.patient, isCheck ? S.purposes.daily_check : sessionName(session), '',
      session?.purpose === 'reference' && !isCheck && h('p', {}, S.purposes[session.purpose]),
      session && isCheck && h('p', {}, S.session.afterCheck(sessionName(session))),
      session && !isCheck && h('p', {}, S.session.openedBy(session.opened_by))),
    waitingTile(status, tile),
    checkTile(status, tile),
    tile(text.sensor, sensor.present ? text.present : text.missing, sensor.present ? 'good' : 'bad',
      sensor.present && h('p', {}, `${sensor.name}, ${text.serial} ${sensor.serial}`),
      sensor.present && h('p', {},
        `${text.rate(sensor.fps)}, ${text.powered(Math.floor(sensor.powered_s / 60))}`),
      sensor.present && isCold(sensor.powered_s)
        && h('p', { class: 'caution' }, text.warming(minutesOf(sensor.warm_up_s)))),
    tile(text.storage, storage.writable
      ? text.free(gigabytes(storage.free_bytes), gigabytes(storage.total_bytes)) : text.readOnly,
    storage.writable && used < 0.95 ? 'good' : 'bad',
    ...saidEach(storage, 'warnings').map((warning) => h('p', { class: 'caution' }, warning)),
    h('meter', { min: 0, max: 1, high: 0.9, value: used, 'aria-label': text.storage }),
    h('p', {}, `${S.product} ${status.version}`)),
  ];
}

export async function showStatus(place) {
  const text = S.status;
  const headline = h('p', { class: 'headline' });
  const advice = h('p', { class: 'lead' });
  const known = lastKnownNote('old-note');
  const warnings = h('div', {});
  const grid = h('div', { class: 'tiles' });
  const list = h('div', {});
  const login = h('p', { class: 'hint last-login' });
  lastLogin().then((answer) => {
    if (!answer) return;
    login.textContent = lastLoginWords(answer);
    login.classList.toggle('caution', answer.failed > 0);
  });
  clear(place,
    h('h1', { class: 'visually-hidden' }, text.title),
    h('section', { class: 'card hero' }, h('div', {}, known.element, headline, advice),
      may('scan') && h('a', { class: 'button primary', href: '#/scan' }, text.goScan)),
    warnings, grid,
    card(text.lastScans, list), login);

  const draw = () => {
    const { status } = live;
    if (!status) return;
    place.classList.toggle('off', !live.connected);
    known.draw();
    clear(warnings, [said(status, 'rolled_back'), ...saidEach(status, 'warnings')].filter(Boolean)
      .map((one) => h('p', { class: 'caution' }, one)));
    const state = stateHere(status);
    headline.textContent = S.states[state];
    headline.dataset.state = state;
    advice.textContent = live.connected ? faultWords(status) ?? stateHint(status) : '';
    redraw(grid, tiles(status));
  };
  const ask = newestOf(() => Promise.all([patientCodes(), get('scans?limit=8', true)]));
  const load = async () => {
    const answers = await ask();
    if (!answers) return;
    const [codes, { scans }] = answers;
    const rows = scans.map((scan) => row(
      h('a', { href: `#/result/${scan.id}` }, localTime(scan.started_at)),
      codes.get(scan.patient_id) ?? S.none, S.purposes[scan.purpose], outcomeBadge(scan)));
    const heads = [S.patients.when, S.result.patient, S.patients.purpose, S.patients.outcome];
    redraw(list, rows.length ? table(heads, rows, text.lastScans)
      : hint(text.noScans));
    draw();
  };
  draw();  // what is known already; the list may take a moment, or never come
  const stop = follow((kind) => {
    if (kind === 'status' || kind === 'connection') draw();
    if (kind === 'data') live.refresh();  // a plan or an approval changes what waits
    if (kind === 'data' || kind === 'result') load().catch(() => {});
  }, known.draw);
  await load().catch((error) => redraw(list, hint(error.message)));
  return stop;
}
