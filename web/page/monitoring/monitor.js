// SPDX-License-Identifier: Apache-2.0
// Live monitoring: how far the body has moved, now. An old number is never shown as a new one: it
// is grey after 200 ms and gone after a second, also where the appliance says nothing more.
import {
  currentSession, get, getOrNull, live, may, post, since_s,
} from '../api.js';
import { couchAxis } from '../couch/axes.js';
import {
  action, card, clear, done, enable, field, h, hint, redraw, saveFrom, say, signedTime, svg,
} from '../dom.js';
import { kReason } from '../limits.js';
import { kAxes, signed, toleranceBar, withUnit } from '../numbers.js';
import { signedForm } from '../signed_form.js';
import { S, said, saidEach } from '../words.js';
import { follow, sentence } from '../screens/common.js';
import { liveMap } from './live_map.js';

const kGrey_s = 0.2;
const kUnknown_s = 0.15;
const kGone_s = 1.0;
const kLook_ms = 100;
const kTrace_s = 30;
const kLeastTrace_mm = 4;
const kMarks = { in: '✓', out: '▲', unknown: '?' };

/// What is known at this moment of what the appliance said last; null before it said anything.
export function presentOf(monitor, received_s) {
  if (!monitor) return null;
  if (!monitor.active) return monitor;
  const age_s = (monitor.age_s ?? 0) + received_s;
  const isLate = age_s > kUnknown_s && monitor.age_s !== null;
  const isGone = age_s > kGone_s;
  return {
    ...monitor,
    age_s,
    is_old: age_s > kGrey_s,
    advice: isLate ? 'unknown' : monitor.advice,
    reason: isLate ? 'no_image' : monitor.reason,
    since_zero: isGone ? null : monitor.since_zero,
    against_reference: isGone ? null : monitor.against_reference,
    breathing_mm: isGone ? null : monitor.breathing_mm,
    breath_hold: monitor.breath_hold && isLate ? { ...monitor.breath_hold, advice: 'unknown' }
      : monitor.breath_hold ?? null,
  };
}

function number(axis, numbers, tolerance) {
  const couch = couchAxis(axis, live.status?.room?.known);
  const counted = (key, factor) => {
    const found = numbers?.[key] ?? null;
    return found === null ? null : found * factor;
  };
  const value = counted(axis.key, couch.factor);
  const u95 = counted(axis.key.replace(/_(mm|deg)$/, '_u95_$1'), Math.abs(couch.factor));
  const { digits, unit } = couch;
  const limit = tolerance * Math.abs(couch.factor);
  const tone = value === null ? 'unknown' : Math.abs(value) > limit ? 'outside' : '';
  return h('div', { class: `live-number ${tone}` },
    h('span', { class: 'axis' }, S.result.axes[axis.name]),
    h('strong', {}, value === null ? '–' : withUnit(signed(value, digits), unit)),
    h('span', { class: 'fine' }, value === null ? '' : u95 === null ? '± ?'
      : `± ${withUnit(u95.toFixed(digits).replace('.', S.decimal), unit)}`),
    toleranceBar(value ?? 0, value === null ? NaN : u95, limit, value !== null));
}

/// @param monitor  States the tolerances.
export function six(title, numbers, monitor, isJudged) {
  return h('section', { class: `live-six${isJudged ? ' judged' : ''}` }, h('h2', {}, title),
    h('div', { class: 'live-numbers' }, kAxes.map((axis) => number(axis, numbers,
      axis.shift ? monitor.shift_tolerance_mm : monitor.rotation_tolerance_deg))));
}

/// The belly's height over the last half minute; gaps where it is not known.
function trace() {
  const points = [];
  const element = h('figure', { class: 'breathing' });
  return {
    element,
    add(monitor) {
      const at = performance.now() / 1000;
      if (monitor?.active) points.push([at, monitor.breathing_mm]);
      else points.length = 0;
      while (points.length && at - points[0][0] > kTrace_s) points.shift();
      const text = S.monitor;
      if (!monitor?.has_breathing) {
        clear(element, h('figcaption', {}, text.breathing), hint(text.noBreathing));
        return;
      }
      const hold = monitor.breath_hold;
      const top_mm = hold ? hold.level_mm + hold.window_mm / 2 : 0;
      const highest = Math.max(kLeastTrace_mm, top_mm, ...points.map(([, mm]) => mm ?? 0));
      const row = (mm) => 90 - 80 * (mm / highest);
      let path = '';
      let drawing = false;
      for (const [time, mm] of points) {
        if (mm !== null) {
          path += `${drawing ? 'L' : 'M'}${(1000 * (1 - (at - time) / kTrace_s)).toFixed(1)} `
            + `${row(mm).toFixed(1)}`;
        }
        drawing = mm !== null;
      }
      const last = monitor.breathing_mm;
      clear(element, h('figcaption', {}, text.breathing, ' ',
        h('strong', {}, last === null ? '–' : text.height(last))),
      svg('svg', { viewBox: '0 0 1000 100', preserveAspectRatio: 'none', 'aria-hidden': 'true' },
        hold && svg('rect', {
          x: 0,
          width: 1000,
          y: row(top_mm),
          height: Math.max(1, (80 * hold.window_mm) / highest),
          class: `gate ${hold.advice}`,
        }),
        svg('line', { x1: 0, x2: 1000, y1: 90, y2: 90, class: 'zero' }),
        svg('path', { d: path, class: 'trace' })));
    },
  };
}

