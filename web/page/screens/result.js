// SPDX-License-Identifier: Apache-2.0
// One result, from its verdict down to the pictures.
import { fileUrl, get, getOrNull, live, now, since_s } from '../api.js';
import { couchVersion } from '../couch/axes.js';
import { couchReadings } from '../couch/readings.js';
import { card, clear, h, hint, keepFocus, warn } from '../dom.js';
import { errorMap } from '../drawings/error_map.js';
import { compassOf, mapFrame, marksNote, viewOf } from '../drawings/map_frame.js';
import { loadMap, paintHeights } from '../drawings/maps.js';
import { sixNumbers, toleranceOf } from '../numbers.js';
import { trend } from '../drawings/trend.js';
import { S, said, saidEach } from '../words.js';
import { actions } from './accept.js';
import { capturedAgainst, capturedCard } from './captured.js';
import { findings, follow, isAdvice, partsOf, sentence } from './common.js';
import { meshView } from './mesh_view.js';
import { recordsOf } from '../monitoring/monitoring_record.js';
import { identity, validityNote, verdictStrip } from './verdict.js';

/// A status that arrived at most this long ago is used instead of a new request.
const kNew_s = 1;

/// The newest finished scan: of this run of the appliance, else the newest that is stored.
const newest = async (last) => last
  ?? (await get('scans?limit=20', true)).scans.find(({ outcome }) => outcome === 'done') ?? null;
const find = (id) => get(`scans/${id}`).catch((error) => {
  throw error.status === 404 ? new Error(S.result.gone) : error;
});

/// Everything that the screen shows of one scan, which came at `received`.
async function collect(scan, received) {
  const isReference = scan.purpose === 'reference' && scan.patient_id && scan.outcome === 'done';
  const [parts, patient, history, references] = await Promise.all([partsOf(scan),
    scan.patient_id ? getOrNull(`patients/${scan.patient_id}`) : null,
    scan.patient_id ? getOrNull(`patients/${scan.patient_id}/scans`) : null,
    isReference ? getOrNull(`patients/${scan.patient_id}/references`) : null]);
  return {
    scan: { ...scan, details: parts.details }, received, patient, ...parts,
    captured: await capturedAgainst(parts.reference),
    history: history?.scans ?? [],
    draft: references?.references.find(({ scan_id: id }) => id === scan.id) ?? null,
  };
}

/// How good the scan and its comparison are, as the appliance judges them.
function trust({ quality }) {
  const row = (label, value, tone) => h('div', { class: tone }, h('dt', {}, label),
    h('dd', {}, value));
  const remarks = saidEach(quality, 'remarks').map(sentence);
  return h('dl', { class: 'trust' },
    quality.rows.map((one) => row(said(one, 'name'), said(one, 'value'),
      one.is_caution ? 'caution' : '')),
    remarks.length > 0 && row(S.result.warnings, remarks.join(' '), 'caution whole-row'));
}

/// Reference and current surface from above; where the maps cannot be read, the picture that was
/// drawn for print.
function overlay(map, scan) {
  const text = S.result;
  if (!map?.overlay) {
    return h('div', { class: 'framed' }, h('img', {
      class: 'picture', src: fileUrl(scan.id, 'overlay.png'), alt: text.overlayAlt, loading: 'lazy',
    }));
  }
  const { element } = map.overlay();
  return h('div', {}, element, h('p', { class: 'keys below-map' },
    h('span', { class: 'key on-top-reference' }, text.referenceHigher),
    h('span', { class: 'key on-top-current' }, text.currentHigher),
    h('span', { class: 'key both' }, text.bothSame)));
}

/// Where on the body, in words: what lies high or low now, and what the correction will leave.
/// @param valid  Whether the result can be acted on; otherwise it only says what was found.
function bodyWords({ scan, details }, valid) {
  const text = S.result;
  if (!scan.result?.body || !details?.body || !isAdvice(scan)) return null;
  const [after, before] = ['after', 'now'].map((when) => saidEach(scan.result.body, when));
  const list = (title, note, words) => h('div', {}, h('h3', {}, title), note && hint(note),
    findings(words));
  return h('div', { class: 'body-part-words' },
    h('div', { class: 'body-words' },
      list(valid ? text.bodyAfter : text.bodyAfterThen,
        valid && after.length > 0 && text.bodyAfterHint, after),
      details.correction?.vertical_mm !== null
        && list(valid ? text.bodyNow : text.atThisScan, text.bodyNowHint, before)),
    details.body.named_by === 'room' && h('p', { class: 'caution' }, text.bodyByRoom),
    details.body.named_by === 'axes' && h('p', { class: 'caution' }, text.bodyByAxes));
}

/// Shows what the sweep saw, where there is nothing to compare it with.
function seen({ scan, scene }) {
  const canvas = h('canvas', { class: 'map', role: 'img', 'aria-label': S.result.heights });
  const grid = scene.heightmap;
  const compass = compassOf(live.status?.room, null);
  const place = h('div', {}, hint(S.loading));
  loadMap(scan.id, 'heightmap').then((map) => {
    paintHeights(canvas, map, grid.step);
    clear(place, mapFrame({ grid, view: viewOf(grid, null), canvas, compass }),
      marksNote(compass));
  }, (error) => clear(place, hint(error.message)));
  return place;
}

