import { get, live, may, post } from '../api.js';
import { action, done, h, localTime, redraw, table } from '../dom.js';
import { signed } from '../numbers.js';
import { S } from '../strings.js';

const kIcons = { passed: '✓', failed: '▲', no_baseline: '?' };
const kTones = { passed: 'in_tolerance', failed: 'move', no_baseline: 'no_answer' };

/// A length: it has no sign.
const isSize = (item) => item.name === 'misfit' || item.name === 'moved';

function itemRow(item) {
  const text = S.check;
  const isCount = item.name === 'markers_seen';
  const value = item.value === null ? text.notKnown : isCount ? `${item.value}` : `${isSize(item) ? item.value.toFixed(1) : signed(item.value, 2)} ${item.unit}`;
  return h('tr', {}, h('th', { scope: 'row' }, text.items[item.name] ?? item.name), h('td', { class: 'figure' }, value, item.note && h('small', {}, ` ${item.note}`)),
    h('td', {}, isCount ? text.atLeast(item.limit) : text.atMost(isSize(item) ? '' : '±', item.limit, item.unit)), h('td', { class: item.passed ? 'judged-in' : 'judged-out' }, item.passed ? `✓ ${text.within}` : `▲ ${text.outside}`));
}

function verdict(check, overdue) {
  const text = S.check;
  if (!check) return h('section', { class: 'verdict none' }, h('p', { class: 'word' }, text.none), h('p', { class: 'why' }, text.never));
  const why = check.status === 'passed' ? (overdue ? text.overdueText : text.today) : check.reasons[0] ?? '';
  return h('section', { class: `verdict ${check.status === 'passed' && overdue ? 'none' : kTones[check.status]}` },
    h('p', { class: 'word' }, h('span', { class: 'icon', 'aria-hidden': 'true' }, kIcons[check.status]), text.verdicts[check.status]),
    h('p', { class: 'why' }, why), h('p', { class: 'when' }, text.last(localTime(check.time), check.user)));
}

function newest(check, load) {
  const text = S.check;
  return h('section', { class: 'card' }, h('h2', {}, localTime(check.time)), table([text.number, text.value, text.limit, text.judged], check.items.map(itemRow), text.title),
    check.reasons.length > 1 && h('ul', { class: 'findings small' }, check.reasons.slice(1).map((reason) => h('li', {}, reason))),
    may('plan') && check.num_markers >= 3 && h('div', { class: 'row below' }, action(text.takeBaseline, async () => {
      await post(`checks/${check.id}/baseline`);
      done(text.baselineTaken);
      await load();
    }, { 'data-check': check.id }), h('p', { class: 'hint' }, text.takeHint)));
}

function earlier(checks) {
  const text = S.check;
  const rows = checks.map((check) => h('tr', {}, h('td', {}, localTime(check.time)), h('td', {}, h('span', { class: `badge ${kTones[check.status]}` }, `${kIcons[check.status]} ${text.verdicts[check.status]}`)), h('td', {}, check.num_markers), h('td', {}, check.sensor_serial || S.none), h('td', {}, check.user)));
  return h('section', { class: 'card' }, h('h2', {}, text.history), table([S.patients.when, S.patients.outcome, text.markers, text.sensor, text.by], rows, text.history));
}

export async function showCheck(place) {
  const text = S.check;
  const load = async () => {
    const { checks, baseline, overdue } = await get('checks', true);
    redraw(place, h('h1', { class: 'visually-hidden' }, text.title), verdict(checks[0], overdue),
      h('section', { class: 'card split' }, h('div', {}, h('p', {}, text.how), h('p', { class: 'hint' }, `${text.baseline}: ${baseline ? text.baselineOf(baseline.set_by, localTime(baseline.set_at), baseline.num_markers) : text.noBaseline}`)),
        may('scan') && action(text.start, async () => {
          await post('checks/open');
          location.hash = '#/scan';
        }, { class: 'primary' })),
      checks.length > 0 && newest(checks[0], load), checks.length > 1 && earlier(checks.slice(1)));
  };
  await load();
  return live.listen((kind) => { if (kind === 'data' || kind === 'result') load().catch(() => {}); });
}
