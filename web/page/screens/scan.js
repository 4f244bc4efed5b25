// SPDX-License-Identifier: Apache-2.0
// The sweep: guidance, coverage, the camera, and the button.
import {
  currentSession, fetchPicture, get, live, may, now, post, repeat, since_s,
} from '../api.js';
import { action, card, clear, done, enable, h, hint, say } from '../dom.js';
import { liveSurface } from '../drawings/live_surface.js';
import { referenceOutline } from '../drawings/outline.js';
import { sweepHelp } from '../help/drawings.js';
import { isAcknowledged, sessionLine, sessionName } from '../treatment.js';
import { wristbandForm } from '../wristband.js';
import { S, said } from '../words.js';
import {
  faultWords, follow, lastKnownNote, sentence, stateHere, stateHint,
} from './common.js';
import { six } from '../monitoring/monitor.js';

const kPreviewEvery_ms = 250;
const kOutlineEvery_ms = 400;
const kOutlineAgain_s = 2;
const kPreviewAgain_ms = 2000;  // without a picture
const kSecondTap_s = 0.8;

const bytesOf = (base64) => Uint8Array.from(atob(base64), (one) => one.charCodeAt(0));

/// Whether the next or running sweep is compared with a reference, so that its outline helps.
export const hasOutline = (status) => Boolean(status?.session?.reference)
  && (status.scan?.purpose ?? status.next_purpose) === 'fraction';

/// The camera's picture, as long as there is one, with the outline of the reference.
export function preview() {
  const text = S.status;
  const picture = h('img', { alt: text.previewAlt, hidden: true });
  const none = hint(text.noPreview);
  const outline = referenceOutline(picture);
  let url = null;
  let noOutline = null;  // when there was none
  const show = async (blob) => {
    const fresh = URL.createObjectURL(blob);
    picture.src = fresh;
    await picture.decode().catch(() => {});
    if (url) URL.revokeObjectURL(url);
    url = fresh;
    picture.hidden = false;
    none.hidden = true;
  };
  const stop = repeat(async () => {
    try {
      if (!live.status?.sensor.present) throw new Error();  // there is none to ask for
      if (hasOutline(live.status) && !(noOutline && since_s(noOutline) < kOutlineAgain_s)) {
        const found = await fetchPicture('preview/outline');
        if (found.ok) {
          const one = await found.json();
          await show(new Blob([bytesOf(one.picture)], { type: 'image/jpeg' }));
          // The session may be another one by now.
          const { reference } = live.status?.session ?? {};
          if (reference?.id === one.reference) outline.draw(one, reference.version);
          else outline.hide();
          return kOutlineEvery_ms;
        }
        noOutline = now();
      }
      outline.hide();
      const response = await fetchPicture('preview');
      if (!response.ok) throw new Error();
      await show(await response.blob());
      return kPreviewEvery_ms;
    } catch {
      picture.hidden = true;
      none.hidden = false;
      outline.hide();
      return kPreviewAgain_ms;
    }
  });
  return { element: h('figure', { class: 'preview' }, outline.element, none, outline.note), stop };
}

/// In `place` while a sweep goes on: the surface that grows. `follow(wanted)` with every status.
export function surfaceIn(place) {
  let surface = null;
  return (wanted) => {
    if (wanted === Boolean(surface)) return;
    surface?.stop();
    surface = wanted ? liveSurface() : null;
    clear(place, surface?.element);
  };
}

/// The numbers of what the sweep has seen so far; null before there are any.
export function formingNumbers(scan) {
  const { forming } = scan ?? {};
  return forming?.numbers && h('section', { class: 'forming' },
    six(S.scan.forming, forming.numbers, forming, false), hint(S.scan.formingHint));
}

/// Returns what the large button does now: its words and its request; nothing where it is off.
function offer(status) {
  const text = S.scan;
  const { fault_kind: fault } = status;
  const state = stateHere(status);
  if (state === 'scanning') return { label: text.stop, request: 'scan/end' };
  if (state === 'fault' && fault === 'scan') return { label: text.acknowledge, request: 'press' };
  if (state === 'working') return { label: S.states.working, request: '' };
  if (state === 'result') return { label: text.again, request: 'scan/start' };
  const canStart = state === 'ready' || state === 'monitoring';
  return { label: text.start, request: canStart ? 'scan/start' : '' };
}

function buttons() {
  const text = S.scan;
  let request = '';
  let tapped = null;
  let isAnswered = true;  // the button has changed since that tap
  const press = action('', async () => {
    // The second of two taps was meant for what the button said before, however late it changed.
    if (tapped && since_s(tapped) < kSecondTap_s) return;
    tapped = now();
    isAnswered = false;
    try {
      await post(request);
    } catch (error) {
      isAnswered = true;  // refused: what the button says next is no answer to this tap
      throw error;
    }
  }, { class: 'primary giant' });
  const discard = action(text.discard, async () => {
    await post('cancel');
    done(text.discarded);
  }, { class: 'danger' });
  const draw = (status) => {
    const next = offer(status);
    request = next.request;
    if (press.textContent !== next.label) {
      press.textContent = next.label;
      if (!isAnswered) tapped = now();
      isAnswered = true;
    }
    press.classList.toggle('stop', status.state === 'scanning');
    const isHeld = request === 'scan/start' && status.wants_wristband;
    enable(press, Boolean(request) && live.connected && isAcknowledged() && !isHeld);
    enable(discard, live.connected);
    const isOver = !['scanning', 'working'].includes(status.state);
    if (isOver && document.activeElement === discard) press.focus();
    discard.hidden = isOver;
  };
  return {
    draw, element: may('scan') ? h('div', { class: 'controls' }, press, discard) : h('div', {}),
  };
}