function numbersTitle({ result }, valid) {
  const text = S.result;
  if (result.verdict === 'in_tolerance') return valid ? text.remaining : text.remainingThen;
  if (result.verdict !== 'move') return text.measured;
  return valid ? text.numbers : text.numbersThen;
}

/// Verdict and numbers. What can no longer be acted on says what was found, and commands nothing.
function answer(data, valid) {
  const text = S.result;
  const { scan, details } = data;
  return [verdictStrip(data, valid),
    isAdvice(scan) && h('section', { class: 'correction' },
      h('h2', {}, numbersTitle(scan, valid), ' ', h('small', {}, said(scan.result, 'about'))),
      !scan.result.along_couch && h('p', { class: 'caution' }, text.roomUnknown),
      sixNumbers(scan.result, details, valid), valid && couchReadings(scan))];
}

/// The parts of the screen; pictures come later into their places.
function build(data, reload, id) {
  const text = S.result;
  const { scan, history, reference } = data;
  const mapped = Boolean(data.details?.alignment);
  const parts = {
    who: identity(data),
    note: validityNote(scan, data.received, Boolean(id)),
    other: h('p', { class: 'caution' }),
    words: h('div', {}),
    map: h('div', {}, hint(S.loading)),
    mesh: h('div', {}),
    records: h('div', {}),
    overlay: h('div', {}, hint(S.loading)),
    actions: actions(data, reload),
    fresh: h('div', { class: 'fresh' }),
    isValid: null,
  };
  /// Draws the answer again once it can no longer be acted on.
  parts.judge = (why) => {
    if (parts.isValid === !why && parts.couch === couchVersion()) return;
    parts.isValid = !why;
    parts.couch = couchVersion();
    clear(parts.fresh, answer(data, !why));
    clear(parts.words, bodyWords(data, !why));
  };
  const pictures = h('div', { class: mapped || data.scene?.heightmap ? 'halves' : '' },
    mapped && card(text.overlay, parts.overlay),
    !mapped && data.scene?.heightmap && card(text.heights, seen(data)),
    scan.outcome === 'done' && card(text.mesh, parts.mesh));
  parts.element = [h('h1', { class: 'visually-hidden' }, text.title), parts.who.element,
    parts.note.element, parts.other,
    parts.fresh,
    h('section', { class: 'card actions' }, parts.actions.element),
    data.details && data.quality && card(text.trust, trust(data)), parts.records,
    capturedCard(data.captured),
    mapped && card(text.where, parts.words, parts.map),
    pictures,
    scan.result && card(text.trend,
      !isAdvice(scan) && h('p', { class: 'caution' }, text.trendWithout),
      trend(history, toleranceOf(reference), isAdvice(scan)))];
  return parts;
}

/// Says where another patient is open by now.
function noteOther(place, patient) {
  const open = live.status?.session;
  const differs = open && patient && open.patient_id !== patient.id;
  const shown = differs ? open.patient_code : '';
  if (place.dataset.open === shown) return;
  place.dataset.open = shown;
  clear(place, differs && S.result.differentPatient(open.patient_code));
}

export async function showResult(place, id) {
  const text = S.result;
  let stopMesh = () => {};
  let tick = () => {};
  let turn = 0;
  let latest;  // id of the last result that was looked for; nothing: none was yet
  const load = async () => {
    const mine = ++turn;
    const received = now();
    let last = null;
    if (!id) {
      const isNew = latest === undefined && live.status && since_s(live.received) < kNew_s;
      const status = isNew ? live.status : await get('status', true);
      last = status.last_result;
      latest = last?.id ?? null;
      if (!isNew) live.take(status);  // its event may come later, and the result is judged by it
    }
    const found = id ? await find(id) : await newest(last);
    const data = found && await collect(found, received);
    if (mine !== turn) return;
    if (!data) {
      tick = () => {};
      clear(place, h('section', { class: 'card' }, h('h1', {}, text.none),
        h('p', {}, text.noneHint)));
      return;
    }
    const parts = build(data, load, id);
    keepFocus(place, () => clear(place, parts.element));
    tick = () => {
      parts.who.tick();
      const why = parts.note.tick();
      parts.judge(why);
      place.classList.toggle('is-old', Boolean(why));
      parts.actions.tick();
      noteOther(parts.other, data.patient);
    };
    tick();
    stopMesh();
    recordsOf(data.scan).then((records) => mine === turn && clear(parts.records, records));
    const tolerance = toleranceOf(data.reference);
    let map = null;
    if (data.details?.alignment && data.reference) {
      map = await errorMap(data.scan, data.reference, tolerance.shift_mm, parts.map);
      if (mine !== turn) return;
      clear(parts.map, map.element);
      clear(parts.overlay, overlay(map, data.scan));
    } else {
      clear(parts.map);
      clear(parts.overlay, overlay(null, data.scan));
    }
    const mesh = meshView(data, map, tolerance.shift_mm);
    clear(parts.mesh, mesh.element);
    stopMesh = mesh.stop;
  };
  const reload = () => load().catch((error) => {
    latest = '';  // the next status tries again
    warn(error.message);
  });
  const stop = follow((kind) => {
    const missed = kind === 'status' && latest !== undefined
      && (live.status.last_result?.id ?? null) !== latest;
    if (!id && (kind === 'result' || missed)) reload();
    else if (kind === 'status' || kind === 'connection') tick();
  }, () => tick());
  try {
    await load();
  } catch (error) {
    stop();
    throw error;
  }
  return () => {
    stop();
    stopMesh();
  };
}
