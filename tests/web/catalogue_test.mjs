// Both languages of the page hold the same texts, and words for every action that the sources write
// into the audit log: catalogue_test.mjs SOURCE_FOLDER
import {
  copyFileSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [source] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), 'plumb-catalogue-'));
writeFileSync(join(folder, 'package.json'), '{"type": "module"}');
const load = async (name) => (await import(pathToFileURL(join(folder, `${name}.js`)).href));
for (const name of ['en', 'es', 'es_appliance', 'es_faults']) {
  copyFileSync(join(source, 'web/assets/strings', `${name}.js`), join(folder, `${name}.js`));
}
const [{ en }, { es }] = [await load('en'), await load('es')];
const { kWords, kPatterns } = await load('es_appliance');
rmSync(folder, { recursive: true });

const failures = [];
const kSame = new Set(['product', 'none', 'codeHint', 'scaleBar', 'title', 'sensor', 'gantry',
  'anterior', 'posterior', 'vertical', 'longitudinal', 'lateral', 'plan']);
const sample = (f) => f(...Array.from({ length: f.length }, () => 7));
function compare(a, b, path) {
  for (const key of new Set([...Object.keys(a), ...Object.keys(b)])) {
    const where = `${path}${key}`;
    if (where === 'translate') continue;
    const [x, y] = [a[key], b[key]];
    if (x === undefined) failures.push(`${where} is only in Spanish`);
    else if (y === undefined) failures.push(`${where} is not in Spanish`);
    else if (typeof x !== typeof y) failures.push(`${where}: ${typeof x} and ${typeof y}`);
    else if (typeof x === 'function') {
      if (x.length !== y.length) failures.push(`${where} takes ${x.length} and ${y.length} values`);
      else if (typeof sample(y) !== 'string') failures.push(`${where} gives no text`);
    } else if (typeof x === 'object') compare(x, y, `${where}.`);
    else if (x === y && /[a-z]{4}/.test(x) && !kSame.has(key)) failures.push(`${where}: ${x}`);
  }
}
compare(en, es, '');

