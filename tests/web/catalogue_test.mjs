// SPDX-License-Identifier: Apache-2.0
// Every text of every language is written with arguments of every kind, and the page writes each
// message as the programs do: catalogue_test.mjs WORDS TEST_PROGRAM OUT_FILE
// WORDS is the folder in which web/words/generate.py writes, TEST_PROGRAM the one of algo/base.
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { kJargon, readCatalogues, wordsIn } from './page_words.mjs';

const [words, program, file] = process.argv.slice(2);
const catalogues = readCatalogues(words);
const page = {};
for (const [code, one] of Object.entries(catalogues)) page[code] = await wordsIn(code, one);
const failures = [];
const equal = (found, expected, what) => {
  if (found !== expected) failures.push(`${what}: "${found}" instead of "${expected}"`);
};

// Messages: the unit test of the programs' writer says which texts it made of them.
const run = spawnSync(program, ['--gtest_filter=MessageTest.EveryTextOfEveryLanguageIsWritten'],
  { env: { ...process.env, PLUMB_SAID: file }, encoding: 'utf8' });
equal(run.status, 0, `${run.stdout}${run.stderr}`);
const lines = readFileSync(file, 'utf8').trim().split('\n').map((line) => JSON.parse(line));
const seen = new Set();
for (const { language, message, text } of lines) {
  seen.add(`${language} ${message.id}`);
  equal(page[language].textOf(message, 'English'), text, JSON.stringify(message));
}

// Texts of the page, called as the screens call them.
const kRounds = 4;
const samples = (type) => ({
  text: ['word', 'a #1', 'x', 'y'], int: [0, 1, 2, 17],
})[type] ?? [0, -1.5, 12.25, 300];
const found = (node, path) => path.split('.').slice(1).reduce((inner, key) => inner?.[key], node);
for (const [code, { texts, arguments: given }] of Object.entries(catalogues)) {
  equal(`${texts['page.notice.strong']} ${texts['page.notice.text']}`, texts['result.notice'],
    `${code}: what the page and the reports say of their use`);
  for (const [id, text] of Object.entries(texts)) {
    if (/^(page|unit)\./.test(id)) {
      if (id.startsWith('unit.')) continue;
      const said = found(page[code].S, id);
      const types = Object.values(given[id] ?? {});
      const rounds = types.length ? [...Array(kRounds).keys()] : [];
      equal(typeof said, types.length ? 'function' : 'string', `${code} ${id}`);
      const all = typeof said === 'string' ? [said]
        : rounds.map((i) => said(...types.map((type) => samples(type)[i])));
      for (const one of all) {
        if (/[{}]|undefined|NaN|null|\[object/.test(one)) failures.push(`${code} ${id}: ${one}`);
      }
      types.forEach((type, i) => {
        if (type === 'text' && !all.every((one, round) => one.includes(samples(type)[round]))) {
          failures.push(`${code} ${id} does not show its argument ${i}`);
        }
      });
    } else if (!seen.has(`${code} ${id}`)) failures.push(`nothing was made of ${code} ${id}`);
    // A sentence that is the same in two languages has not been translated.
    if (code !== 'en' && text === catalogues.en.texts[id] && /[a-z]{3,} [a-z]{3,}/.test(text)
        && !id.startsWith('text.') && !/^[^{]*\{[^{]*\}$/.test(text)) {
      failures.push(`${code} ${id} is English: ${text}`);
    }
  }
}

// Who treats patients reads no words of files and programs. These are texts of the command line, of
// recordings that other programs made, of the configuration of sensors, of the first start, and of
// what only engineers see.
const kExperts = new RegExp(['cli|foreign|recording|stream|text_report|page\\.certificate',
  'sensor\\.(driver_of_real|driver_of_simulated|unknown_driver|use_driver)',
  'diagnosis\\.(cameras_or_size|cameras_unstated|depth_camera_unknown|unit_or_side)',
  'diagnosis\\.depth_unit(_unknown|_unstated)?',
  'backup\\.no_recipient', 'comparison\\.room_not_calibrated', 'messages\\.no_way',
  'page\\.login\\.certificate', 'page\\.settings\\.(backup|messages)Hint',
  'scene_file\\.poses_differ']
  .map((one) => `^(${one})(\\.|$)`).join('|'));
let experts = 0;
for (const [code, { texts }] of Object.entries(catalogues)) {
  for (const [id, text] of Object.entries(texts)) {
    const word = kJargon.exec(text.replaceAll(/\{\w+(:[^,{}]+)?/g, '{'))?.[0];
    if (word && kExperts.test(id)) ++experts;
    else if (word) failures.push(`${code} ${id} says ${word}: ${text}`);
  }
}
equal(experts > 0, true, 'some are for experts');

// What is not known, and what came without a message, is the English that was sent.
const { said, saidEach, textOf, wordOf } = page.en;
const verbatim = (text) => ({ id: 'text.verbatim', arguments: { text } });
equal(textOf(verbatim('a {b} #'), 'other'), 'a {b} #', 'text of a person');
for (const message of [undefined, null, {}, { id: 'future.id' }, { id: 'text.verbatim' },
  { id: 'text.verbatim', arguments: { text: { id: 'future.word' } } }, { id: 'toString' }]) {
  equal(textOf(message, 'as sent'), 'as sent', JSON.stringify(message));
}
equal(said({ error: 'old' }, 'error'), 'old', 'without a message');
equal(said({ error: 'old', error_message: verbatim('new') }, 'error'), 'new', 'with a message');
equal(said(null, 'error'), undefined, 'nothing was sent');
equal(saidEach({ reasons: ['a', 'b'], reason_messages: [verbatim('A')] }, 'reasons').join(), 'A,b',
  'a list');
equal(wordOf({ scan_start: 'Scan' }, 'scan.start'), 'Scan', 'an identifier');
equal(wordOf({}, 'toString'), 'toString', 'an identifier that is not known');
for (const failure of failures) console.log(`  - ${failure}`);
console.log(failures.length ? `${failures.length} failures` : `all well: ${lines.length} texts`);
process.exit(failures.length ? 1 : 0);
