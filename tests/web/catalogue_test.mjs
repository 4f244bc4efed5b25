// Both languages of the page hold the same texts: catalogue_test.mjs SOURCE_FOLDER
import { copyFileSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [source] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), 'plumb-catalogue-'));
const load = async (name) => {  // as a module, whatever the folder's package says
  copyFileSync(join(source, 'web/assets/strings', `${name}.js`), join(folder, `${name}.mjs`));
  return (await import(pathToFileURL(join(folder, `${name}.mjs`)).href))[name];
};
const { en, es } = { en: await load('en'), es: await load('es') };
rmSync(folder, { recursive: true });

const failures = [];
const kSame = new Set(['product', 'none', 'codeHint', 'scaleBar', 'title', 'sensor', 'gantry',
  'vertical', 'longitudinal', 'lateral', 'plan']);
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
for (const [text, expected] of [
  ['up', 'arriba'], ['to patient left', 'hacia la izquierda del paciente'],
  ['left side at the head end 9 mm high',
    'lado izquierdo en el extremo de la cabeza: 9 mm demasiado alto'],
  ['marker 7 moved 12 mm', 'el marcador 7 se movió 12 mm'], ['something else', undefined]]) {
  if (es.translate(text) !== expected) failures.push(`"${text}" becomes "${es.translate(text)}"`);
}
if (en.patients && en.session.scans(1) === en.session.scans(2).replace('2', '1')) {
  failures.push('one scan is said as many');
}
for (const failure of failures) console.log(`  - ${failure}`);
console.log(failures.length ? `${failures.length} failures` : 'all well');
process.exit(failures.length ? 1 : 0);
