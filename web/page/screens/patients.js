// SPDX-License-Identifier: Apache-2.0
// Patients, their references and scans, and the treatment session that people open here.
import { get, getOrNull, live, may, post, put, removeFor } from '../api.js';
import {
  action, card, clear, done, enable, field, form, h, hint, localTime, redraw, row, say, signedTime,
  select, table, warn,
} from '../dom.js';
import { silhouette } from '../drawings/silhouette.js';
import { guardLeaving } from '../leave.js';
import { kFraction, kName, kNote, kReason, kSite } from '../limits.js';
import { numbersLine, toleranceOf } from '../numbers.js';
import { lookOf, plainCode } from '../scanner.js';
import { signedForm } from '../signed_form.js';
import { S, said } from '../words.js';
import { closeSession, openPatient, resumeSession } from '../treatment.js';
import { sourceVersion } from './captured.js';
import { setUpCard, setUpNote } from './patient/set_up_sheet.js';
import { courseStatistics } from './patient/statistics.js';
import { planningUpload } from './planning.js';
import {
  acceptanceMark, ageText, blockNote, isAdvice, outcomeBadge, sentence, whenSettled,
} from './common.js';

const waitsFor = ({ planned_by: planner }) =>
  (planner ? S.patients.waits : S.patients.waitsForPlan);

function referenceState(patient) {
  const text = S.patients;
  const draft = patient.draft_reference_id;
  const told = live.status?.waiting.find(({ reference_id: id }) => id === draft);
  const approved = patient.approved_reference_id && `✓ ${text.approved}`;
  const waits = draft && h('a', { href: `#/plan/${draft}`, class: 'badge move' },
    told ? waitsFor(told) : text.draft);
  return approved || waits ? [approved, approved && waits && ' ', waits] : text.noReference;
}

/// What a person may do with an appointment of today. Nothing here changes a session that is open:
/// that of another patient has to be closed first.
/// @param patient  As the list of patients has it; undefined: archived, or not loaded yet.
function todaysAction(patient) {
  const text = S.patients;
  const session = live.status?.session;
  if (!patient || !may('scan')) return S.none;
  if (session?.patient_id === patient.id) {
    return [h('span', { class: 'badge here' }, text.isOpen), ' ',
      h('a', { href: '#/scan' }, S.status.goScan)];
  }
  if (!patient.approved_reference_id) return h('span', { class: 'hint' }, text.needsReference);
  if (session) return h('span', { class: 'hint' }, text.todayOther(session.patient_code));
  return action(text.openFraction, async () => {
    const now = await get(`patients/${patient.id}`);
    // Whether a fraction goes on or a new one begins is asked on the patient's own page.
    if (now.last_session || live.status?.session) {
      location.hash = `#/patient/${patient.id}`;
      return;
    }
    await openPatient(patient, 'fraction', {});
    location.hash = '#/scan';
  }, { 'aria-label': `${text.openFraction}, ${patient.code}` });
}

/// Whom the clinic's worklist expects today. Sessions open by a person's tap only.
/// @param find  From an identifier to the patient.
/// @param add  Leads to where an unknown patient is added; undefined: the person may not.
function todaysList(find, add) {
  const text = S.patients;
  const element = h('section', { class: 'card', hidden: true });
  let found = null;
  const draw = () => {
    if (!found) return;
    element.hidden = !found.is_on;
    const rows = found.patients.map((one) => row(one.time || S.none,
      h('a', { href: `#/patient/${one.patient_id}` }, one.patient_code),
      todaysAction(find(one.patient_id))));
    const nobody = found.is_settled ? text.nobodyToday : text.todayAsked;
    redraw(element, h('h2', {}, text.today),
      found.fault && h('p', { class: 'caution' }, sentence(said(found, 'fault'))),
      rows.length ? table([text.todayTime, text.code, S.action], rows, text.today)
        : !found.fault && hint(nobody),
      found.unknown > 0 && hint(text.todayUnknown(found.unknown)),
      found.unknown > 0 && add && h('div', { class: 'row below' }, action(text.add, add, {})));
  };
  const load = () => whenSettled('worklist', element, (now) => {
    found = now;
    draw();
  });
  return { element, draw, load };
}