/// The actions of one source file: the second argument of every call that writes an audit entry,
/// which is a literal or a choice of literals. A definition is recognised by its typed parameter;
/// the journal's Log() begins with a level.
function actionsOf(text, file) {
  const actions = new Set();
  for (const call of text.matchAll(/(\b(?:AppendAuditEntry|Audit|Write|Log)|\blog_?)\(/g)) {
    const parts = [''];
    let [depth, quoted] = [0, false];
    for (let i = call.index + call[0].length; i < text.length; ++i) {
      const c = text[i];
      if (c === '\\' && quoted) { parts[parts.length - 1] += c + text[++i]; continue; }
      if (c === '"') quoted = !quoted;
      if (!quoted && '([{'.includes(c)) ++depth;
      if (!quoted && ')]}'.includes(c) && --depth < 0) break;
      if (!quoted && c === ',' && depth === 0) parts.push('');
      else parts[parts.length - 1] += c;
    }
    if (call[1] === 'AppendAuditEntry') parts.shift();  // the database
    const [who, what] = parts.map((part) => part.trim());
    if (parts.length !== 4 || /^LogLevel::|&\s*\w+$/.test(who)) continue;
    if (what === 'action') continue;  // is handed on: the caller's literal is looked at
    const found = what.match(/"[^"]*"/g) ?? [];
    if (!found.length) failures.push(`${file}: the action in "${what}" cannot be read`);
    for (const literal of found) actions.add(literal.slice(1, -1));
  }
  // A table holds the actions of who saw or took what.
  for (const [, action] of text.matchAll(/"((?:view|download)\.\w+)"/g)) actions.add(action);
  return actions;
}
const written = new Set();
for (const top of ['daemon', 'web']) {
  for (const file of readdirSync(join(source, top), { recursive: true })) {
    if (!file.endsWith('.cpp') || file.includes('node_modules')) continue;
    for (const one of actionsOf(readFileSync(join(source, top, file), 'utf8'), join(top, file))) {
      written.add(one);
    }
  }
}
for (const one of ['login', 'patient.import', 'scan.accept_outside', 'update.done',
  'system.restart_failed']) {
  if (!written.has(one)) failures.push(`the sources are said not to write ${one}`);
}
for (const one of written) {
  for (const [name, words] of [['English', en], ['Spanish', es]]) {
    if (!words.audit.actions[one]) failures.push(`the action ${one} has no words in ${name}`);
  }
}
for (const one of Object.keys(en.audit.actions)) {
  if (!written.has(one)) failures.push(`nothing writes the action ${one} that has words`);
}
for (const [text, expected] of [
  ['up', 'arriba'], ['to patient left', 'hacia la izquierda del paciente'],
  ['left side at the head end 9 mm high',
    'lado izquierdo en el extremo de la cabeza: 9 mm demasiado alto'],
  ['marker 7 moved 12 mm', 'el marcador 7 se movió 12 mm'], ['something else', undefined],
  ['toString', undefined],
  ['left side of the abdomen 6 mm low', 'lado izquierdo del abdomen: 6 mm demasiado bajo'],
  ['-X side at the end away from the gantry 4 mm high',
    'lado −X en el extremo opuesto al gantry: 4 mm demasiado alto'],
  ['the current scan covers 81.5 % of the region, at least 90 % are needed; sweep all of it',
    'el escaneo actual cubre el 81,5 % de la región y se necesita al menos el 90 %; bárrala toda'],
  ['pitch is not well determined: ±1.4 deg at 95 %, the tolerance is 1 deg',
    'cabeceo: no está bien determinado, ±1,4 ° al 95 %; la tolerancia es 1 °'],
  ['lateral is not well determined: ±263 mm at 95 %, the tolerance is 3 mm',
    'lateral: no está bien determinado, ±263 mm al 95 %; la tolerancia es 3 mm'],
  ['every value and its uncertainty lie within 3 mm and 1.5 deg',
    'todos los valores y su incertidumbre quedan dentro de 3 mm y 1,5°'],
  ['outside 3 mm and 1 deg: vertical -8.0 mm (down), lateral +12.4 mm (to the left, facing the '
    + 'gantry), yaw -2.4 deg (head to patient left)',
  'fuera de 3 mm y 1°: vertical -8,0 mm (abajo), lateral +12,4 mm (a la izquierda, mirando al '
    + 'gantry), guiñada -2,4 ° (cabeza hacia la izquierda del paciente)'],
  ['not surely within 3 mm and 1 deg: pitch +0.9 ±0.3 deg, yaw -0.9 ±0.2 deg',
    'no con seguridad dentro de 3 mm y 1°: cabeceo +0,9 ±0,3 °, guiñada -0,9 ±0,2 °'],
  ['the scan failed: out of memory: make a shorter sweep, or close other programs',
    'el escaneo falló: falta memoria: barra un trayecto más corto o cierre lo que esté en marcha'],
  ['/backups/plumb-1: 12 scans, 90 files, 1000 bytes, 0 problems, encrypted',
    '/backups/plumb-1: 12 escaneos, 90 archivos, 1000 bytes, 0 problemas, cifrada'],
  ['plumb-2.raucb was not installed: this bundle holds version 0.1.0, older than 0.2.0 which runs',
    'plumb-2.raucb no se instaló: este archivo contiene la versión 0.1.0, anterior a la 0.2.0, que '
    + 'está en uso'],
  ['plumb-2.raucb was not installed: this bundle holds version \'0.2.1-rc1\': expected numbers '
    + 'separated by dots, such as 0.2.1; ask who made it',
  'plumb-2.raucb no se instaló: este archivo contiene la versión «0.2.1-rc1»: se esperaban números '
    + 'separados por puntos, como 0.2.1; pregunte a quien lo hizo'],
  ['what is stored cannot be read: the stored settings cannot be read: expected a JSON object, '
    + 'found none; it was changed from outside, or its disk failed. Put a backup of the database '
    + 'in its place, or save it again',
  'no se puede leer lo guardado: no es posible leer los ajustes guardados: expected a JSON object, '
    + 'found none; se cambió desde fuera o falló el disco. Ponga una copia de la base de datos en '
    + 'su lugar o guárdelo de nuevo'],
  ['the page\'s certificate CN=plumb ends on 2026-12-24 10:00 UTC: browsers refuse it from then '
    + 'on; put a new one in its place before',
  'el certificado de la página, CN=plumb, caduca el 2026-12-24 10:00 UTC: desde entonces los '
    + 'navegadores lo rechazan; ponga antes uno nuevo en su lugar'],
  ['what was handed in: holds no key that can be read without a password (Base64 error); expected '
    + 'PEM files as `openssl req` writes them',
  'lo entregado: no contiene ninguna clave que se pueda leer sin contraseña (Base64 error); se '
    + 'esperaban archivos PEM como los escribe `openssl req`'],
  ['/s/device.key has 3 bytes, expected 32: browsers are not known again after a restart; remove '
    + 'the file',
  '/s/device.key tiene 3 bytes y se esperaban 32: tras reiniciar no se reconoce ningún navegador; '
    + 'borre el archivo'],
  ['the scan failed: cannot compare the scenes: the reference was made with markers of 0.104 m, '
    + 'the current one with 0.15 m; scan both with the same markers',
  'el escaneo falló: no se pueden comparar los escaneos: la referencia se hizo con marcadores de '
    + '0,104 m y el actual con marcadores de 0,15 m; escanee ambos con los mismos marcadores'],
  ['the current scan has a hole of 63 mm in the region (left side at the head end); at most 50 mm '
    + 'are allowed; sweep over it',
  'el escaneo actual tiene un hueco de 63 mm en la región (lado izquierdo en el extremo de la '
    + 'cabeza); se admiten 50 mm como máximo; barra sobre él'],
  ['scan needs at least 3 markers shared with the reference, found 1 (id 7); keep the markers in '
    + 'view', 'el escaneo necesita al menos 3 marcadores comunes con la referencia y tiene 1; '
    + 'mantenga los marcadores a la vista']]) {
  if (es.translate(text) !== expected) failures.push(`"${text}" becomes "${es.translate(text)}"`);
}
// The phrases are those that the method writes: one that was reworded there loses its Spanish.
const sources = [];
for (const top of ['algo', 'daemon', 'drivers', 'web']) {
  for (const file of readdirSync(join(source, top), { recursive: true })) {
    if (file.endsWith('.cpp') && !file.includes('node_modules')) {
      sources.push(readFileSync(join(source, top, file), 'utf8').replace(/"\s*\n\s*"/g, ''));
    }
  }
}
const all = sources.join('\n');
for (const phrase of Object.keys(kWords).filter((words) => words.length > 45)) {
  if (!all.includes(phrase)) failures.push(`nothing says "${phrase}"`);
}
for (const [pattern] of kPatterns) {
  const fixed = pattern.replace(/\\(.)/g, '$1').split(/[$^()[\]?|]+/)
    .sort((a, b) => b.length - a.length)[0];
  if (fixed.length > 20 && !all.includes(fixed)) failures.push(`nothing says "${fixed}"`);
}
// And each sentence with which a comparison is refused has its Spanish.
const spanish = [...Object.keys(kWords), ...kPatterns.map(([one]) => one.replace(/\\(.)/g, '$1'))];
for (const file of ['algo/acceptance/acceptance.cpp', 'algo/comparison/comparison.cpp']) {
  const text = readFileSync(join(source, file), 'utf8').replace(/"\s*\n\s*"/g, '');
  for (const [, literal] of text.matchAll(/"((?:[^"\\\n]|\\.)*)"/g)) {
    // Includes, and a caller's mistakes, which no user reads.
    if (literal.length < 30 || /^(?:algo\/|acceptance:|comparison:)/.test(literal)) continue;
    const fixed = JSON.parse(`"${literal}"`).split(/\{(?:[^{}]|\{\})*\}/)
      .filter((part) => part.length > 3);
    if (!spanish.some((one) => fixed.every((part) => one.includes(part)))) {
      failures.push(`${file}: "${literal}" has no Spanish`);
    }
  }
}
// Each step of the computation that the appliance reports has its words.
for (const file of ['algo/reconstruction/reconstructor.cpp', 'daemon/appliance/scan_session.cpp']) {
  const text = readFileSync(join(source, file), 'utf8');
  const steps = [...text.matchAll(/\b(?:report|ReportProgress)\((?:[^"();]+, )?"([^"]+)"/g)];
  if (steps.length < 4) failures.push(`${file} reports ${steps.length} steps`);
  for (const [, step] of steps) {
    for (const catalogue of [en, es]) {
      if (!Object.hasOwn(catalogue.scan.step, step)) failures.push(`no words for step "${step}"`);
    }
  }
}
// The print view and the reports name the numbers as the page does.
const terms = readFileSync(join(source, 'web/service/result_terms.hpp'), 'utf8');
for (const { axes, lines, tilts } of [en.result, es.result]) {
  const names = [lines, tilts].flatMap(({ head, left, marker }) =>
    [head, left, marker('X'), marker('Y')]);
  for (const name of [...Object.values(axes), ...names]) {
    if (!terms.includes(`"${name}"`)) failures.push(`the reports do not say "${name}"`);
  }
}
if (en.patients && en.session.scans(1) === en.session.scans(2).replace('2', '1')) {
  failures.push('one scan is said as many');
}
for (const failure of failures) console.log(`  - ${failure}`);
console.log(failures.length ? `${failures.length} failures` : 'all well');
process.exit(failures.length ? 1 : 0);
