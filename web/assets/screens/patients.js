import { get, live, may, post, remove } from '../api.js';
import { action, clear, done, enable, field, form, h, localTime, redraw, table, warn } from '../dom.js';
import { S } from '../strings.js';
import { outcomeBadge } from './common.js';

export async function showPatients(place) {
  const text = S.patients;
  const list = h('div', {});
  const search = h('input', { type: 'search', autocomplete: 'off' });
  const code = h('input', { required: true, maxlength: 32, pattern: '[A-Za-z0-9_\\-][A-Za-z0-9._\\-]*', autocomplete: 'off', spellcheck: 'false' });
  const site = h('input', { maxlength: 64, autocomplete: 'off' });
  let patients = [];

  const draw = () => {
    const wanted = search.value.trim().toLowerCase();
    const rows = patients.filter((patient) => patient.code.toLowerCase().includes(wanted)).map((patient) => h('tr', { class: patient.id === live.status?.patient_id ? 'chosen' : '' },
      h('td', {}, h('a', { href: `#/patient/${patient.id}` }, patient.code), patient.id === live.status?.patient_id && h('span', { class: 'badge here' }, text.isOpen)),
      h('td', {}, patient.site || S.none), h('td', {}, patient.num_scans), h('td', {}, patient.approved_reference_id ? `✓ ${text.approved}` : text.noReference), h('td', {}, localTime(patient.created_at))));
    redraw(list, rows.length ? table([text.code, text.site, text.scans, text.reference, text.added], rows, text.title) : h('p', { class: 'hint' }, text.empty));
  };
  const load = async () => {
    ({ patients } = await get('patients', true));
    draw();
  };
  search.addEventListener('input', draw);
  clear(place, h('h1', {}, text.title),
    h('section', { class: 'card' }, field(text.search, search), list),
    may('patients') && h('section', { class: 'card' }, h('h2', {}, text.add), form({ class: 'form inline' }, async () => {
      const { id } = await post('patients', { code: code.value.trim(), site: site.value.trim() });
      location.hash = `#/patient/${id}`;
    }, field(text.code, code, text.codeHint), field(text.site, site, text.siteHint), h('button', { class: 'primary' }, text.add))));
  await load();
  return live.listen((kind) => { if (kind === 'data') load().catch(() => {}); });
}

function openButtons(patient) {
  const text = S.patients;
  const reason = h('input', { maxlength: 200, autocomplete: 'off' });
  const open = (purpose) => async () => {
    await post(`patients/${patient.id}/open`, { purpose, reason: purpose === 'reference' ? reason.value.trim() : '' });
    done(text.opened(patient.code));
    location.hash = '#/scan';
  };
  const fraction = action(text.openFraction, open('fraction'), { class: 'primary' });
  enable(fraction, Boolean(patient.approved_reference_id));
  return h('div', { class: 'form' },
    h('p', { class: 'lead' }, text.confirmWho(patient.code)),
    h('div', { class: 'row' }, fraction, action(text.openReference, open('reference'), {})),
    !patient.approved_reference_id && h('p', { class: 'hint' }, text.needsReference),
    field(text.reason, reason));
}

function referenceTable(references) {
  const text = S.patients;
  if (!references.length) return h('p', { class: 'hint' }, text.noReferences);
  const rows = references.map((reference) => h('tr', {},
    h('td', {}, reference.version), h('td', {}, `${localTime(reference.created_at)}, ${reference.created_by}`), h('td', {}, reference.reason || S.none),
    h('td', {}, reference.approved_by ? `✓ ${text.approvedBy(reference.approved_by, localTime(reference.approved_at))}` : h('span', { class: 'badge move' }, text.draft)),
    h('td', {}, h('a', { class: 'button', href: `#/plan/${reference.id}`, 'aria-label': `${may('plan') ? text.plan : text.planView}, ${text.version} ${reference.version}` }, may('plan') ? text.plan : text.planView))));
  return table([text.version, text.made, text.reasonShort, text.state, S.action], rows, text.references);
}

function scanTable(scans) {
  const text = S.patients;
  if (!scans.length) return h('p', { class: 'hint' }, S.status.noScans);
  const rows = scans.map((scan) => h('tr', {}, h('td', {}, h('a', { href: `#/result/${scan.id}` }, localTime(scan.started_at))), h('td', {}, S.purposes[scan.purpose]), h('td', {}, outcomeBadge(scan)), h('td', {}, scan.accepted_by ? `✓ ${scan.accepted_by}` : S.none)));
  return table([text.when, text.purpose, text.outcome, text.accepted], rows, text.history);
}

function wipe(patient) {
  const text = S.patients;
  const code = h('input', { required: true, autocomplete: 'off', spellcheck: 'false' });
  return h('details', { class: 'card' }, h('summary', {}, text.wipe), h('p', {}, text.wipeText), form({ class: 'form inline' }, async () => {
    if (code.value !== patient.code) throw new Error(text.wipeText);
    await remove(`patients/${patient.id}`);
    location.hash = '#/patients';
  }, field(text.code, code), h('button', { class: 'danger' }, text.wipeSubmit)));
}

export async function showPatient(place, id) {
  const text = S.patients;
  const patient = await get(`patients/${id}`);
  const references = h('div', {});
  const scans = h('div', {});
  const load = async () => {
    const [found, history] = await Promise.all([get(`patients/${id}/references`, true), get(`patients/${id}/scans`, true)]);
    redraw(references, referenceTable(found.references));
    redraw(scans, scanTable(history.scans));
  };
  clear(place, h('h1', {}, patient.code, ' ', h('small', {}, patient.site)),
    may('scan') && h('section', { class: 'card' }, h('h2', {}, text.open), openButtons(patient)),
    h('section', { class: 'card' }, h('h2', {}, text.references), references),
    h('section', { class: 'card' }, h('h2', {}, text.history), scans),
    may('wipe') && wipe(patient));
  await load();
  return live.listen((kind) => { if (kind === 'data' || kind === 'result') load().catch((error) => warn(error.message)); });
}