export async function showPatients(place) {
  const text = S.patients;
  const list = h('div', {});
  const search = h('input', { type: 'search', autocomplete: 'off', spellcheck: 'false' });
  const missed = h('p', { class: 'caution' });
  const code = h('input', {
    required: true, pattern: '[A-Za-z0-9_\\-][A-Za-z0-9._\\-]*', autocomplete: 'off',
    spellcheck: 'false', 'data-code': '',
  });
  let confirmed = '';  // a code that looks like another one, and is to be added
  const site = h('input', { autocomplete: 'off', ...kSite });
  const archived = h('input', { type: 'checkbox' });
  let patients = [];

  const wanted = () => search.value.trim().toLowerCase();
  const matching = () => patients.filter((patient) => (archived.checked || !patient.archived)
    && patient.code.toLowerCase().includes(wanted()));
  const patientRow = (patient) => {
    const isOpen = patient.id === live.status?.session?.patient_id;
    const element = row([h('a', { href: `#/patient/${patient.id}` }, patient.code),
      isOpen && h('span', { class: 'badge here' }, text.isOpen),
      patient.archived && h('span', { class: 'badge' }, text.archived)],
    patient.site || S.none, patient.num_scans, referenceState(patient),
    localTime(patient.created_at));
    element.classList.toggle('chosen', isOpen);
    return element;
  };
  const draw = () => {
    const rows = matching().map(patientRow);
    redraw(list, rows.length
      ? table([text.code, text.site, text.scans, text.reference, text.added], rows, text.title)
      : hint(wanted() ? text.noMatch(search.value.trim()) : text.empty));
  };
  const load = async () => {
    // The state says which drafts wait for what.
    [{ patients }] = await Promise.all([get('patients', true), live.refreshed()]);
    draw();
    today.draw();
  };
  search.addEventListener('input', () => {
    missed.textContent = '';
    draw();
  });
  archived.addEventListener('change', draw);
  // A scanner of wristbands types the code and Enter. Only the whole code opens a patient: a part
  // of one may be another patient's.
  search.addEventListener('keydown', (event) => {
    if (event.key !== 'Enter' || !wanted()) return;
    const found = patients.find((patient) => patient.code.toLowerCase() === wanted())
      ?? patients.find((patient) => plainCode(patient.code) === plainCode(wanted()));
    if (found) {
      location.hash = `#/patient/${found.id}`;
      return;
    }
    missed.textContent = matching().length ? text.noMatch(search.value.trim()) : '';
    say(text.noMatch(search.value.trim()));
    search.select();  // or the next code would be added to this one
  });
  const toForm = async () => {
    code.focus();
    code.scrollIntoView({ block: 'center' });
  };
  const today = todaysList((id) => patients.find((one) => one.id === id && !one.archived),
    may('patients') && toForm);
  // Before anything is drawn: codes that are typed are compared with the list.
  await load();
  clear(place, h('h1', {}, text.title), today.element,
    h('section', { class: 'card' }, field(text.search, search), missed, list,
      h('label', { class: 'check below' }, archived, ' ', text.showArchived),
      h('div', { class: 'row below' },
        h('a', { class: 'button', href: '#/statistics' }, S.statistics.title))),
    may('patients') && card(text.add,
      form({ class: 'form inline' }, async () => {
        const body = { code: code.value.trim(), site: site.value.trim() };
        // Not cut off, which would make another patient's code of it.
        if (body.code.length > kName.maxlength) {
          throw new Error(text.codeLong(kName.maxlength, body.code.length));
        }
        const alike = patients.filter((one) => lookOf(one.code) === lookOf(body.code)
          && plainCode(one.code) !== plainCode(body.code));
        if (alike.length && confirmed !== body.code) {
          confirmed = body.code;
          throw new Error(text.alike(body.code, alike.map((one) => one.code).join(', ')));
        }
        const { id } = await post('patients', body);
        location.hash = `#/patient/${id}`;
      }, field(text.code, code, text.codeHint), field(text.site, site, text.siteHint),
      h('button', { class: 'primary' }, text.add))));
  // Not where a keyboard on the screen would cover the list.
  if (!matchMedia('(pointer: coarse)').matches) search.focus({ preventScroll: true });
  today.load();
  return live.listen((kind) => {
    if (kind === 'data') load().catch(() => {});
    if (kind === 'status') today.draw();
  });
}

