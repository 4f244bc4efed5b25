import { fileUrl, get, getBytes, live, may, now, post, since_s } from '../api.js';
import { action, checkbox, clear, done, field, form, h, keepFocus, localTime, warn } from '../dom.js';
import { errorMap } from '../error_map.js';
import { paintHeights, readTiff } from '../maps.js';
import { sixNumbers } from '../numbers.js';
import { S } from '../strings.js';
import { trend } from '../trend.js';
import { ageText, verdictIcon } from './common.js';

const kOldAfter_s = 120;
const mm = (metres, digits = 1) => (1000 * metres).toFixed(digits);
/// NO ANSWER is a result, but none to act on: then no number, word or trend is shown that somebody could apply.
const isAdvice = (scan) => Boolean(scan.result?.correction) && scan.result.verdict !== 'no_answer';
const sentence = (reason = '') => `${reason.charAt(0).toUpperCase()}${reason.slice(1).replaceAll('+-', '±')}${/[.!]$/.test(reason) ? '' : '.'}`;
const optional = (path) => get(path, true).catch(() => null);

/// The newest finished scan: of this run of the appliance, else the newest that is stored.
const newest = async (last) => last ?? (await get('scans?limit=20', true)).scans.find((candidate) => candidate.outcome === 'done') ?? null;
const find = (id) => get(`scans/${id}`).catch((error) => { throw error.status === 404 ? new Error(S.result.gone) : error; });

/// Everything that the screen shows of one scan, which came at `received`.
async function collect(scan, received) {
  const [patient, reference, details, scene, history] = await Promise.all([
    scan.patient_id ? optional(`patients/${scan.patient_id}`) : null, scan.reference_id ? optional(`references/${scan.reference_id}`) : null, scan.result ? optional(`results/${scan.id}`) : null,
    optional(`scans/${scan.id}/files/scene.json`), scan.patient_id ? optional(`patients/${scan.patient_id}/scans`) : null]);
  return { scan: { ...scan, details }, received, patient, reference, details, scene, history: history?.scans ?? [] };
}

function head({ scan, patient, reference, received }) {
  const text = S.result;
  const age = h('strong', {});
  const item = (label, ...value) => h('div', {}, h('dt', {}, label), h('dd', {}, ...value));
  const element = h('dl', { class: 'identity' },
    item(text.patient, h('strong', { class: 'code' }, patient ? h('a', { href: `#/patient/${patient.id}` }, patient.code) : S.none)),
    item(text.reference, reference ? `${text.version(reference.version)}, ${localTime(reference.created_at)}` : S.none),
    item(text.scanned, localTime(scan.started_at)),
    item(text.age, age));
  const tick = () => {
    const last = live.status?.last_result;
    const told = last?.id === scan.id ? { age_s: last.age_s, at: live.received } : { age_s: scan.age_s, at: received };
    const seconds = (told.age_s ?? Infinity) + since_s(told.at);  // what nobody knows the age of is old
    age.textContent = Number.isFinite(seconds) ? ageText(seconds) : S.none;
    return seconds > kOldAfter_s;
  };
  return { element, tick };
}

function verdictStrip({ scan }) {
  const text = S.result;
  const { result } = scan;
  if (!result) {
    const words = { failed: text.failed, cancelled: text.cancelled }[scan.outcome] ?? text.noReference;
    return h('section', { class: 'verdict none' }, h('p', { class: 'word' }, S.purposes[scan.purpose]), h('p', { class: 'why' }, scan.failure ? `${words}: ${scan.failure}` : words));
  }
  // The first reason decides; a wall of text is read by nobody.
  const [first, ...others] = result.verdict === 'no_answer' ? result.reasons : [text.why[result.verdict]];
  return h('section', { class: `verdict ${result.verdict}` },
    h('p', { class: 'word' }, h('span', { class: 'icon', 'aria-hidden': 'true' }, verdictIcon(result.verdict)), text.verdicts[result.verdict]), h('p', { class: 'why' }, sentence(first)),
    others.length > 0 && h('details', { class: 'other-reasons' }, h('summary', {}, text.otherReasons(others.length)), h('ul', {}, others.map((reason) => h('li', {}, sentence(reason))))));
}

