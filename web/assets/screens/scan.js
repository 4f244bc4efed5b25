import { get, live, may, now, post, since_s } from '../api.js';
import { action, clear, done, enable, h, redraw, say } from '../dom.js';
import { S } from '../strings.js';
import { faultWords } from './common.js';

const kPreviewEvery_ms = 250;
const kPreviewAnswer_ms = 5000;
const kSecondTap_s = 0.8;

/// The camera's picture, as long as there is one.
function preview() {
  const text = S.status;
  const picture = h('img', { alt: text.previewAlt, hidden: true });
  const none = h('p', { class: 'hint' }, text.noPreview);
  let stopped = false;
  let url = null;
  const next = async () => {
    if (stopped) return;
    try {
      const response = await fetch('/api/v1/preview', { headers: { 'X-Plumb-Background': '1' }, cache: 'no-store', signal: AbortSignal.timeout(kPreviewAnswer_ms) });
      if (!response.ok) throw new Error();
      const fresh = URL.createObjectURL(await response.blob());
      picture.src = fresh;
      await picture.decode().catch(() => {});
      if (url) URL.revokeObjectURL(url);
      url = fresh;
      picture.hidden = false;
      none.hidden = true;
      setTimeout(next, kPreviewEvery_ms);
    } catch {
      picture.hidden = true;
      none.hidden = false;
      setTimeout(next, 2000);
    }
  };
  next();
  return { element: h('figure', { class: 'preview' }, picture, none), stop: () => { stopped = true; } };
}

/// What the large button does now: its words and its request; nothing where it is off.
function offer({ state, fault_kind: fault }) {
  const text = S.scan;
  if (state === 'scanning') return { label: text.stop, request: 'scan/end' };
  if (state === 'fault' && fault === 'scan') return { label: text.acknowledge, request: 'press' };
  if (state === 'result') return { label: text.again, request: 'scan/start' };
  return { label: text.start, request: state === 'ready' ? 'scan/start' : '' };
}

function buttons() {
  const text = S.scan;
  let request = '';
  let tapped = null;
  const press = action('', async () => {
    if (tapped && since_s(tapped) < kSecondTap_s) return;  // the second of two was meant for what the button said before
    tapped = now();
    await post(request);
  }, { class: 'primary giant' });
  const discard = action(text.discard, async () => {
    await post('cancel');
    done(text.discarded);
  }, { class: 'danger' });
  const draw = (status) => {
    const next = offer(status);
    request = next.request;
    if (press.textContent !== next.label) press.textContent = next.label;
    press.classList.toggle('stop', status.state === 'scanning');
    enable(press, Boolean(request));
    const isOver = !['scanning', 'working'].includes(status.state);
    if (isOver && document.activeElement === discard) press.focus();
    discard.hidden = isOver;
  };
  return { draw, element: may('scan') ? h('div', { class: 'controls' }, press, discard) : h('div', {}) };
}

export async function showScan(place) {
  const text = S.scan;
  const camera = preview();
  const who = h('p', { class: 'lead who-line' });
  const headline = h('p', { class: 'headline' });
  const guidance = h('p', { class: 'guidance' });
  const bar = h('progress', { max: 1, 'aria-label': text.coverage });
  const barText = h('p', { class: 'bar-text' });
  const facts = h('dl', { class: 'facts' });
  const control = buttons();
  let patient = null;
  let shown = {};

  clear(place, h('h1', { class: 'visually-hidden' }, text.title),
    h('div', { class: 'scan-grid' },
      h('section', { class: 'card sweep' }, who, headline, guidance, h('div', { class: 'bar' }, bar, barText), control.element),
      h('section', { class: 'card' }, h('h2', {}, S.status.preview), camera.element, facts)));

  const drawWho = (status) => {
    const isCheck = (status.scan?.purpose ?? status.next_purpose) === 'daily_check';
    redraw(who, isCheck ? [h('strong', {}, S.purposes.daily_check), ` · ${S.check.sweep}`] : status.patient_id
      ? [`${text.patient} `, h('strong', {}, patient?.code ?? '…'), ` · ${S.purposes[status.next_purpose]} · ${text.counter}: ${status.scans_today}`]
      : [text.noPatient, ' ', h('a', { href: '#/patients' }, text.choose)]);
  };
  const drawProgress = (status) => {
    const { scan, state } = status;
    const fraction = state === 'working' ? scan?.step_fraction : scan?.coverage;
    const known = scan && fraction !== null && fraction !== undefined;
    bar.parentElement.hidden = !scan;
    if (known) bar.value = fraction;
    else bar.removeAttribute('value');
    barText.textContent = state === 'working' ? `${text.step[scan?.step] ?? scan?.step ?? ''} ${Math.round((fraction ?? 0) * 100)} %` : `${text.coverage} ${known ? `${Math.round(fraction * 100)} %` : text.unknownCoverage}`;
    const hint = state === 'scanning' ? scan?.guidance ?? 'none' : '';
    guidance.textContent = hint ? text.guidance[hint] : S.stateHints[state];
    guidance.dataset.tone = !hint ? '' : hint === 'none' ? 'good' : 'bad';
    if (hint && hint !== 'none' && hint !== shown.hint) say(text.guidance[hint]);
    shown.hint = hint;
    const pair = (name, value) => [h('dt', {}, name), h('dd', {}, value)];
    clear(facts, scan ? [pair(text.time, text.seconds(scan.elapsed_s)), pair(text.keyframes, scan.keyframes), pair(text.tracked, `${scan.frames_tracked} / ${scan.frames}`), pair(text.dropped, scan.frames_dropped)] : []);
  };
  const draw = () => {
    const { status } = live;
    if (!status) return;
    headline.textContent = S.states[status.state];
    headline.dataset.state = status.state;
    control.draw(status);
    drawProgress(status);
    if (status.fault) guidance.textContent = faultWords(status);
    drawWho(status);
    if (status.patient_id !== shown.patient) {
      shown.patient = status.patient_id;
      patient = null;
      if (status.patient_id) get(`patients/${status.patient_id}`, true).then((found) => { patient = found; drawWho(live.status); }, () => {});
    }
  };
  draw();
  const stop = live.listen(draw);
  return () => {
    stop();
    camera.stop();
  };
}