/// If another patient's session is open, it is named and closed by the same tap. A session that is
/// open already is not offered again.
/// @param references  Newest first; where a planning CT and a captured surface are approved, it is
/// chosen which one the fraction is compared with.
/// @return {element, draw}  Call draw() when the connection or the session has changed.
function openButtons(patient, references) {
  const text = S.patients;
  const reason = h('input', { autocomplete: 'off', maxlength: kReason.maxlength });
  const question = h('div', {});
  /// `begin(replaces)`, after a question where another patient's session ends by it.
  const beginWith = async (begin) => {
    const session = live.status?.session;
    if (!session || session.patient_id === patient.id) {
      await begin(session?.id ?? '');
      return;
    }
    clear(question, h('p', { class: 'lead caution' },
      S.session.replace(session.patient_code, patient.code)),
    h('div', { class: 'row' },
      action(S.session.replaceSubmit(session.patient_code, patient.code),
        () => begin(session.id), { class: 'danger' }),
      action(S.cancel, async () => clear(question), {})));
  };
  const open = (purpose) => async () => {
    // The reason for replacing an approved reference is recorded with the new one.
    const replacesOne = purpose === 'reference' && patient.approved_reference_id;
    if (replacesOne && reason.value.trim().length < kReason.minlength) {
      reason.focus();
      throw new Error(text.reasonNeeded);
    }
    await beginWith(async (replaces) => {
      await openPatient(patient, purpose, purpose === 'reference'
        ? { reason: reason.value.trim(), replaces } : { replaces, reference: choice?.value });
      location.hash = '#/scan';
    });
  };
  const approved = references.filter((one) => one.approved_by);
  const newest = Object.keys(text.sources)
    .map((source) => approved.find((one) => one.source === source)).filter(Boolean)
    .sort((a, b) => b.version - a.version);
  const choice = newest.length > 1 ? select(
    Object.fromEntries(newest.map((one) => [one.id, sourceVersion(one)])), newest[0].id) : null;
  let chosen = '';  // by a person: a session that is resumed goes on with its own otherwise
  choice?.addEventListener('change', () => { chosen = choice.value; });
  const compare = choice ? field(S.session.compareWith, choice) : h('div', {});
  const confirm = h('p', { class: 'lead who-confirmed' }, text.confirmWho(patient.code),
    silhouette(newest[0]));
  const sheet = setUpNote(patient) ?? h('div', {});
  const why = field(text.reason, reason);
  const { last_session: last } = patient;
  const fraction = action(last ? S.session.startNew : text.openFraction, open('fraction'),
    { class: last ? '' : 'start-session' });
  const since_s = last && Math.max(0, (Date.now() - Date.parse(last.closed_at)) / 1000);
  const resume = last && action(S.session.resume(last.fraction, ageText(since_s)),
    () => beginWith(async (replaces) => {
      await resumeSession(patient, last, { replaces, reference: chosen });
      location.hash = '#/scan';
    }), { class: 'start-session' });
  const reference = action(text.openReference, open('reference'), {});
  let blocked = null;
  // Without a connection it is not known whose session is open.
  const draw = () => {
    enable(fraction, live.connected && Boolean(patient.approved_reference_id));
    enable(reference, live.connected && !blocked);
    if (resume) enable(resume, live.connected);
    const { session, next_purpose: next } = live.status ?? {};
    const isOpen = (purpose) => session?.patient_id === patient.id && session.purpose === purpose
      && next === purpose;
    fraction.hidden = isOpen('fraction');
    if (resume) resume.hidden = fraction.hidden;
    compare.hidden = fraction.hidden;
    reference.hidden = isOpen('reference');
    confirm.hidden = fraction.hidden;  // who is open stands above
    sheet.hidden = fraction.hidden;
    why.hidden = reference.hidden;
  };
  const block = blockNote((now) => {
    blocked = now;
    draw();
  });
  const element = h('div', { class: 'form' },
    confirm, sheet, compare,
    h('div', { class: 'row' }, resume, fraction, reference), block, question,
    !patient.approved_reference_id && hint(text.needsReference),
    why);
  return { element, draw };
}

/// Site, note and archive: what people say of a course, and whether it is still in the list.
function aboutPatient(patient, reload) {
  const text = S.patients;
  const site = h('input', { autocomplete: 'off', value: patient.site, ...kSite });
  const note = h('textarea', { rows: 3, ...kNote });
  note.value = patient.note;
  const editable = may('patients');
  return card(text.about,
    editable ? form({ class: 'form' }, async () => {
      const body = {
        site: site.value.trim(), note: note.value.replace(/\s+/g, ' ').trim(),
        site_before: patient.site, note_before: patient.note,
      };
      try {
        await put(`patients/${patient.id}`, body);
      } catch (error) {
        if (error.status === 409) await reload();  // shows what somebody else has saved
        throw error;
      }
      done(S.saved);
      await reload();
    }, field(text.site, site, text.siteHint), field(text.note, note, text.noteHint),
    h('button', {}, S.save))
      : h('p', { class: 'note' }, patient.note || S.none),
    patient.archived && h('p', { class: 'caution' }, text.isArchived),
    may('plan') && h('div', { class: 'row below' },
      action(patient.archived ? text.unarchive : text.archive, async () => {
        await post(`patients/${patient.id}/archive`, { archived: !patient.archived });
        await reload();
      }, {}), !patient.archived && hint(text.archiveHint)));
}