/// Without a reference, the total area to scan is not known; only whether new surface comes in.
export const surfaceWords = (still_s = 0) => S.scan.surface(Math.floor(still_s));

/// What is computed now.
export const stepWords = (scan) => S.scan.step[scan?.step?.replaceAll(' ', '_').toLowerCase()]
  ?? said(scan, 'step') ?? '';

export const toneOf = (advice) => (['none', 'enough'].includes(advice) ? 'good' : 'bad');

/// The tone and words of what the person who sweeps should do.
export function adviceOf(status) {
  if (status.state !== 'scanning') {
    return { hint: '', words: stateHint(status), tone: '' };
  }
  const advice = status.scan?.guidance ?? 'none';
  return {
    hint: advice, words: S.scan.guidance[advice], tone: toneOf(advice),
  };
}

/// @param what  "board" for a check that was opened to calibrate the room.
export async function showScan(place, what) {
  const text = S.scan;
  const camera = preview();
  const who = h('p', { class: 'lead who-line' });
  const headline = h('p', { class: 'headline' });
  const guidance = h('p', { class: 'guidance' });
  const siteHint = h('p', { class: 'lead site-hint' });
  const known = lastKnownNote('old-note');
  const caution = h('p', { class: 'caution' });
  const toResult = h('a', { class: 'button', href: '#/result', hidden: true }, text.toResult);
  const bar = h('progress', { max: 1, 'aria-label': text.coverage });
  const barText = h('p', { class: 'bar-text' });
  const facts = h('dl', { class: 'facts' });
  const seen = h('div', { class: 'seen-so-far' });
  const showSurface = surfaceIn(seen);
  const soFar = h('div', {});
  const help = sweepHelp();
  const control = buttons();
  const wristband = wristbandForm();
  const drawSession = sessionLine(who, { mayClose: may('scan') });
  const shown = {};

  clear(place, h('h1', { class: 'visually-hidden' }, text.title),
    h('div', { class: 'scan-grid' },
      h('section', { class: 'card sweep' }, who, known.element, headline, guidance, siteHint,
        caution, toResult, h('div', { class: 'bar' }, bar, barText), wristband.element,
        control.element, soFar),
      card(S.status.preview, camera.element, seen, facts, help)));

  const drawWho = (status) => {
    const isCheck = (status.scan?.purpose ?? status.next_purpose) === 'daily_check';
    const key = JSON.stringify([isCheck, status.session, status.peer_notes,
      status.state === 'scanning' || status.state === 'working']);
    if (shown.who === key) return;
    shown.who = key;
    if (isCheck) {
      const [name, sweep] = what === 'board' ? [S.room_calibration.title, S.room_calibration.sweep]
        : [S.purposes.daily_check, S.check.sweep];
      const isWaiting = !['scanning', 'working'].includes(status.state);
      clear(who, h('strong', { class: 'code-big' }, name), ` ${sweep}`,
        status.session && h('span', {}, S.session.afterCheck(sessionName(status.session))),
        may('scan') && isWaiting && action(S.check.leave, async () => {
          await post('checks/leave');
          done(S.check.left);
        }));
    } else drawSession();
  };
  const drawProgress = (status) => {
    const { scan, state } = status;
    const fraction = state === 'working' ? scan?.step_fraction : scan?.coverage;
    const isKnown = scan && fraction !== null && fraction !== undefined;
    bar.parentElement.hidden = !scan;
    if (isKnown) bar.value = fraction;
    else bar.removeAttribute('value');
    const percent = `${Math.round((fraction ?? 0) * 100)} %`;
    barText.textContent = state === 'working'
      ? `${stepWords(scan)} ${percent}`
      : isKnown ? `${text.coverage} ${percent}` : surfaceWords(scan?.without_new_surface_s);
    const advice = adviceOf(status);
    guidance.textContent = advice.words;
    guidance.dataset.tone = advice.tone;
    if (advice.tone === 'bad' && advice.hint !== shown.hint) say(advice.words);
    shown.hint = advice.hint;
    const forming = JSON.stringify([S.languageName, scan?.forming]);
    if (shown.forming !== forming) clear(soFar, formingNumbers(scan));
    shown.forming = forming;
    const pair = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
    clear(facts, scan ? [pair(text.time, text.seconds(scan.elapsed_s)),
      pair(text.keyframes, scan.keyframes),
      pair(text.tracked, `${scan.frames_tracked} / ${scan.frames + scan.frames_dropped}`),
      pair(text.dropped, scan.frames_dropped)] : []);
  };
  const draw = () => {
    const { status } = live;
    if (!status || !currentSession()) return;
    place.classList.toggle('off', !live.connected);
    known.draw();
    const state = stateHere(status);
    headline.textContent = S.states[state];
    headline.dataset.state = state;
    toResult.hidden = state !== 'result' || !status.last_result;
    control.draw(status);
    wristband.draw(status);
    showSurface(status.state === 'scanning');
    help.hidden = ['scanning', 'working'].includes(status.state);
    drawProgress(status);
    if (status.fault) guidance.textContent = faultWords(status);
    const isOurs = status.session && status.next_purpose !== 'daily_check';
    siteHint.textContent = isOurs && state !== 'working' ? status.session.sweep_hint ?? '' : '';
    const refused = status.next_purpose === 'reference' && status.state === 'ready';
    caution.textContent = refused ? sentence(said(status, 'reference_block') ?? '') : '';
    drawWho(status);
  };
  draw();
  if (!live.status) get('status', true).then((status) => live.take(status), () => {});
  const stop = follow(draw, known.draw);
  return () => {
    stop();
    showSurface(false);
    camera.stop();
  };
}
