// SPDX-License-Identifier: Apache-2.0
// The texts of the page as the build made them of the catalogues, for tests.
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const kWords = join(dirname(fileURLToPath(import.meta.url)), '../../web/page/words.js');

/// By code: what the page loads of each language.
export const readCatalogues = (words) => Object.fromEntries(
  readFileSync(join(words, 'stamp'), 'utf8').trim().split('\n')
    .map((code) => [code, JSON.parse(readFileSync(join(words, 'page', `${code}.json`), 'utf8'))]));

/// The page's words.js in a language. Each language has a copy of its own, so that the texts of two
/// can be compared.
export async function wordsIn(code, catalogue) {
  const words = await import(`${kWords}?${code}`);
  words.useCatalogue(catalogue);
  return words;
}

/// Words of files, programs and formats, in any of the languages, which mean nothing to who treats
/// patients.
export const kJargon = new RegExp(['T_iec', 'RAUC\\b', 'backup_folder', 'plumb\\.toml', 'SHA-256',
  '\\[(iec|storage|messages|check|web|update|sensor)\\]', '[Kk]eyframe', 'Schlüsselbild',
  'im[áa]gen(es)? clave', '[Ii]mages? clés?', '[Dd]epth[ _]scale', 'Tiefenskala',
  'Maßstab der Tiefe', '[Ee]scala (de (la )?)?profundidad', '[ÉEée]chelle de (la )?profondeur']
  .join('|'));

/// Where the build puts the words, beside the modules that the tests are given.
export const wordsBeside = (modules) => join(modules, '../../../words');
