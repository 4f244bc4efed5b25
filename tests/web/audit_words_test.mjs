// SPDX-License-Identifier: Apache-2.0
// What the audit log's page says of stored entries, in two languages: audit_words_test.mjs
// SOURCE_FOLDER WORDS
import { cpSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { readCatalogues } from './page_words.mjs';

const [source, words] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), 'plumb-audit-words-'));
cpSync(join(source, 'web/page'), folder, { recursive: true });
writeFileSync(join(folder, 'package.json'), '{"type": "module"}');
const load = async (name) => (await import(pathToFileURL(join(folder, `${name}.js`)).href));
const { useCatalogue } = await load('words');
const catalogues = readCatalogues(words);
const useLanguage = (code) => useCatalogue(catalogues[code]);
const { detailWords, subjectWords, userWords } = await load('audit_words');
const { csvOf } = await load('csv');
rmSync(folder, { recursive: true });

const failures = [];
const equal = (found, expected, what) => {
  if (found !== expected) failures.push(`${what}: "${found}" instead of "${expected}"`);
};

const kPlan = JSON.stringify({ region_m: [[0, 0], [1, 0], [1, 1]], isocentre_m: null,
  shift_tolerance_mm: 2.5, rotation_tolerance_deg: 1, posture: 'HFS', couch_markers: false });
const kCovered = JSON.stringify({ ...JSON.parse(kPlan), posture: 'HFP', clothing_mm: 4.5,
  ct_breathing_mm: 6 });
