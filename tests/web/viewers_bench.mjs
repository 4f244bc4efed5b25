// SPDX-License-Identifier: Apache-2.0
// What watching costs: viewers_bench.mjs NODE_MODULES PLUMBD OUT_FOLDER CHROMIUM
// A sweep without viewers, then one with five viewers and a download without end. Viewers are what
// plumbd sees of a browser (event stream, preview four times a second, status after each event);
// real browsers would take this machine's processors, which on an appliance belong to others. The
// first page is loaded by a real browser. Prints a table; judges nothing: figures depend on the
// machine.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { Harness } from './harness.mjs';

const [modules, plumbd, folder, chromium] = process.argv.slice(2);
const socket = join(folder, 'data', 'control.sock');
const h = await Harness.start({ modules, folder, chromium, command: [plumbd, '--simulated', 'demo',
  '--state', 'FOLDER', '--listen', '127.0.0.1:0', '--control', socket] });
const kViewers = 5;
const kPreviewEvery_ms = 250;
const memory_kB = () =>
  Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${h.server.pid}/status`, 'utf8'))[1]);
const load = () => readFileSync('/proc/loadavg', 'utf8').split(' ')[0];
const sleep = (ms) => new Promise((done) => { setTimeout(done, ms); });
const rows = [];
const row = (what, figure, asked = '') => {
  rows.push([what, figure, asked]);
  console.log(`| ${what} | ${figure} | ${asked} |`);
};

// --- the first page, by a real browser
const page = await h.person('engineer', { width: 1280, height: 800 });
const answers = [];
page.on('response', (response) => answers.push(response));
await page.goto(h.url, { waitUntil: 'networkidle' });
await page.getByLabel('Setup code').waitFor();
const headers = await Promise.all(answers.map((response) => response.allHeaders()));
const bytes = headers.reduce((sum, each) => sum + Number(each['content-length'] ?? 0), 0);
const paint = await page.evaluate(
  () => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? -1);
row('first page, gzip', `${(bytes / 1000).toFixed(1)} kB in ${answers.length} answers`,
  '<= 150 kB');
row('first paint', `${Math.round(paint)} ms`, '<= 1 s');
await h.firstStart(page);
const cookie =
  (await page.context().cookies()).map(({ name, value }) => `${name}=${value}`).join('; ');
const token = (await h.api(page, 'session')).body.csrf_token;
await page.context().close();
await h.browser.close();

const ask = (path, method = 'GET') => fetch(`${h.url}api/v1/${path}`,
  { method, headers: { Cookie: cookie, ...(method === 'GET' ? {} : { 'X-CSRF-Token': token }) } });
const status = async () => (await ask('status')).json();
async function waitFor(state) {
  while (!state.includes((await status()).state)) await sleep(200);
}

/// One sweep of twelve seconds; what plumbd says of it.
async function sweep() {
  await waitFor(['ready', 'result']);
  const said = h.log.length;
  await ask('press', 'POST');
  await waitFor(['scanning']);
  await sleep(12000);
  await ask('press', 'POST');
  await waitFor(['result']);
  const line = h.log.slice(said).find((text) => /frames, \d+ dropped/.test(text)) ?? '';
  return { frames: Number(/(\d+) frames/.exec(line)?.[1]),
    dropped: Number(/(\d+) dropped/.exec(line)?.[1]), after: /done ([\d.]+) s/.exec(line)?.[1] };
}

let watching = true;
const counts = { events: 0, previews: 0, downloaded: 0 };
async function viewer() {
  const events = (async () => {
    const response = await ask('events');
    const reader = response.body.getReader();
    while (watching) {
      const { done, value } = await reader.read();
      if (done) break;
      counts.events += (new TextDecoder().decode(value).match(/event:/g) ?? []).length;
    }
    await reader.cancel();
  })();
  while (watching) {
    const response = await ask('preview');
    if (response.ok) counts.previews += (await response.arrayBuffer()).byteLength > 0 ? 1 : 0;
    await sleep(kPreviewEvery_ms);
  }
  await events.catch(() => {});
}
async function download(id) {
  while (watching) {
    counts.downloaded += (await (await ask(`scans/${id}/maps/mesh`)).arrayBuffer()).byteLength;
  }
}

row('load before the sweeps', load());
await sweep();  // the reference
const alone = await sweep();
const { scans } = await (await ask('scans')).json();
await waitFor(['result']);
await sleep(2000);
const before = memory_kB();
const viewers = Array.from({ length: kViewers }, viewer);
await sleep(5000);
const watched = memory_kB();
const downloads = download(scans[0].id);
const crowd = await sweep();
row('load after the sweeps', load());
watching = false;
await downloads;
row('frames dropped, no viewer',
  `${alone.dropped} of ${alone.frames}, result after ${alone.after} s`);
row(`frames dropped, ${kViewers} viewers and a download`,
  `${crowd.dropped} of ${crowd.frames}, result after ${crowd.after} s`, '30 Hz undisturbed');
row('sent meanwhile', `${counts.events} events, ${counts.previews} pictures, `
  + `${(counts.downloaded / 1e6).toFixed(0)} MB downloaded`);
row(`memory of plumbd with ${kViewers} viewers`,
  `${((watched - before) / 1024).toFixed(1)} MB more (${(before / 1024).toFixed(0)} MB before)`,
  '<= 10 MB');
await Promise.race([Promise.all(viewers), sleep(3000)]);
h.finished = true;
h.server.kill('SIGTERM');
process.exit(0);
