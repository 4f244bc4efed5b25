// SPDX-License-Identifier: Apache-2.0
// The records of live monitoring that lie beside a scan: their list, and one in short.
import { get, getOrNull } from '../api.js';
import {
  card, clear, fixed, h, hint, localTime, saveFrom, table,
} from '../dom.js';
import { kAxes, mostDigits, signed, withUnit } from '../numbers.js';
import { S, said, wordOf } from '../words.js';
import { sentence } from '../screens/common.js';

const kShares = ['in', 'out', 'unknown'];
const path = (scan, number) => `scans/${scan}/monitoring/${number}`;

/// For the screen of a result; null where nothing was monitored.
export async function recordsOf(scan) {
  const records = (await getOrNull(`scans/${scan.id}/monitoring`))?.records ?? [];
  if (!records.length) return null;
  const text = S.monitorRecord;
  return card(text.list, h('ul', { class: 'monitor-records' }, records.map((record) => h('li', {},
    record.fault ? h('span', { class: 'caution' }, sentence(said(record, 'fault')))
      : h('a', { href: `#/monitoring/${scan.id}-${record.number}` },
        localTime(record.head.started_at))))));
}

const timeOf = (seconds) => (seconds < 90 ? S.monitorRecord.seconds(seconds)
  : S.monitorRecord.minutes(seconds / 60));

/// Times by their names, with their share of all of them.
function times(words, byName) {
  const all = Object.values(byName).reduce((sum, one) => sum + one, 0);
  return Object.entries(byName).map(([name, seconds]) => h('li', {},
    `${wordOf(words, name)}: ${timeOf(seconds)} (${S.monitorRecord.share(100 * seconds / all)})`));
}

function motion(title, numbers) {
  if (!numbers) return null;
  const text = S.monitorRecord;
  const cell = (axis, value) => h('td', {}, withUnit(signed(value, mostDigits(axis)), axis.unit));
  return [h('h3', {}, title), table([text.axis, text.least, text.most, text.last],
    kAxes.map((axis) => h('tr', {}, h('th', { scope: 'row' }, S.result.axes[axis.name]),
      ['least', 'most', 'last'].map((key) => cell(axis, numbers[axis.key][key])))), title)];
}

function breathingWords(report) {
  const text = S.monitorRecord;
  const zero = report.said.find(({ event }) => event === 'zero');
  if (!zero?.breathing) return text.noBreathing;
  return text.breathingIs(zero.breathing.amplitude_mm, zero.breathing.period_s);
}

function eventWords(event) {
  const advice = /^advice_(\w+)$/.exec(event.event)?.[1];
  if (advice) return wordOf(S.monitor.advice, advice);
  const words = S.monitor.states[event.event] ?? wordOf(S.monitorRecord.events, event.event);
  const why = event.reason ? S.monitor.reasons[event.reason] : '';
  return why ? `${words}: ${why}` : words;
}

function facts(report) {
  const text = S.monitorRecord;
  const row = (label, value) => h('div', {}, h('dt', {}, label), h('dd', {}, value));
  const { drift } = report;
  const percent = (share) => `${fixed(100 * (share - 1), 2)} %`;
  const ended = report.said.find(({ why }) => why);
  return h('dl', { class: 'trust' }, row(text.duration, timeOf(report.seconds)),
    row(text.frames, `${report.frames}`),
    kShares.some((one) => report.advice_s?.[one])
      && row(text.advice, h('ul', {}, times(S.monitor.advice, report.advice_s))),
    report.states_s && row(text.states, h('ul', {}, times(S.monitor.states, report.states_s))),
    row(text.holds, `${report.holds}`), row(text.gaps, timeOf(report.gaps_s)),
    row(text.drift, text.driftIs(percent(drift.least), percent(drift.most))),
    row(S.monitorRecord.breathing, breathingWords(report)),
    ended && row(text.end, sentence(said(ended, 'why'))));
}

export async function showMonitoringRecord(place, argument = '') {
  const text = S.monitorRecord;
  const [scan, number] = argument.split('-');
  const report = await get(`${path(scan, number)}.json`);
  const back = h('p', {}, h('a', { class: 'button', href: `#/result/${scan}` }, text.back));
  if (report.fault) {
    clear(place, h('h1', {}, text.title), back,
      h('p', { class: 'caution', role: 'alert' }, sentence(said(report, 'fault'))));
    return;
  }
  const events = report.events.map((event) => h('li', {},
    `${timeOf(event.time_s)} · ${eventWords(event)}`));
  clear(place, h('h1', {}, text.title), h('p', { class: 'lead' },
    text.of(localTime(report.head.started_at))), back,
  report.is_cut_off && h('p', { class: 'caution' }, text.cutOff),
  card(text.numbers, facts(report),
    h('button', {
      type: 'button',
      onclick: () => saveFrom(
        `/api/v1/${path(scan, number)}.csv?download&language=${document.documentElement.lang}`,
        `plumb_monitoring_${scan}_${number}.csv`),
    }, text.download)),
  card(text.motion, hint(S.monitor.motion),
    motion(S.monitor.againstReference, report.against_reference),
    motion(S.monitor.sinceZero, report.since_zero)),
  card(text.eventsTitle, h('ul', {}, events),
    report.num_events > events.length && hint(text.moreEvents(report.num_events))));
}