// Action, stored detail, English, Spanish.
const kDetails = [
  ['check.done', 'passed', 'PASSED', 'SUPERADO'],
  ['check.done', 'failed', 'FAILED', 'NO SUPERADO'],
  ['check.done', 'no_baseline', 'NO BASELINE', 'SIN LÍNEA BASE'],
  ['scan.accept', 'in_tolerance', 'IN TOLERANCE', 'EN TOLERANCIA'],
  ['scan.accept', 'in_tolerance, vertical +0.20 mm, lateral -0.31 mm, yaw -0.10 deg',
    'IN TOLERANCE, Vertical +0.20 mm, Lateral −0.31 mm, Yaw −0.10°',
    'EN TOLERANCIA, Vertical +0,20 mm, Lateral −0,31 mm, Guiñada −0,10°'],
  ['scan.accept_outside', 'move, vertical +1.20 mm, pitch -0.10 deg; reason: swelling',
    'MOVE, Vertical +1.20 mm, Pitch −0.10°; reason: swelling',
    'MOVER, Vertical +1,20 mm, Cabeceo −0,10°; motivo: swelling'],
  ['scan.accept_outside', 'unsure; reason: up; reason: move\nfailed',
    'INCONCLUSIVE; reason: up; reason: move\nfailed',
    'NO CONCLUYENTE; motivo: up; reason: move\nfailed'],
  ['session.open', 'fraction', 'Fraction', 'Fracción'],
  ['session.reference', 'version 2', 'version 2', 'versión 2'],
  ['session.fraction', 'from 5 to 3; reason: a power cut', 'from 5 to 3; reason: a power cut',
    'de 5 a 3; motivo: a power cut'],
  ['session.open', 'reference', 'New reference', 'Nueva referencia'],
  ['scan.start', 'fraction', 'Fraction', 'Fracción'],
  ['scan.start', 'daily_check', 'Daily check', 'Control diario'],
  ['scan.start', 'unassigned', 'Unassigned scan', 'Escaneo sin asignar'],
  ['scan.end', 'unassigned', 'Unassigned scan', 'Escaneo sin asignar'],
  ['cancel', 'reference', 'New reference', 'Nueva referencia'],
  ['scan.start', '', '', ''],  // of an earlier version
  ['press', 'working', 'Computing', 'Calculando'],
  ['press', 'no_sensor', 'Sensor missing', 'Falta el sensor'],
  ['template.remove', 'head', 'head', 'head'],
  ['user.add', 'physicist', 'Physicist', 'Físico'],
  ['user.change', 'role engineer password disabled', 'role: Engineer, new password, disabled',
    'función: Ingeniero, contraseña nueva, desactivada'],
  ['user.change', 'role technician > engineer password',
    'role: Technician → Engineer, new password', 'función: Técnico → Ingeniero, contraseña nueva'],
  ['user.change', 'role technician', 'role: Technician', 'función: Técnico'],
  ['user.change', 'enabled', 'enabled', 'activada'],
  ['user.change', '', '', ''],
  ['recording.remove', 'quota', 'to free disk space', 'para liberar espacio en disco'],
  ['settings.change', '{"posture":["HFS","FFP"],"couch_markers":[false,true]}',
    'Posture of new references: Head first, supine → Feet first, prone; '
    + 'Markers are fixed to the couch: no → yes',
    'Postura de las referencias nuevas: Cabeza primero, supino → Pies primero, prono; '
    + 'Los marcadores están fijos a la mesa: no → sí'],
  ['settings.change', '{"retention_days":[0,365],"auto_stop_s":[2.5]}',
    'Delete scans after … days (0: never): 0 → 365; '
    + 'Stop a sweep after … s without new surface: 2.5',
    'Borrar los escaneos tras … días (0: nunca): 0 → 365; '
    + 'Detener un barrido tras … s sin superficie nueva: 2,5'],
  ['config.reload',
    '{"appliance.warm_up_min":[null,"20"],"web.listen":["\'a\'","\'b\'","restart"]}',
    "appliance.warm_up_min: default → 20; web.listen: 'a' → 'b' (from the next start on)",
    "appliance.warm_up_min: valor por defecto → 20; web.listen: 'a' → 'b' "
    + '(desde el próximo inicio)'],
  // A sentence has a message beside it since 0.3.0; what earlier versions stored stays as it is.
  ['scans.lost', '3 of 5 stored scans were confirmed as lost',
    '3 of 5 stored scans were confirmed as lost', '3 of 5 stored scans were confirmed as lost'],
  ['patient.change', 'site and note', 'site and note', 'site and note'],
];
for (const [action, detail, english, spanish] of kDetails) {
  for (const [language, expected] of [['en', english], ['es', spanish]]) {
    useLanguage(language);
    equal(detailWords({ action, user: 'anna', detail }), expected, `${language} ${action}`);
  }
}
for (const language of ['en', 'es']) {
  useLanguage(language);
  const message = { id: 'text.verbatim', arguments: { text: 'as said' } };
  for (const action of ['scans.lost', 'scan.accept', 'template.remove']) {
    equal(detailWords({ action, user: 'anna', detail: 'old', detail_message: message }), 'as said',
      `${language} ${action}, a message`);
  }
  // What this version does not know is shown as it is stored, also what every object has.
  for (const action of ['check.done', 'session.open', 'scan.start', 'scan.end', 'cancel', 'press',
    'scan.accept', 'scan.accept_outside', 'user.add', 'user.change', 'recording.remove',
    'settings.change', 'config.reload', 'reference.plan', 'an.action', 'toString']) {
    for (const detail of ['later_word', 'toString', 'a, b; c', '{"a']) {
      equal(detailWords({ action, user: 'plumbd', detail }), detail,
        `${language} ${action}, unknown`);
    }
  }
  equal(
    detailWords({ action: 'scan.remove', user: 'plumbd', address: '10.0.0.2', detail: 'quota' }),
    'quota', 'of an account of that name');
  equal(detailWords({ action: 'scan.remove', user: 'anna', detail: 'quota' }), 'quota',
    `${language}: a person's reason`);
  if (detailWords({ action: 'reference.plan', user: 'anna', detail: kPlan }).includes('HFS')) {
    failures.push(`${language}: the plan's posture is raw`);
  }
  const decimal = language === 'en' ? '4.5' : '4,5';
  for (const [plan, wanted] of [[kPlan, false], [kCovered, true]]) {
    const told = detailWords({ action: 'reference.plan', user: 'anna', detail: plan });
    equal(told.includes(`(mm): ±${decimal}`), wanted, `${language}: clothing where it is stated`);
    equal(told.includes('(mm): ±6'), wanted, `${language}: the breath of the CT likewise`);
  }
}
for (const [language, retention, fraction, gone, button] of [
  ['en', 'past the retention period', 'PX-1, Fraction 3', 'session 7 (deleted)', 'the button'],
  ['es', 'más antiguo que el plazo de conservación', 'PX-1, Fracción 3', 'sesión 7 (se borró)',
    'el botón']]) {
  useLanguage(language);
  equal(userWords({ user: 'button', address: '' }), button, language);
  equal(userWords({ user: 'button', address: '10.0.0.2' }), 'button', 'of an account of that name');
  for (const user of ['anna', 'plumbd', 'toString']) {
    equal(userWords({ user, address: '' }), user, language);
  }
  equal(detailWords({ action: 'scan.remove', user: 'plumbd', detail: 'retention' }), retention,
    language);
  const about = { kind: 'session', exists: true, patient_code: 'PX-1', number: 3, time: null };
  equal(subjectWords({ subject: '7', about }), fraction, language);
  equal(subjectWords({ subject: '7', about: { ...about, exists: false } }), gone, language);
  equal(subjectWords({ subject: '', about: null }), '', language);
}
equal(csvOf(['a', 'b'], [['=1', 'x;"y"']], '.'),
  '\ufeff"a","b"\r\n"\'=1","x;""y"""\r\n', 'commas');
equal(csvOf(['a', 'b'], [['1', '2']], ','), '\ufeff"a";"b"\r\n"1";"2"\r\n', 'semicolons');
for (const failure of failures) console.log(`  - ${failure}`);
console.log(failures.length ? `${failures.length} failures` : 'all well');
process.exit(failures.length ? 1 : 0);
