// SPDX-License-Identifier: Apache-2.0
// Bundles the page and writes it as a C++ source: build.mjs NODE_MODULES WORDS WORK_FOLDER OUT.cpp
// WORDS is the folder in which web/words/generate.py writes.
import { createHash } from 'node:crypto';
import { mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { basename, dirname, extname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const [modules, words, work, output] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const esbuild = createRequire(join(modules, 'index.js'))('esbuild');

rmSync(work, { recursive: true, force: true });
mkdirSync(work, { recursive: true });

/// The name of a file of the page with the digest of what is in it; the browser keeps it for ever.
function keep(name, end, data) {
  const digest = createHash('sha256').update(data).digest('hex').slice(0, 8);
  writeFileSync(join(work, `${name}.${digest}${end}`), data);
  return `/assets/${name}.${digest}${end}`;
}

// A language's words are a file of their own, which the page loads when the language is chosen.
// What only commands print is left out.
const kPrinted = ['cli', 'doctor', 'evaluation', 'foreign'];
const languages = {};
const texts = {};
for (const code of readFileSync(join(words, 'stamp'), 'utf8').trim().split('\n')) {
  const catalogue = JSON.parse(readFileSync(join(words, 'page', `${code}.json`), 'utf8'));
  catalogue.texts = Object.fromEntries(Object.entries(catalogue.texts)
    .filter(([id]) => !kPrinted.includes(id.split('.')[0])));
  texts[code] = catalogue.texts;
  languages[code] = { name: catalogue.language.name,
    words: keep(`words-${code}`, '.json', JSON.stringify(catalogue)) };
}

const { metafile } = await esbuild.build({
  entryPoints: [join(here, 'app.js'), join(here, 'style.css')],
  bundle: true,
  minify: true,
  splitting: true,
  format: 'esm',
  target: 'es2022',
  nodePaths: [modules],
  outdir: work,
  entryNames: '[name].[hash]',
  chunkNames: '[name].[hash]',
  assetNames: '[name].[hash]',
  legalComments: 'inline',
  define: { PLUMB_LANGUAGES: JSON.stringify(languages) },
  metafile: true,
});

const kTypes = { '.js': 'text/javascript; charset=utf-8', '.css': 'text/css; charset=utf-8',
  '.svg': 'image/svg+xml', '.json': 'application/json' };
const icon = keep('icon', '.svg', readFileSync(join(here, 'icon.svg')));
const names = readdirSync(work).sort();
const find = (start, end) =>
  `/assets/${names.find((name) => name.startsWith(start) && name.endsWith(end))}`;
const withoutScript = Object.entries(texts).map(([code, of]) =>
  `<p class="card" lang="${code}">${of['page.noscript.text']} <a href="/result?language=${code}"\n`
    + `hreflang="${code}">${of['page.noscript.link']}</a>.</p>`).join('\n');
const app = find('app.', '.js');
// Fetched together with the script that needs them, not after it.
const [, bundle] = Object.entries(metafile.outputs).find(([name]) => name.endsWith(basename(app)));
const chunks = bundle.imports.filter(({ kind }) => kind === 'import-statement')
  .map(({ path }) => `<link rel="modulepreload" href="/assets/${basename(path)}">`).join('\n');
const parts = { app, chunks, style: find('style.', '.css'), icon,
  without_script: withoutScript };
const html = readFileSync(join(here, 'index.html'), 'utf8')
  .replace(/\{([\w.]+)\}/g, (_, name) => parts[name] ?? texts.en[`page.${name}`]);

const assets =
  [{ path: '/', type: 'text/html; charset=utf-8', data: Buffer.from(html), hashed: false }];
for (const name of names) {
  assets.push({ path: `/assets/${name}`, type: kTypes[extname(name)],
    data: readFileSync(join(work, name)), hashed: true });
}

// A string literal; octal escapes have three digits at most, so what follows them cannot join in.
const literal = (data) => {
  let text = '"';
  for (const byte of data) {
    if (byte === 10) text += '\\n';
    else if (byte === 34 || byte === 92 || byte === 63) text += `\\${String.fromCharCode(byte)}`;
    else if (byte >= 32 && byte < 127) text += String.fromCharCode(byte);
    else text += `\\${byte.toString(8).padStart(3, '0')}`;
  }
  return `${text}"`;
};
const view = (data) => `std::string_view(${literal(data)}, ${data.length})`;
const rows = assets.map((asset) => {
  const packed = gzipSync(asset.data, { level: 9 });
  const name = asset.path.padEnd(36);
  console.log(`  ${name} ${String(asset.data.length).padStart(8)} bytes, `
    + `${String(packed.length).padStart(7)} gzip`);
  return `    {${literal(Buffer.from(asset.path))}, ${literal(Buffer.from(asset.type))}, `
    + `${view(asset.data)},\n     ${view(packed)}, ${asset.hashed}},`;
});

writeFileSync(output, `// Made by web/page/build.mjs.
#include "web/page/assets.hpp"

namespace plumb::web {
namespace {

constexpr Asset kAssets[] = {
${rows.join('\n')}
};

}  // namespace

std::span<const Asset> Assets() { return kAssets; }

}  // namespace plumb::web
`);
