// SPDX-License-Identifier: Apache-2.0
// The screen in the room: one address that follows the button by itself. Sees, and changes nothing.
import {
  currentSession, get, getOrNull, live, loadSession, may, now, setLoggedOffHandler, since_s,
} from '../api.js';
import { couchVersion } from '../couch/axes.js';
import { clear, h, hint, say } from '../dom.js';
import { legend } from '../drawings/error_map.js';
import { isLanguage, keepLanguage, languageOf } from '../language.js';
import { compassOf, drawCropped, mapFrame, marksNote, viewOf } from '../drawings/map_frame.js';
import { loadMap, paintErrors } from '../drawings/maps.js';
import { sixNumbers, toleranceOf } from '../numbers.js';
import { chooseTheme } from '../preferences.js';
import { S, said, saidEach, textOf } from '../words.js';
import {
  acceptanceMark, ageText, cautionsOf, faultWords, findings, flagList, isAdvice, isCold,
  lastKnownNote, minutesOf, partsOf, sentence, sidesOf,
} from './common.js';
import { showFault, showLogin } from './login.js';
import { askMonitor, monitorView } from '../monitoring/monitor.js';
import { comparesWith } from './captured.js';
import {
  formingNumbers, hasOutline, preview, stepWords, surfaceIn, surfaceWords, toneOf,
} from './scan.js';
import { ageOf, validityNote, verdictStrip } from './verdict.js';

const kAsk_ms = 2000;
const kAskPresence_ms = 10000;
const kWho = 'room';
const kPartsShown = 3;
const kReasonsBelow = 2;  // besides the first, which is part of the verdict
const kSwap_s = 8;
const wait = (ms) => new Promise((ready) => { setTimeout(ready, ms); });

/// Null without a connection.
const claim = (secret) => fetch('/api/v1/displays/claim', {
  method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify({ secret }),
}).catch(() => null);

/// The key of a display that the provisioning file has paired, from /room#key=KEY. Browsers send
/// no server what follows the #; and it is not left in the address, where people could read it.
function takeKey() {
  const key = new URLSearchParams(location.hash.slice(1)).get('key');
  if (key) history.replaceState(null, '', location.pathname + location.search);
  return key;
}

/// Whether the key has paired this screen. One that is not known (any more) has not.
async function pairedBy(key) {
  const answer = await claim(key);
  if (!answer || answer.status >= 500) throw new Error('no answer');
  return answer.ok && (await answer.json()).paired;
}

/// Shows a code until an engineer has typed it on the page; then this screen has its cookie.
async function pair(main, logIn) {
  const text = S.room;
  for (;;) {
    const asked = await fetch('/api/v1/displays/pair', { method: 'POST' }).catch(() => null);
    if (!asked?.ok) {
      clear(main, h('h1', { class: 'visually-hidden' }, S.room.title),
        h('p', { class: 'card' }, S.noAnswer));
      await wait(2 * kAsk_ms);
      continue;
    }
    const { code, secret } = await asked.json();
    clear(main, h('section', { class: 'room pairing' }, h('h1', {}, text.pairTitle),
      h('p', { class: 'pair-code' }, code), h('p', { class: 'lead' }, text.pairText),
      hint(text.pairWaiting),
      logIn && h('button', { class: 'quiet', type: 'button', onclick: logIn }, S.login.title)));
    for (;;) {
      await wait(kAsk_ms);
      if (currentSession()) return;
      const answer = await claim(secret);
      if (!answer) continue;  // no connection: the code stays valid
      if (!answer.ok) break;  // its time is over: another code
      if ((await answer.json()).paired) {
        await loadSession();
        return;
      }
    }
  }
}

