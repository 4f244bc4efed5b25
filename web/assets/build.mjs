// Bundles the page and writes it as a C++ source: build.mjs NODE_MODULES WORK_FOLDER OUT.cpp
import { createHash } from 'node:crypto';
import { mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, extname, join } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { gzipSync } from 'node:zlib';

const [modules, work, output] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const esbuild = createRequire(join(modules, 'index.js'))('esbuild');

rmSync(work, { recursive: true, force: true });
mkdirSync(work, { recursive: true });
await esbuild.build({
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
});

const kTypes = { '.js': 'text/javascript; charset=utf-8', '.css': 'text/css; charset=utf-8',
  '.svg': 'image/svg+xml' };
const icon = readFileSync(join(here, 'icon.svg'));
const iconName = `icon.${createHash('sha256').update(icon).digest('hex').slice(0, 8)}.svg`;
writeFileSync(join(work, iconName), icon);
const names = readdirSync(work).sort();
const find = (start, end) =>
  `/assets/${names.find((name) => name.startsWith(start) && name.endsWith(end))}`;
const html = readFileSync(join(here, 'index.html'), 'utf8')
  .replace('{app}', find('app.', '.js'))
  .replace('{style}', find('style.', '.css'))
  .replace('{icon}', `/assets/${iconName}`);

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

// The appliance's words, for the reports that the server makes.
const module = join(work, '..', 'es_appliance.mjs');
await esbuild.build({
  entryPoints: [join(here, 'strings', 'es_appliance.js')],
  bundle: true,
  format: 'esm',
  outfile: module,
});
const { kWords, kPatterns } = await import(pathToFileURL(module).href);
const phrases = (list) => list.map(([text, words]) =>
  `    {${literal(Buffer.from(text))}, ${literal(Buffer.from(words))}},`).join('\n');
writeFileSync(output, `// Made by web/assets/build.mjs.
#include "web/assets/assets.hpp"

namespace plumb::web {
namespace {

constexpr Asset kAssets[] = {
${rows.join('\n')}
};

constexpr Phrase kPhrases[] = {
${phrases(Object.entries(kWords))}
};
constexpr Phrase kPatterns[] = {
${phrases(kPatterns)}
};

}  // namespace

std::span<const Asset> Assets() { return kAssets; }
std::span<const Phrase> SpanishPhrases() { return kPhrases; }
std::span<const Phrase> SpanishPatterns() { return kPatterns; }

}  // namespace plumb::web
`);
