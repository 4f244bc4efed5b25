// SPDX-License-Identifier: Apache-2.0
// The daily check of the room's markers: today's, its numbers over time, and the baseline.
import { currentSession, get, live, may, post } from '../api.js';
import { couchCard } from '../couch/profile.js';
import {
  action, card, clear, done, field, fixed, h, hint, localTime, redraw, row, rowHead,
  signedTime, svg, table,
} from '../dom.js';
import { kReason } from '../limits.js';
import { signed } from '../numbers.js';
import { controlLimits } from '../drawings/control_limits.js';
import { dayLabels, markOf } from '../drawings/trend.js';
import { markerHelp } from '../help/drawings.js';
import { signedForm } from '../signed_form.js';
import { S, said, saidEach } from '../words.js';
import { cautionsOf, sentence } from './common.js';
import { roomCard } from './room_calibration.js';

const kIcons = { passed: '✓', failed: '▲', no_baseline: '?' };
const kTones = { passed: 'in_tolerance', failed: 'move', no_baseline: 'no_answer' };

/// A length: it has no sign.
const isSize = (item) => item.name === 'misfit' || item.name === 'moved';
const isCount = (item) => item.name === 'markers_seen';
const written = (item) => (isSize(item) ? fixed(item.value, 1) : signed(item.value, 2));
const plain = (value) => `${value}`.replace('-', '−').replace('.', S.decimal);

function itemRow(item) {
  const text = S.check;
  const value = item.value === null ? text.notKnown
    : isCount(item) ? `${item.value}` : `${written(item)} ${item.unit}`;
  const limit = isCount(item) ? text.atLeast(item.limit)
    : text.atMost(`${isSize(item) ? '' : '±'}${plain(item.limit)} ${item.unit}`);
  return row(rowHead(text.items[item.name] ?? item.name),
    h('td', { class: 'figure' }, value, item.note && h('small', {}, ` ${said(item, 'note')}`)),
    limit,
    h('td', { class: item.passed ? 'judged-in' : 'judged-out' },
      item.passed ? `✓ ${text.within}` : `▲ ${text.outside}`));
}

function verdict(check, overdue) {
  const text = S.check;
  if (!check) {
    return h('section', { class: 'verdict none' }, h('p', { class: 'word' }, text.none),
      h('p', { class: 'why' }, text.never));
  }
  const passed = check.status === 'passed';
  const why = passed ? (overdue ? text.overdueText : text.today)
    : sentence(saidEach(check, 'reasons')[0]);
  return h('section', { class: `verdict ${passed && overdue ? 'none' : kTones[check.status]}` },
    h('p', { class: 'word' },
      h('span', { class: 'icon', 'aria-hidden': 'true' }, kIcons[check.status]),
      text.verdicts[check.status]),
    h('p', { class: 'why' }, why), cautionsOf(check),
    h('p', { class: 'when' }, text.last(localTime(check.time), check.user)));
}

/// The person who took a check does not make it the baseline: a second one looks at what it would
/// change, and signs.
function baselineForm(check, changes, load) {
  const text = S.check;
  if (check.user === currentSession()?.user) return hint(text.secondPerson);
  const reason = h('input', { required: true, autocomplete: 'off', ...kReason });
  return h('details', { class: 'take-baseline' }, h('summary', {}, `${text.takeBaseline}…`),
    h('p', { class: check.status === 'failed' ? 'caution' : 'hint' },
      check.status === 'failed' ? text.takeFailed : text.takeHint),
    changes.length > 0 && [h('p', {}, text.takeChanges), h('ul', { class: 'findings small' },
      changes.map((change) => h('li', {}, sentence(change))))],
    signedForm({ class: 'form inline' }, async (sign) => {
      await post(`checks/${check.id}/baseline`, { reason: reason.value.trim(), ...sign() });
      done(text.baselineTaken);
      await load();
    }, h('button', { 'data-check': check.id }, text.takeBaseline), field(text.takeReason, reason)));
}

function newest(check) {
  const text = S.check;
  const more = saidEach(check, 'reasons').slice(1).map((reason) => h('li', {}, sentence(reason)));
  return card(localTime(check.time),
    table([text.number, text.value, text.limit, text.judged], check.items.map(itemRow), text.title),
    more.length > 0 && h('ul', { class: 'findings small' }, more));
}

const kWidth = 340;
const kHeight = 130;
const kLeft = 40;