/// Who is open, and whether check and sensor let people scan.
/// @param isSaid  The large word below says already that no session is open.
/// @param isSwapped  Another patient's session has just taken the place of one.
/// @param isChecked  The answer below is that of a daily check.
function top(status, isSaid, isSwapped, isChecked) {
  const text = S.room;
  const { session, sensor } = status;
  const warm = !isCold(sensor.powered_s);
  const mark = (good, words) => h('li', { class: good ? 'good' : 'bad' }, words);
  const isCheck = isChecked
    || (status.scan?.purpose ?? status.next_purpose) === 'daily_check';
  return h('header', { class: 'room-top' },
    !isSaid && (isSwapped && !isCheck
      ? h('p', { class: 'room-code swapped', role: 'alert' },
        h('small', {}, text.anotherPatient), ' ', session.patient_code)
      : h('p', { class: 'room-code' }, isCheck ? S.purposes.daily_check
        : session?.patient_code ?? text.noSession)),
    !isCheck && session && h('p', { class: 'room-fraction' }, session.purpose === 'reference'
      ? S.purposes.reference : S.session.fraction(session.fraction),
    h('span', {}, ` · ${S.session.scans(session.num_scans)}`),
    session.reference && h('span', { class: 'room-reference' }, ` · ${comparesWith(session)}`)),
    !isCheck && session?.newer_reference && h('p', { class: 'room-newer caution', role: 'alert' },
      S.session.referenceNewer(session.newer_reference.version)),
    !isCheck && session && saidEach(status, 'peer_notes').map(
      (one) => h('p', { class: 'room-newer caution', role: 'alert' }, one)),
    h('ul', { class: 'room-marks' },
      mark(!status.check_overdue, status.check_failed ? text.checkFailed
        : status.check_overdue ? text.checkOverdue : text.checkDone),
      sensor.present && mark(warm, warm ? text.warm
        : text.warming(Math.floor(sensor.powered_s / 60), minutesOf(sensor.warm_up_s)))));
}

/// Short words are 10 cm high on a screen of 40 inches; others take the width that there is.
const sizeOf = (text) => (text.length > 9 ? ' long' : text.length > 7 ? ' wide' : '');
const word = (text, tone) => h('p', { class: `room-word ${tone}${sizeOf(text)}` }, text);

/// How much of the region was seen; where that cannot be known, whether new surface comes in.
function coverageWords(scan) {
  const { coverage = null, without_new_surface_s: still_s } = scan ?? {};
  return coverage === null ? surfaceWords(still_s)
    : S.room.covered(Math.round(100 * coverage));
}

function sweep(status, camera, seen) {
  const text = S.room;
  const { guidance, coverage } = status.scan ?? { guidance: 'none' };
  const percent = Math.round(100 * (coverage ?? 0));
  const known = coverage !== null && coverage !== undefined;
  const forming = formingNumbers(status.scan);
  return [
    word(text.words[guidance], toneOf(guidance)),
    text.hints[guidance] && h('p', { class: 'room-hint' }, text.hints[guidance]),
    h('div', { class: 'room-sweep' }, seen, h('div', { class: 'room-cover' },
      h('p', { class: 'room-percent' }, coverageWords(status.scan)),
      known && h('progress', { max: 1, value: coverage, 'aria-label': text.covered(percent) }),
      !forming && camera)),  // the numbers need its place
    forming];
}

const computing = (status) => [word(S.room.computing, 'info'),
  h('progress', {
    max: 1, value: status.scan?.step_fraction ?? 0, 'aria-label': S.room.computing,
  }),
  h('p', { class: 'room-hint' }, stepWords(status.scan))];

/// Whether the view between scans says that no session is open.
const saysNoSession = (status) => (status.state === 'ready' || status.state === 'result')
  && !status.session && status.next_purpose !== 'daily_check';

const wristband = ({ session }) => [word(S.room.wristband, 'info'),
  h('p', { class: 'room-hint' }, S.room.wristbandHint(session?.patient_code ?? ''))];

/// Whether people lie down now for a sweep that is compared with a reference.
const showsPosture = (status) => ['ready', 'result'].includes(status.state)
  && hasOutline(status) && status.press !== 'monitoring' && !status.wants_wristband;

function resting(status, camera) {
  const text = S.room;
  if (status.state === 'no_sensor') {
    return [word(text.sensorMissing, 'bad'),
      h('p', { class: 'room-hint' }, S.stateHints.no_sensor)];
  }
  if (status.state === 'fault') {
    return [word(text.fault, 'bad'),
      h('p', { class: 'room-hint' }, faultWords(status))];
  }
  if (status.wants_wristband) return wristband(status);
  const closed = saysNoSession(status);
  const siteHint = status.next_purpose !== 'daily_check' && status.session?.sweep_hint;
  return [word(closed ? text.noSession : text.ready, closed ? 'bad' : 'good'),
    siteHint && h('p', { class: 'room-hint site-hint' }, siteHint),
    h('p', { class: 'room-hint' }, closed ? text.openOne
      : status.press === 'monitoring' ? S.stateHints.at_rest : text.press),
    showsPosture(status) && h('div', { class: 'room-lying' }, camera)];
}