/// The newest state, where no event has brought it yet; what an event brings meanwhile is newer.
export async function askMonitor() {
  const before = live.monitorAt;
  const monitor = await get('monitor', true).catch(() => null);
  if (monitor && live.monitorAt === before) live.hearMonitor(monitor);
}

/// Everything that the screen and the display in the room show of it.
export function monitorView() {
  const headline = h('p', { class: 'live-advice' });
  const reason = h('p', { class: 'live-why' });
  const oneSensor = h('p', { class: 'caution', hidden: true });
  const cautions = h('div', { class: 'live-cautions' },
    h('p', { class: 'caution' }, S.monitor.notBeam), oneSensor);
  const head = h('div', {}, h('div', { class: 'live-head' }, headline, cautions), reason);
  const tell = (tone, words, why) => {
    headline.className = `live-advice ${tone}`;
    headline.textContent = words;
    reason.textContent = why;
  };
  const numbers = h('div', { class: 'live-both' });
  const breath = trace();
  const map = liveMap();
  const element = h('div', { class: 'live-view' }, head, numbers,
    h('div', { class: 'live-pictures' }, breath.element, map.element));
  let saidLast = '';
  let drawn = '';
  let heard = null;
  let height_mm = null;
  const draw = () => {
    const monitor = presentOf(live.monitor, live.monitor ? since_s(live.monitorAt) : 0);
    // A height that grows old leaves a gap, and goes.
    if (live.monitor !== heard || (monitor?.breathing_mm ?? null) !== height_mm) {
      heard = live.monitor;
      height_mm = monitor?.breathing_mm ?? null;
      breath.add(monitor);
    }
    const text = S.monitor;
    const key = JSON.stringify([S.languageName, monitor?.advice, monitor?.state, monitor?.reason,
      monitor?.is_old, monitor?.couch_moved, monitor?.since_zero,
      monitor?.against_reference, monitor?.ended, monitor?.one_sensor_message]);
    if (key === drawn) return;
    drawn = key;
    element.classList.toggle('is-old', Boolean(monitor?.active && monitor.is_old));
    if (!monitor?.active) {
      tell('unknown', text.off, monitor?.ended ? said(monitor, 'ended') : '');
      clear(numbers);
      oneSensor.hidden = true;
      return;
    }
    const alone = monitor.one_sensor_message ? sentence(said(monitor, 'one_sensor')) : '';
    oneSensor.hidden = !alone;
    oneSensor.textContent = alone;
    const { state, advice } = monitor;
    const isStarting = state === 'mounting' || state === 'zeroing';
    const word = isStarting ? text.states[state] : text.advice[advice];
    const why = isStarting ? '' : state === 'moved_sensor' ? text.reasons.moved_sensor
      : text.reasons[monitor.reason] ?? '';
    if (isStarting) tell('info', word, '');
    else {
      tell(advice, `${kMarks[advice]} ${word}`,
        [text.states[state], why, monitor.couch_moved && text.couchMoved]
          .filter(Boolean).join(' · '));
    }
    const judgesReference = monitor.judges === 'against_reference';
    clear(numbers,
      judgesReference && six(text.againstReference, monitor.against_reference, monitor, true),
      six(text.sinceZero, monitor.since_zero, monitor, !judgesReference));
    const words = [word, why, alone].filter(Boolean).join(' ');
    if (words !== saidLast) say(words);
    saidLast = words;
  };
  const timer = setInterval(draw, kLook_ms);
  // An event may have come before the stream was there.
  const unlisten = live.listen((kind) => {
    if (kind === 'monitor') draw();
    else {
      const isOn = live.status?.state === 'monitoring';
      if (live.status && isOn !== Boolean(live.monitor?.active)) askMonitor();
    }
  });
  draw();
  return {
    element,
    stop() {
      clearInterval(timer);
      unlisten();
      map.stop();
    },
  };
}