function referenceTable(references) {
  const text = S.patients;
  if (!references.length) return hint(text.noReferences);
  const plan = may('plan') ? text.plan : text.planView;
  const rows = references.map((reference) => row(reference.version,
    text.sources[reference.source],
    `${localTime(reference.created_at)}, ${reference.created_by}`, reference.reason || S.none,
    reference.approved_by
      ? `✓ ${text.approvedBy(reference.approved_by, signedTime(reference.approved_at))}`
      : h('span', { class: 'badge move' }, `${text.draft}, ${waitsFor(reference)}`),
    h('a', {
      class: 'button', href: `#/plan/${reference.id}`,
      'aria-label': `${plan}, ${text.version} ${reference.version}`,
    }, plan)));
  return table([text.version, text.source, text.made, text.reasonShort, text.state, S.action], rows,
    text.references);
}

function scanTable(scans) {
  const text = S.patients;
  if (!scans.length) return hint(S.status.noScans);
  const signed = (scan) => (scan.accepted_at
    ? `${scan.accepted_by}, ${signedTime(scan.accepted_at)}` : scan.accepted_by);
  const accepted = (scan) => (!scan.accepted_by ? S.none : `${acceptanceMark(scan)} ${signed(scan)}`
    + `${scan.accepted_reason ? `: ${scan.accepted_reason}` : ''}`);
  const rows = scans.map((scan) => row(
    h('a', { href: `#/result/${scan.id}` }, localTime(scan.started_at)),
    scan.fraction ?? S.none, S.purposes[scan.purpose],
    [outcomeBadge(scan), scan.check_overdue && h('span', { class: 'badge move overdue' },
      `▲ ${scan.check_failed ? text.checkFailed : text.checkOverdue}`)],
    h('td', { class: 'digits' }, isAdvice(scan) ? numbersLine(scan.result) : S.none),
    accepted(scan)));
  const heads = [text.when, text.fraction, text.purpose, text.outcome, text.numbers,
    text.accepted];
  return table(heads, rows, text.history);
}

/// The numbers of sessions in which something was scanned can be corrected, with a signature.
function correctFraction(scans, reload) {
  const text = S.session;
  const sessions = new Map();
  for (const { session_id: id, fraction, started_at: at } of scans) {
    if (id && fraction) sessions.set(id, `${text.fraction(fraction)}, ${localTime(at)}`);
  }
  if (!sessions.size) return null;
  const which = h('select', {},
    ...[...sessions].map(([id, words]) => h('option', { value: id }, words)));
  const number = h('input', { type: 'number', required: true, ...kFraction });
  const reason = h('input', { required: true, autocomplete: 'off', ...kReason });
  return h('details', {}, h('summary', {}, text.correct),
    signedForm({ class: 'form inline' }, async (sign) => {
      await post('treatment/fraction', {
        session_id: which.value, fraction: Number(number.value), reason: reason.value.trim(),
        ...sign(),
      });
      done(S.saved);
      await reload();
    }, h('button', {}, text.correctSubmit), field(text.correctWhich, which),
    field(text.correctTo, number), field(text.correctWhy, reason)));
}

function wipe(patient) {
  const text = S.patients;
  const code = h('input', { required: true, autocomplete: 'off', spellcheck: 'false' });
  return h('details', { class: 'card' }, h('summary', {}, text.wipe), h('p', {}, text.wipeText),
    signedForm({ class: 'form inline' }, async (sign) => {
      const isSame = code.value.trim().toLowerCase() === patient.code.toLowerCase();
      if (!isSame) throw new Error(text.wipeDiffers);
      await removeFor(`patients/${patient.id}`, sign());
      location.hash = '#/patients';
    }, h('button', { class: 'danger' }, text.wipeSubmit), field(text.code, code)));
}