/// Posture comes first: what no move of the couch puts right.
function posture(scan) {
  if (!isAdvice(scan) || !scan.result.body) return null;
  const parts = saidEach(scan.result.body, 'after');
  return h('section', { class: 'room-posture' }, h('h2', {}, S.result.bodyAfter),
    parts.length > 0 && h('p', {}, S.result.bodyAfterHint),
    findings(parts.slice(0, kPartsShown)));
}

/// The result of the scan that has just ended, as large as it can be read.
function result() {
  const place = h('div', { class: 'room-result' });
  let shown = null;
  let note = null;
  let judge = () => {};
  let age = () => {};
  let id = null;
  // Whoever stands at the couch sees that the position was accepted on another screen.
  const accepted = h('p', { class: 'room-accepted', role: 'status' });
  const showAcceptance = (scan) => {
    accepted.textContent = scan?.accepted_by
      ? `${acceptanceMark(scan)} ${S.result.acceptedBy(scan.accepted_by)}` : '';
  };
  live.listen((kind) => {
    if (kind !== 'data' || id === null) return;
    getOrNull(`scans/${id}`).then((scan) => {
      if (scan && scan.id === id) showAcceptance(scan);
    });
  });
  const map = async (data, box) => {
    const { scan, reference } = data;
    if (!data.details?.alignment || !reference) return;
    const scene = await get(`scans/${reference.scan_id}/files/scene.json`, true);
    const [values, region] = await Promise.all([loadMap(scan.id, 'deviation'),
      loadMap(scan.id, 'region').catch(() => null)]);
    const grid = scene.heightmap;
    const view = viewOf(grid, region);
    const canvas = h('canvas', { class: 'still-map', role: 'img',
      'aria-label': S.result.mapPicture });
    const tolerance_mm = toleranceOf(reference).shift_mm;
    drawCropped(canvas, view, (whole) =>
      paintErrors(whole, values, tolerance_mm / 1000, region));
    const compass = compassOf(live.status?.room, sidesOf(scan, data.details),
      reference.plan.posture);
    clear(box, mapFrame({ grid, view, canvas, region, compass }), legend(tolerance_mm),
      marksNote(compass));
  };
  const load = async (scan, key) => {
    const received = now();
    const { reference, details, quality } = await partsOf(scan);
    if (shown !== key) return;
    const data = { scan, reference, details, quality, received, patient: scan.patient_id };
    note = validityNote(scan, received, false);
    const box = h('div', { class: 'room-map' });
    const reasons = scan.result?.verdict === 'no_answer'
      ? saidEach(scan.result, 'reasons').map(sentence) : [];
    const strip = h('div', { class: 'room-strip' });
    const six = isAdvice(scan) && h('section', {});
    let isValid = null;
    let couch = null;
    judge = (why) => {
      if (isValid === !why && couch === couchVersion()) return;
      isValid = !why;
      couch = couchVersion();
      clear(strip, scan.result ? verdictStrip(data, isValid) : withoutResult(scan));
      strip.querySelector('details')?.remove();  // a display has nothing to open it with
      if (six) {
        clear(six, h('h2', { class: 'visually-hidden' }, said(scan.result, 'about')),
          !scan.result.along_couch && h('p', { class: 'caution' }, S.result.roomUnknown),
          sixNumbers(scan.result, details, isValid));
      }
    };
    judge(note.tick());
    const ago = h('p', { class: 'room-age' });
    age = () => {
      const seconds = ageOf(scan, received);
      ago.textContent = Number.isFinite(seconds) ? S.room.scanned(ageText(seconds)) : '';
    };
    age();
    id = scan.id;
    showAcceptance(scan);
    clear(place, note.element, strip, !scan.result && flagList(scan, quality),
      reasons.length > 1 && h('ul', { class: 'room-reasons' },
        reasons.slice(1, 1 + kReasonsBelow).map((reason) => h('li', {}, reason))),
      h('div', { class: 'room-answer' }, six,
      h('div', { class: 'room-side' }, box, posture(scan), accepted, ago)));
    await map(data, box).catch(() => {});
    if (scan.result) say(S.result.verdicts[scan.result.verdict] ?? '');
  };
  // Nothing is shown without what is doubtful about it.
  const attempt = (scan, key) => load(scan, key).catch(() => {
    setTimeout(() => { if (shown === key) attempt(scan, key); }, kAsk_ms);
  });
  return {
    element: place,
    show(scan) {
      const key = scan ? `${scan.id} ${S.languageName}` : null;
      if (key !== shown) {
        shown = key;
        note = null;
        judge = () => {};
        age = () => {};
        id = null;
        clear(place);
        if (scan) attempt(scan, key);
      }
    },
    tick() {
      const why = note?.tick();
      if (note) judge(why);
      age();
      place.classList.toggle('is-old', Boolean(why));
    },
  };
}