function trust({ details, scene }) {
  const text = S.result;
  const rows = [];
  const add = (label, value, tone = '') => { if (value !== null && value !== undefined) rows.push(h('div', { class: tone }, h('dt', {}, label), h('dd', {}, value))); };
  const { alignment, motion, region } = details ?? {};
  add(text.markers, alignment && `${alignment.markers_used.length}`);
  add(text.markerRms, alignment && `${mm(alignment.rms_m, 2)} mm`);
  add(text.coverage, region && `${(100 * region.coverage).toFixed(1)} %`, region && region.coverage < 0.9 ? 'caution' : '');
  add(text.hole, region && `${mm(region.largest_hole_m, 0)} mm`, region && region.largest_hole_m > 0.05 ? 'caution' : '');
  add(text.residual, motion && text.medianAnd95(mm(motion.residual_m.median), mm(motion.residual_m.p95)));
  add(text.views, scene && `${scene.keyframes}`);
  add(text.frames, scene && `${scene.frames.tracked} / ${scene.frames.total}`);
  add(text.lost, scene?.longest_lost_s > 0 ? `${scene.longest_lost_s.toFixed(1)} s` : null, 'caution');
  add(text.depthScale, scene?.calibration?.depth_scale && `${(100 * (scene.calibration.depth_scale - 1)).toFixed(2)} %`);
  add(text.sensorOn, live.status?.sensor.present ? S.result.minutes(Math.floor(live.status.sensor.powered_s / 60)) : null);
  const rejected = Object.entries(alignment?.markers_rejected ?? {}).map(([id, residual]) => text.rejectedItem(id, mm(residual, 0)));
  add(text.rejected, rejected.length ? rejected.join(', ') : null, 'caution');
  const weak = (motion?.weak_directions ?? []).map((direction) => S.result.axes[direction.name] ?? direction.name);
  add(text.weak, weak.length ? weak.join(', ') : null, 'caution');
  const warnings = [...(details?.warnings ?? []), ...(scene?.warnings ?? [])];
  add(text.warnings, warnings.length ? warnings.join('; ') : null, 'caution');
  return h('dl', { class: 'trust' }, rows);
}

/// Reference and current surface from above; where the maps cannot be read, the picture that was drawn for print.
function overlay(map, scan) {
  const text = S.result;
  if (!map?.overlay) return h('div', { class: 'framed' }, h('img', { class: 'picture', src: fileUrl(scan.id, 'overlay.png'), alt: text.overlayAlt, loading: 'lazy' }));
  const canvas = h('canvas', { class: 'still-map', role: 'img', 'aria-label': text.overlayAlt });
  map.overlay(canvas);
  return h('div', {}, h('div', { class: 'map-box' }, canvas), h('p', { class: 'keys below-map' }, h('span', { class: 'key on-top-reference' }, text.referenceHigher), h('span', { class: 'key on-top-current' }, text.currentHigher), h('span', { class: 'key both' }, text.bothSame)));
}

/// Where on the body, in words: what lies high or low now, and what the correction will leave.
function bodyWords({ scan, details }) {
  const text = S.result;
  if (!scan.result?.body || !details?.body || !isAdvice(scan)) return null;
  const list = (title, hint, words) => h('div', {}, h('h3', {}, title), h('p', { class: 'hint' }, hint), h('ul', { class: 'findings' }, words.length ? words.map((word) => h('li', {}, word)) : h('li', { class: 'fine-part' }, `✓ ${text.asReference}`)));
  return h('div', { class: 'body-part-words' },
    h('div', { class: 'body-words' },
      list(text.bodyAfter, text.bodyAfterHint, scan.result.body.after),
      details.correction?.vertical_mm !== null && list(text.bodyNow, text.bodyNowHint, scan.result.body.now)),
    details.body.named_by === 'room' && h('p', { class: 'caution' }, text.bodyByRoom));
}

