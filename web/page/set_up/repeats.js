// SPDX-License-Identifier: Apache-2.0
// Three sweeps of a thing that does not move: whether sensor and room keep what they state.
import { get, live, may, post } from '../api.js';
import {
  action, card, clear, done, enable, fixed, h, hint, localTime, row, rowHead, table,
} from '../dom.js';
import { kAxes, withUnit } from '../numbers.js';
import { adviceOf } from '../screens/scan.js';
import { sentence, stateHere } from '../screens/common.js';
import { S, said, saidEach } from '../words.js';

function judgement(judged, isDue) {
  const text = S.repeats;
  if (!judged) return h('p', { class: 'caution' }, text.never);
  const { held, of } = judged.intervals;
  const rows = kAxes.map(({ name, key, unit, shift }) => {
    const value = judged.scatter[key];
    return row(rowHead(S.result.axes[name]),
      value === null ? S.none : withUnit(fixed(value, shift ? 2 : 3), unit));
  });
  return [isDue && h('p', { class: 'caution' }, text.due),
    h('section', { class: `verdict ${judged.fit ? 'in_tolerance' : 'move'}` },
      h('p', { class: 'word' }, judged.fit ? text.fit : text.notFit),
      h('p', { class: 'when' },
        text.judged(localTime(new Date(1000 * judged.made_s).toISOString()), judged.user))),
    saidEach(judged, 'reasons').map((reason) => h('p', { class: 'caution' }, sentence(reason))),
    h('p', {}, text.held(held, of)), table([S.check.number, text.scatter], rows, text.scatter)];
}

/// One button for what comes next: a sweep, its end, or the judgement of all.
function nextStep(load) {
  const text = S.repeats;
  const line = h('p', { class: 'guidance', role: 'status' });
  const sweep = action('', async () => {
    await post(live.status.state === 'scanning' ? 'scan/end' : 'scan/start');
  }, { class: 'primary' });
  const judge = action(text.judge, async () => {
    await post('sensor-repeats', { serial: judge.dataset.serial });
    done(text.done);
    await load();
  }, { class: 'primary' });
  const draw = (now) => {
    const { status } = live;
    if (!status) return;
    const state = stateHere(status);
    const isRunning = ['scanning', 'working'].includes(state);
    const isFull = now.sweeps.length >= now.wanted && !isRunning;
    const isOther = status.session || status.next_purpose === 'daily_check';
    sweep.hidden = isFull;
    judge.hidden = !isFull;
    judge.dataset.serial = now.serial;
    sweep.textContent = state === 'scanning' ? S.scan.stop
      : text.sweep(Math.min(now.wanted, now.sweeps.length + 1), now.wanted);
    line.textContent = isOther ? text.closeFirst
      : state === 'scanning' ? adviceOf(status).words : isRunning ? S.states.working : '';
    enable(sweep, live.connected && !isOther && ['ready', 'result', 'scanning'].includes(state));
    enable(judge, live.connected);
  };
  return { element: [line, h('div', { class: 'row' }, sweep, judge)], draw };
}

export async function showRepeats(place) {
  const text = S.repeats;
  const found = h('div', {});
  const made = h('ol', { class: 'sweeps' });
  let now = null;
  let shown = '';
  const load = async () => {
    now = await get('sensor-repeats', true);
    const key = JSON.stringify([now, S.languageName]);
    if (key !== shown) {
      shown = key;
      clear(found, now.why_none ? h('p', { class: 'caution' }, sentence(said(now, 'why_none')))
        : judgement(now.judged, now.due));
      clear(made, now.sweeps.map(({ time }) => h('li', {}, `✓ ${localTime(time)}`)));
    }
    step.draw(now);
  };
  const step = nextStep(() => load());
  clear(place, h('h1', {}, text.title), hint(text.hint),
    may('scan') && card(text.steps, h('p', {}, text.how), made, step.element),
    card(text.found, found));
  await load();
  return live.listen((kind) => {
    if (kind === 'data' || kind === 'result') load().catch(() => {});
    else step.draw(now);
  });
}