/// One number of the checks over time, in its limit.
function chart(name, checks) {
  const points = checks.map((check) => ({
    check, item: check.items.find((item) => item.name === name),
  })).filter(({ item }) => item && item.value !== null).reverse();
  if (points.length < 2 || name === 'markers_seen') return null;
  const { limit, unit } = points[points.length - 1].item;
  const low = isSize({ name }) ? 0 : -limit;
  const values = points.map(({ item }) => item.value);
  const told = points.map(({ item }) => written(item));
  const control = controlLimits(values);
  const reached = [...values, ...(control ? [control.low, control.high] : [])];
  const top = 1.1 * Math.max(limit, ...reached);
  const bottom = 1.1 * Math.min(low, ...reached);
  const x = (i) => kLeft + 14 + i / (points.length - 1) * (kWidth - kLeft - 42);
  const y = (value) => 8 + (top - value) / (top - bottom) * (kHeight - 32);
  const tick = (value) =>
    svg('text', { x: kLeft - 5, y: y(value) + 4, class: 'tick' }, plain(value));
  const across = (value, look) => svg('line', {
    x1: kLeft, x2: kWidth - 4, y1: y(value), y2: y(value), class: look,
  });
  const every = Math.ceil(points.length / 5);
  return h('figure', { class: 'trend' },
    h('figcaption', {}, S.check.items[name], ' ', h('strong', {}, `${told.at(-1)} ${unit}`)),
    svg('svg', {
      viewBox: `0 0 ${kWidth} ${kHeight}`, role: 'img',
      'aria-label': `${S.check.items[name]}: ${told.join('; ')} ${unit}`,
    },
    svg('rect', {
      x: kLeft, width: kWidth - kLeft - 4, y: y(limit), height: y(low) - y(limit), class: 'zone',
    }), tick(limit), tick(0), low < 0 && tick(low),
    control && [across(control.mean, 'control mean'), across(control.low, 'control'),
      across(control.high, 'control')],
    svg('polyline', { points: values.map((v, i) => `${x(i)},${y(v)}`).join(' '), class: 'line' }),
    points.map(({ item }, i) =>
      markOf(item.passed ? 'within' : 'outside', x(i), y(item.value), 4)),
    dayLabels(points.map(({ check }, i) => ({ x: x(i), time: check.time }))
      .filter((_, i) => i % every === 0), kHeight - 6)));
}

function trends(checks) {
  const names = Object.keys(S.check.items);
  const charts = names.map((name) => chart(name, checks)).filter(Boolean);
  if (!charts.length) return null;
  return card(S.check.trend,
    checks.length > 6 && hint(S.check.control), h('div', { class: 'trends' }, charts));
}

function earlier(checks) {
  const text = S.check;
  const value = (check, name) => {
    const item = check.items.find((one) => one.name === name);
    return item?.value === null || item?.value === undefined ? S.none
      : `${fixed(item.value, 1)} ${item.unit}`;
  };
  const rows = checks.map((check) => row(localTime(check.time),
    h('span', { class: `badge ${kTones[check.status]}` },
      `${kIcons[check.status]} ${text.verdicts[check.status]}`),
    check.num_markers, value(check, 'misfit'), value(check, 'moved'),
    check.sensor_serial || S.none, check.user));
  const heads = [S.patients.when, S.patients.outcome, text.markers, text.items.misfit,
    text.items.moved, text.sensor, text.by];
  return card(text.history,
    table(heads, rows, text.history));
}

export async function showCheck(place) {
  const text = S.check;
  const room = roomCard();
  const couch = couchCard();
  const help = markerHelp();
  const baselinePlace = h('section', { class: 'card', hidden: true });
  let offered = null;  // the check whose form is there: what was typed in it stays
  let asked = 0;
  const load = async () => {
    const mine = ++asked;
    const answer = await get('checks', true);
    // Answers may arrive out of order: an older one must not replace a newer one.
    if (mine !== asked) return;
    const { checks, baseline, overdue } = answer;
    const [last] = checks;
    const offer = last && JSON.stringify([last.id, baseline?.check_id, S.languageName]);
    if (last && offered !== offer) {
      offered = offer;
      // Who took a check that passed has nothing to do here once there is a baseline.
      const isDone = baseline && last.status === 'passed' && last.user === currentSession()?.user;
      const mayTake = may('plan') && last.num_markers >= 3 && baseline?.check_id !== last.id
        && !isDone;
      clear(baselinePlace, mayTake && baselineForm(last, saidEach(answer, 'changes'), load));
      baselinePlace.hidden = !mayTake;
    }
    const of = baseline
      ? text.baselineOf(baseline.num_markers, baseline.set_by, signedTime(baseline.set_at))
      : text.noBaseline;
    redraw(place, h('h1', { class: 'visually-hidden' }, text.title), verdict(checks[0], overdue),
      h('section', { class: 'card split' },
        h('div', {}, h('p', {}, text.how), hint(`${text.baseline}: ${of}`), help),
        may('scan') && action(text.start, async () => {
          await post('checks/open');
          location.hash = '#/scan';
        }, { class: 'primary' })),
      last && newest(last), baselinePlace, room.place, couch.place, trends(checks),
      checks.length > 1 && earlier(checks.slice(1)));
  };
  await load();
  const end = live.listen((kind) => {
    if (kind === 'data' || kind === 'result') load().catch(() => {});
  });
  return () => {
    end();
    room.end();
    couch.end();
  };
}