/// What the sweep saw, where there is nothing to compare it with.
function seen({ scan, scene }) {
  const canvas = h('canvas', { class: 'map', role: 'img', 'aria-label': S.result.heights });
  const box = h('div', { class: 'map-box' }, canvas);
  getBytes(`scans/${scan.id}/files/heightmap.tiff`).then(readTiff).then((map) => paintHeights(canvas, map, scene.heightmap.step), () => clear(box));
  return box;
}

function meshView({ scan, reference, details }, map, tolerance_mm) {
  const text = S.result;
  const place = h('div', { class: 'mesh-place' });
  let view = null;
  const open = action(text.meshOpen, async () => {
    place.classList.remove('waiting');
    clear(place, h('p', { class: 'hint' }, text.meshLoading));
    const canvas = h('canvas', { class: 'mesh', tabindex: '0', role: 'application', 'aria-label': text.meshLabel });
    const ghost = checkbox(text.ghost, false, {});
    try {
      if (!document.createElement('canvas').getContext('webgl2')) throw new Error(text.meshFailed);
      const { openMesh } = await import('../mesh.js');
      clear(place, canvas, reference && ghost.element);
      view = await openMesh(canvas, { url: fileUrl(scan.id, 'mesh.ply'), grid: map?.grid, deviation: map?.deviation, region: map?.region, T: details?.alignment?.T_reference_current, tolerance_m: tolerance_mm / 1000 });
      canvas.dataset.ready = 'yes';
      ghost.box.addEventListener('change', () => view.setGhost(ghost.box.checked ? fileUrl(reference.scan_id, 'mesh.ply') : null).catch((error) => warn(error.message)));
    } catch {
      clear(place, h('p', { class: 'hint' }, text.meshFailed));
    }
  }, {});
  place.classList.add('waiting');
  clear(place, open, h('p', { class: 'hint' }, text.meshHint));
  return { element: place, stop: () => view?.stop() };
}

