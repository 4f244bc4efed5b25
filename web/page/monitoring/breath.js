// SPDX-License-Identifier: Apache-2.0
// The screen for the person who holds their breath: a bar, an area to aim for, and few words. No
// number and no name.
import { live, since_s } from '../api.js';
import { clear, h, say, svg } from '../dom.js';
import { isLanguage, languageOf } from '../language.js';
import { S } from '../words.js';
import { askMonitor, presentOf } from './monitor.js';
import { showRoom } from '../screens/room.js';

const kWho = 'room';
const kLook_ms = 50;
const kHighest = 1.5;  // of the top of the area
const kTall = 1000;
const kMarks = { breatheIn: '↑', breatheOut: '↓', hold: '●', good: '✓' };

/// What to ask for; null where nothing is to be done.
function coachOf(monitor) {
  const hold = monitor?.active ? monitor.breath_hold : null;
  if (!hold) return null;
  const { breathing_mm: height } = monitor;
  if (hold.advice === 'unknown' || height === null) return { word: 'lost', height: null, hold };
  const off = height - hold.level_mm;
  const word = hold.advice === 'in' ? 'good' : Math.abs(off) <= hold.window_mm / 2 ? 'hold'
    : off < 0 ? 'breatheIn' : 'breatheOut';
  return { word, height, hold };
}

/// The bar, whose top is a little above the area: a higher breath stays at the top.
function bar({ word, height, hold }) {
  const top = kHighest * Math.max(1, hold.level_mm + hold.window_mm / 2);
  const at = (mm) => kTall * (1 - Math.min(1, Math.max(0, mm / top)));
  const upper = at(hold.level_mm + hold.window_mm / 2);
  const lower = at(hold.level_mm - hold.window_mm / 2);
  return svg('svg', {
    viewBox: `0 0 300 ${kTall}`, class: `breath-bar ${word}`, 'aria-hidden': 'true',
  },
    svg('rect', { class: 'tube', x: 60, y: 0, width: 180, height: kTall, rx: 30 }),
    height !== null && svg('rect', {
      class: 'air', x: 60, y: at(height), width: 180, height: kTall - at(height), rx: 30,
    }),
    svg('rect', { class: 'aim', x: 20, y: upper, width: 260, height: lower - upper, rx: 20 }),
    height !== null && svg('rect', {
      class: 'now', x: 40, y: at(height) - 8, width: 220, height: 16,
    }));
}

function display(main, speak) {
  const place = h('section', { class: 'breath' });
  clear(main, h('h1', { class: 'visually-hidden' }, S.breath.title), place);
  document.title = `${S.breath.title} · ${S.product}`;
  let drawn = '';
  let said = '';
  let spoken = languageOf(kWho);
  const draw = () => {
    const wanted = live.status?.session?.language;
    if (isLanguage(wanted) && wanted !== spoken) {
      spoken = wanted;
      speak(kWho, wanted).then(draw);
    }
    const isLost = !live.connected;
    const coach = coachOf(presentOf(live.monitor, live.monitor ? since_s(live.monitorAt) : 0));
    const key = JSON.stringify([S.languageName, isLost, coach]);
    if (key === drawn) return;
    drawn = key;
    const word = !coach ? 'wait' : isLost ? 'lost' : coach.word;
    const words = S.breath[word];
    clear(place, coach && bar({ ...coach, word, height: isLost ? null : coach.height }),
      h('div', { class: 'breath-words' },
        h('p', { class: `breath-word ${word}` }, kMarks[word] && h('span', {
          class: 'breath-mark', 'aria-hidden': 'true',
        }, kMarks[word]), words),
        coach && h('p', { class: 'breath-hint' }, S.breath.area)));
    if (words !== said) say(words);
    said = words;
  };
  live.listen((kind) => {
    const isOn = live.status?.state === 'monitoring';
    if (kind !== 'monitor' && live.status && isOn !== Boolean(live.monitor?.active)) askMonitor();
    draw();
  });
  setInterval(draw, kLook_ms);
  live.open();
  draw();
}

export const showBreath = (main, tools) => showRoom(main, tools, display);