const acceptedMark = ({ reason }) => (reason ? kMarks.out : kMarks.in);

/// A person signs what is shown now, where the settings let that accept a position.
function acceptance(settings) {
  const text = S.monitor;
  const accepted = h('p', { class: 'badge wide in_tolerance', hidden: true });
  const bySignature = settings?.accept_live === 'signature';
  const reason = h('input', { autocomplete: 'off', ...kReason });
  const sign = bySignature && may('accept') && signedForm({ class: 'form inline' },
    async (proof) => {
      const why = reason.value.trim();
      await post('monitor/accept', { ...(why && { reason: why }), ...proof() });
      reason.value = '';
      done(S.saved);
    }, h('button', { class: 'primary' }, text.accept), field(text.acceptReason, reason));
  const element = card(text.acceptTitle, hint(bySignature ? text.acceptBySignature
    : text.acceptBySweep), accepted, sign);
  return {
    element,
    draw(monitor) {
      element.hidden = !(monitor?.active && monitor.judges === 'against_reference');
      const last = monitor?.accepted;
      accepted.hidden = !last;
      accepted.textContent = last ? `${acceptedMark(last)} ${
        text.accepted(last.by, signedTime(last.at))}` : '';
    },
  };
}

/// The level of a breath hold is taught, and its window shown.
function breathHold() {
  const text = S.monitor;
  const isHeld = h('p', { class: 'lead' });
  const teach = action(text.teach, () => post('monitor/breath/teach'), {});
  const forget = action(text.forget, () => post('monitor/breath/forget'), {});
  const element = card(text.holdTitle, hint(text.holdHint), isHeld,
    may('scan') && h('div', { class: 'row' }, teach, forget), hint(text.breathScreen));
  return {
    element,
    draw(monitor) {
      element.hidden = !(monitor?.active && monitor.has_breathing);
      const hold = monitor?.breath_hold;
      forget.hidden = !hold;
      const words = hold ? `${text.holdIs(hold.level_mm, hold.window_mm)} · ${
        text.holdAdvice[hold.advice]}` : '';
      if (isHeld.textContent !== words) isHeld.textContent = words;
    },
  };
}

export async function showMonitor(place) {
  const text = S.monitor;
  const settings = await getOrNull('settings');
  const accept = acceptance(settings);
  const hold = breathHold();
  const view = monitorView();
  const start = action(text.start, () => post('monitor/start'), { class: 'primary giant' });
  const stop = action(text.stop, async () => {
    await post('monitor/stop');
    done(S.monitor.off);
  }, { class: 'danger giant' });
  // What it goes on without, such as its record on the disk.
  const warnings = h('ul', { class: 'caution', hidden: true });
  const drawWarnings = () => {
    const words = live.monitor?.active ? saidEach(live.monitor, 'warnings') : [];
    warnings.hidden = !words.length;
    redraw(warnings, words.map((one) => h('li', {}, sentence(one))));
  };
  const record = h('button', {
    class: 'quiet', type: 'button',
    onclick: () => saveFrom(
      `/api/v1/monitor/record.csv?language=${document.documentElement.lang}`,
      'plumb_monitoring.csv'),
  }, text.record);
  const latency = hint('');
  clear(place, h('h1', {}, text.title),
    h('section', { class: 'card' }, view.element, warnings, hint(text.motion)),
    may('scan') && h('div', { class: 'controls' }, start, stop), hint(text.hint),
    accept.element, hold.element, h('div', { class: 'row' }, record, latency));
  const draw = () => {
    const { status } = live;
    if (!status || !currentSession()) return;
    const isOn = status.state === 'monitoring';
    start.hidden = isOn;
    stop.hidden = !isOn;
    enable(start, live.connected && (status.state === 'ready' || status.state === 'result'));
    enable(stop, live.connected);
    record.hidden = !live.monitor?.has_record;
    drawWarnings();
    const ms = live.monitor?.active ? live.monitor.latency_p95_ms ?? null : null;
    latency.textContent = ms === null ? '' : text.latency(ms);
    const now = presentOf(live.monitor, live.monitor ? since_s(live.monitorAt) : 0);
    accept.draw(now);
    hold.draw(now);
  };
  await askMonitor();
  draw();
  const unfollow = follow(draw, draw);
  return () => {
    unfollow();
    view.stop();
  };
}