function openNow(patient) {
  const session = live.status?.session;
  if (session?.patient_id !== patient.id) return null;
  const what = session.fraction ? S.session.fraction(session.fraction) : S.purposes.reference;
  return h('div', { class: 'row' },
    h('span', { class: 'lead' }, h('strong', {}, S.patients.isOpen), ` ${what}`),
    h('a', { class: 'button primary', href: '#/scan' }, S.status.goScan),
    may('scan') && action(S.session.close, () => closeSession(session), {}));
}

export async function showPatient(place, id) {
  const text = S.patients;
  const references = h('div', {});
  const scans = h('div', {});
  const spread = h('div', {});
  const opening = h('div', { class: 'below' });
  const about = h('div', {});
  const setUp = h('div', {});
  const heading = h('h1', {});
  const correction = h('div', { class: 'below' });
  let numbered;
  let sheetShown;
  let approved;
  let told;
  let buttons = null;
  const isDrawing = () => setUp.querySelector('[data-edited]') !== null;
  /// The button that begins a session is the primary one only where this patient's is not open.
  const weigh = () => opening.querySelector('.start-session')
    ?.classList.toggle('primary', live.status?.session?.patient_id !== id);
  const load = async (inBackground = true) => {
    const [patient, found, history] = await Promise.all([get(`patients/${id}`, inBackground),
      get(`patients/${id}/references`, true), get(`patients/${id}/scans`, true)]);
    const onSheet = JSON.stringify([patient.alert, patient.immobilisation,
      patient.sheet_revision]);
    // A reason that was typed stays as long as nothing else is offered.
    const opens = `${patient.approved_reference_id} ${patient.archived} ${
      patient.last_session?.id} ${patient.last_session?.fraction} ${onSheet} ${
      found.references.filter((one) => one.approved_by).map((one) => one.id)}`;
    if (approved !== opens) {
      approved = opens;
      buttons = patient.archived ? null : openButtons(patient, found.references);
      clear(opening, buttons?.element ?? hint(text.isArchived));
      weigh();
    }
    const says = JSON.stringify([patient.site, patient.note, patient.archived]);
    if (told !== says) {
      told = says;
      clear(heading, patient.code, ' ', h('small', {}, patient.site));
      clear(about, aboutPatient(patient, load));
    }
    // Somebody may be drawing, and is told when it is saved that the sheet has changed.
    if (sheetShown !== onSheet && !isDrawing()) {
      sheetShown = onSheet;
      clear(setUp, setUpCard(patient, load));
    }
    redraw(references, referenceTable(found.references));
    redraw(scans, scanTable(history.scans));
    // Nothing waits for them.
    getOrNull(`patients/${id}/statistics`).then((statistics) => {
      const inUse = found.references.find((one) => one.id === patient.approved_reference_id);
      redraw(spread,
        courseStatistics(statistics?.courses, history.scans, toleranceOf(inUse)) ?? []);
    });
    const sessions = JSON.stringify(history.scans.map((scan) => [scan.session_id, scan.fraction]));
    if (numbered !== sessions) {  // or a half-typed reason would be lost
      numbered = sessions;
      clear(correction, may('accept') && correctFraction(history.scans, load));
    }
    return patient;
  };
  // Before anything is drawn: lists that came later would move what a person is about to tap.
  const patient = await load(false);
  const session = h('div', {});
  const file = (name, label) => h('a', {
    class: 'button', href: `/api/v1/patients/${id}/${name}`, download: '',
  }, label);
  clear(place, heading,
    may('scan') && card(text.open, session, opening),
    card(text.references, references, may('plan') && planningUpload(id, patient.code)),
    card(text.history, scans,
      h('div', { class: 'row below' },
        file(`report.pdf?language=${document.documentElement.lang}`, text.report),
        file(`numbers.csv?language=${document.documentElement.lang}`, text.csv),
        file('numbers.json', text.json),
        file(`course.zip?language=${document.documentElement.lang}`, text.course)),
      correction), spread, setUp,
    about, may('wipe') && wipe(patient));
  let shownSession = null;
  const drawSession = () => {
    const now = live.status?.session ?? null;
    const key = JSON.stringify(now);
    if (shownSession === key) return;
    shownSession = key;
    clear(session, openNow(patient));
    weigh();
  };
  drawSession();
  guardLeaving(isDrawing);
  const stop = live.listen((kind) => {
    if (kind === 'status') drawSession();
    if (kind === 'status' || kind === 'connection') buttons?.draw();
    if (kind === 'data' || kind === 'result') load().catch((error) => warn(error.message));
  });
  return () => {
    guardLeaving(null);
    stop();
  };
}