function withoutResult(scan) {
  const text = S.room;
  if (scan.outcome !== 'done') {
    return h('section', { class: 'verdict no_answer' },
      h('p', { class: 'word' }, S.result.failed),
      h('p', { class: 'why' }, sentence(textOf(scan.failure_message, scan.failure) ?? '')));
  }
  const reference = scan.purpose === 'reference';
  return h('section', { class: 'verdict none' },
    h('p', { class: 'word' }, reference ? text.reference : text.unassigned),
    h('p', { class: 'why' }, reference ? text.referenceHint : S.result.noReference));
}

function checkResult(check) {
  const tone = { passed: 'in_tolerance', failed: 'move' }[check?.status] ?? 'no_answer';
  return h('section', { class: `verdict ${tone}` },
    h('p', { class: 'word' }, `${S.room.checkDoneTitle}: `, S.check.verdicts[check?.status] ?? ''),
    h('p', { class: 'why' }, sentence(saidEach(check, 'reasons')[0])), cautionsOf(check));
}

/// Draws what the appliance does now. What changes ten times a second is drawn again, the camera
/// and the result stay.
function display(main, speak) {
  const head = h('div', {});
  const offline = lastKnownNote('room-offline', 'alert', () => `${S.room.offline}. `);
  const body = h('div', { class: 'room-body' });
  // The code that proves to a log-in that somebody stands here, while others guess passwords.
  const presence = h('p', { class: 'room-presence', role: 'alert', hidden: true });
  const answer = result();
  const seen = h('div', { class: 'seen-so-far' });
  const showSurface = surfaceIn(seen);
  let watched = null;  // live monitoring
  let camera = null;
  let lastPurpose = null;  // of the last scan seen in the open session
  let lastSession;
  let drawn = '';
  let shownMarks = '';
  let patient = null;  // whose session was open last
  let swapped = null;  // when this one took the place of another patient's
  clear(main, h('section', { class: 'room' }, h('h1', { class: 'visually-hidden' }, S.room.title),
    offline.element, presence, head, body, answer.element));
  const withCamera = (wanted) => {
    if (wanted && !camera) camera = preview();
    if (!wanted && camera) {
      camera.stop();
      camera = null;
    }
  };
  let spoken = languageOf(kWho);
  /// In the language of whoever opened the session; without one, in that of this screen.
  const speakTo = (session) => {
    const wanted = isLanguage(session?.language) ? session.language : languageOf(kWho);
    if (wanted === spoken) return;
    spoken = wanted;
    speak(kWho, wanted).then(draw);
  };
  const draw = () => {
    const { status } = live;
    if (!status) return;
    const { session } = status;
    speakTo(session);
    if ((session?.id ?? null) !== lastSession) lastPurpose = null;
    lastSession = session?.id ?? null;
    lastPurpose = status.scan?.purpose ?? lastPurpose;
    main.classList.toggle('off', !live.connected);
    offline.draw();
    main.dataset.state = status.state;
    showSurface(status.state === 'scanning');
    const last = status.last_result;
    const isCheck = status.state === 'result' && lastPurpose === 'daily_check';
    // An answer is shown only in its own state: never during a sweep, nor in another session.
    const mine = last && (last.session_id ?? null) === lastSession;
    const visible = status.state === 'result' && !isCheck && mine ? last : null;
    withCamera(status.state === 'scanning' || (!visible && !isCheck && showsPosture(status)));
    const isSaid = !visible && !isCheck && saysNoSession(status);
    if (session && session.patient_id !== patient) {
      if (patient) swapped = now();
      patient = session.patient_id;
    }
    const isSwapped = Boolean(session && swapped && since_s(swapped) < kSwap_s);
    const marks = JSON.stringify([S.languageName, session, isSwapped, isSaid, isCheck,
      status.peer_notes, status.check_overdue,
      status.check_failed, status.next_purpose, status.sensor.present,
      Math.floor(status.sensor.powered_s / 60)]);
    if (marks !== shownMarks) {
      shownMarks = marks;
      clear(head, top(status, isSaid, isSwapped, isCheck));
    }
    if (status.state === 'monitoring') {
      answer.element.hidden = true;
      if (watched) return;
      watched = monitorView();
      askMonitor();
      clear(body, watched.element);
      drawn = '';
      return;
    }
    watched?.stop();
    watched = null;
    answer.show(visible);
    answer.element.hidden = !visible;
    answer.tick();
    if (visible) {
      clear(body, status.press === 'monitoring'
        ? h('p', { class: 'room-hint' }, S.stateHints.at_rest)
        : status.wants_wristband && h('p', { class: 'room-hint' },
          S.room.wristbandHint(session.patient_code)));
      drawn = '';
      return;
    }
    const { scan } = status;
    const fraction = status.state === 'scanning' ? scan?.coverage : scan?.step_fraction;
    const key = JSON.stringify([S.languageName, status.state, scan?.guidance,
      fraction === null, scan?.step, isCheck && status.last_check, faultWords(status),
      session?.id, status.next_purpose, status.press, status.wants_wristband,
      showsPosture(status)]);
    if (key === drawn && body.hasChildNodes()) {
      update(fraction);
      return;
    }
    drawn = key;
    const parts = status.state === 'scanning' ? sweep(status, camera?.element, seen)
      : status.state === 'working' ? computing(status)
        : isCheck ? [checkResult(status.last_check)] : resting(status, camera?.element);
    clear(body, parts);
    say(parts[0].textContent);
  };
  /// Updates what grows while the rest stays as it is.
  const update = (fraction) => {
    const bar = body.querySelector('progress');
    if (bar && fraction !== null && fraction !== undefined) bar.value = fraction;
    const percent = body.querySelector('.room-percent');
    if (percent) percent.textContent = coverageWords(live.status.scan);
  };
  live.listen(draw);
  setInterval(draw, 1000);
  const askPresence = async () => {
    const { code } = await get('displays/presence', true).catch(() => ({ code: null }));
    presence.hidden = !code;
    presence.textContent = code ? S.room.presence(code) : '';
  };
  if (currentSession()?.role === 'display') {
    setInterval(askPresence, kAskPresence_ms);
    askPresence();
  }
  live.open();
  draw();
}

/// @param screen  What is drawn once the display is paired, or somebody is logged in.
export async function showRoom(main, { speak, applyTheme }, screen = display) {
  document.documentElement.classList.add('room-page');
  const key = takeKey();
  const asked = new URLSearchParams(location.search);
  keepLanguage(kWho, asked.get('language'));
  await speak(kWho);
  chooseTheme(kWho, asked.get('theme'));
  applyTheme(kWho);
  document.title = `${S.room.title} · ${S.product}`;
  window.addEventListener('hashchange', () => location.reload());  // a key was typed in
  for (;;) {
    try {
      const { session, fault } = await loadSession();
      if (session && may('room')) break;
      if (fault) {
        await showFault(main, fault);
        continue;
      }
      if (key && await pairedBy(key)) {
        await loadSession();
        break;
      }
      await pair(main, () => showLogin(main, false, null, () => location.reload()));
      break;
    } catch {
      clear(main, h('h1', { class: 'visually-hidden' }, S.room.title),
        h('p', { class: 'card' }, S.offline));
      await wait(kAsk_ms);
    }
  }
  setLoggedOffHandler(() => location.reload());
  screen(main, speak);
}