function closing({ scan, patient }, reload) {
  const text = S.result;
  const reason = h('input', { maxlength: 200, autocomplete: 'off' });
  const rescan = may('scan') && patient && action(text.rescan, async () => {
    const purpose = scan.purpose === 'reference' ? 'reference' : 'fraction';
    if (live.status?.patient_id !== patient.id || live.status.next_purpose !== purpose) await post(`patients/${patient.id}/open`, { purpose, reason: '' });
    location.hash = '#/scan';
  }, { class: 'primary' });
  const accept = scan.accepted_by ? h('p', { class: 'badge in_tolerance' }, `✓ ${text.acceptedBy(scan.accepted_by)}`) : may('accept') && scan.result && scan.result.verdict !== 'no_answer' && action(text.accept, async () => {
    await post(`scans/${scan.id}/accept`);
    done(S.saved);
    await reload();
  }, {});
  const files = h('ul', { class: 'files' }, Object.entries(text.files).filter(([name]) => scan.result || !/result|map\.png|overlay|deviation|distance/.test(name)).map(([name, label]) => h('li', {}, h('a', { href: fileUrl(scan.id, name, true), download: '' }, label))));
  return h('div', {},
    h('div', { class: 'row' }, rescan, accept, scan.result && h('a', { class: 'button', href: `/result?scan=${scan.id}` }, text.print)),
    may('plan') && scan.outcome === 'done' && form({ class: 'form inline' }, async () => {
      const { id } = await post('references', { scan_id: scan.id, reason: reason.value.trim() });
      location.hash = `#/plan/${id}`;
    }, field(text.newReferenceReason, reason), h('button', {}, text.newReference)),
    h('details', {}, h('summary', {}, text.export), files));
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
      ({ last_result: last } = await get('status', true));
      latest = last?.id ?? null;
    }
    const found = id ? await find(id) : await newest(last);
    const data = found && await collect(found, received);
    if (mine !== turn) return;
    if (!data) {
      tick = () => {};
      clear(place, h('section', { class: 'card' }, h('h1', {}, text.none), h('p', {}, text.noneHint)));
      return;
    }
    const { scan, reference, patient, history } = data;
    const mapped = Boolean(data.details?.alignment);
    const tolerance = reference?.plan.tolerance ?? { shift_mm: 3, rotation_deg: 1 };
    const identity = head(data);
    const old = h('p', { class: 'old-note', role: 'status' });
    const other = h('p', { class: 'caution' });
    const card = (title, ...content) => h('section', { class: 'card' }, h('h2', {}, title), ...content);
    const mapPlace = h('div', {}, h('p', { class: 'hint' }, S.loading));
    const meshPlace = h('div', {});
    const overlayPlace = h('div', {}, h('p', { class: 'hint' }, S.loading));
    keepFocus(place, () => clear(place, h('h1', { class: 'visually-hidden' }, text.title), identity.element, old, other, h('div', { class: 'fresh' }, verdictStrip(data), isAdvice(scan) && h('section', { class: 'correction' }, h('h2', {}, text.numbers, ' ', h('small', {}, text.atIsocentre)), sixNumbers(scan.result, reference, data.details))),
      data.details && card(text.trust, trust(data)),
      mapped && card(text.where, bodyWords(data), mapPlace),
      h('div', { class: mapped || data.scene?.heightmap ? 'halves' : '' }, mapped && card(text.overlay, overlayPlace), !mapped && data.scene?.heightmap && card(text.heights, seen(data)), scan.outcome === 'done' && card(text.mesh, meshPlace)),
      scan.result && card(text.trend, !isAdvice(scan) && h('p', { class: 'caution' }, text.trendWithout), trend(history, tolerance)),
      h('section', { class: 'card actions' }, closing(data, load))));
    tick = () => {
      const aged = identity.tick();
      const isOld = Boolean(scan.result) && aged;
      place.classList.toggle('is-old', Boolean(isOld));
      if (old.dataset.shown !== String(isOld)) {
        old.dataset.shown = String(isOld);
        clear(old, isOld ? [h('strong', {}, text.old), ' ', text.oldText] : '');
      }
      const open = live.status?.patient_id;
      const differs = open && patient && open !== patient.id;
      if (!differs) clear(other);
      else if (other.dataset.open !== open) get(`patients/${open}`, true).then((found) => clear(other, text.differentPatient(found.code)), () => {});
      other.dataset.open = differs ? open : '';
    };
    tick();
    stopMesh();
    let map = null;
    if (mapped && reference) {
      map = await errorMap(scan, reference, tolerance.shift_mm);
      if (mine !== turn) return;
      clear(mapPlace, map.element);
      clear(overlayPlace, overlay(map, scan));
    } else {
      clear(mapPlace);
      clear(overlayPlace, overlay(null, scan));
    }
    const mesh = meshView(data, map, tolerance.shift_mm);
    clear(meshPlace, mesh.element);
    stopMesh = mesh.stop;
  };
  const timer = setInterval(() => tick(), 1000);
  const follow = () => load().catch((error) => {
    latest = '';  // the next status tries again
    warn(error.message);
  });
  const stop = live.listen((kind) => {
    const missed = kind === 'status' && latest !== undefined && (live.status.last_result?.id ?? null) !== latest;
    if (!id && (kind === 'result' || missed)) follow();
    else if (kind === 'status') tick();
  });
  try {
    await load();
  } catch (error) {
    clearInterval(timer);
    stop();
    throw error;
  }
  return () => {
    clearInterval(timer);
    stop();
    stopMesh();
  };
}
