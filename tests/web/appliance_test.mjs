// SPDX-License-Identifier: Apache-2.0
// The page on the real appliance with its virtual sensor: appliance_test.mjs NODE_MODULES PLUMBD
// PLUMB OUT_FOLDER CHROMIUM
import { execFile } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { Harness } from './harness.mjs';

const [modules, plumbd, plumb, folder, chromium] = process.argv.slice(2);
const socket = join(folder, 'data', 'control.sock');
// Small and short sweeps: what is tested is the way through the page, not the accuracy.
const h = await Harness.start(
  { modules, folder, chromium, command: [plumbd, '--simulated', 'demo', '--sim-size', '320x240',
    '--sim-frames', '120', '--state', 'FOLDER', '--listen', '127.0.0.1:0', '--control', socket] });
const { check, equal } = h;
const kSlow = { timeout: 180000 };
const sim = (...command) =>
  promisify(execFile)(plumb, ['--control', socket, 'sim', ...command]);
const memory_kB = () =>
  Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${h.server.pid}/status`, 'utf8'))[1]);

const page = await h.person('engineer');
/// Ends the sweep once nothing new comes into view, as a person would.
async function endSweep(who) {
  await who.getByRole('button', { name: 'End sweep' }).waitFor();
  for (const begun = Date.now(); ; await who.waitForTimeout(250)) {
    const { state, scan: seen } = (await h.api(who, 'status')).body;
    if (state !== 'scanning') return;  // it reached its longest duration
    if (seen.without_new_surface_s > 1 && Date.now() - begun > 8000) break;
  }
  await who.getByRole('button', { name: 'End sweep' }).click();
}
async function scan() {
  await page.goto(`${h.url}#/scan`);
  await page.getByRole('button', { name: /Start sweep|Scan again/ }).click(kSlow);
  await endSweep(page);
  await page.locator('.verdict').waitFor(kSlow);
}

await h.step('first start', async () => {
  await sim('speed', '0.5');  // what is tested is not how many images a loaded machine loses
  await h.firstStart(page);
  await page.locator('.headline', { hasText: 'Ready' }).waitFor(kSlow);
  await h.look(page, 'status', { axe: false });
});

await h.step('accounts for two physicists', async () => {
  await page.goto(`${h.url}#/users`);
  for (const name of ['bob', 'clara']) await h.addAccount(page, name, 'physicist');
});

await h.step('the first sweep, closed and opened again midway, becomes the reference', async () => {
  await page.goto(`${h.url}#/scan`);
  await page.getByRole('button', { name: 'Start sweep' }).click();
  await page.getByRole('button', { name: 'End sweep' }).waitFor();
  await page.waitForFunction(
    () => document.querySelector('.facts')?.textContent.match(/tracked\s*[1-9]/));
  await page.locator('.preview img').waitFor();
  await h.look(page, 'scan-sweep');
  const id = await page.evaluate(() =>
    fetch('/api/v1/status').then((response) => response.json()).then((status) => status.scan.id));
  await page.goto('about:blank');
  await page.goto(`${h.url}#/scan`);
  await page.locator('.verdict').waitFor(kSlow);
  const scans =
    await page.evaluate(() => fetch('/api/v1/scans').then((response) => response.json()));
  equal(scans.scans.length, 1, 'one scan');
  equal(scans.scans[0].id, id, 'the same scan');
  await page.locator('canvas.map').waitFor();
  await page.waitForFunction(() => document.querySelector('canvas.map').width > 300);
  await h.look(page, 'result-reference', { axe: false });
});

await h.step('the moved body gives MOVE and six numbers', async () => {
  await sim('next-scene');
  await scan();
  await page.locator('.verdict.move').waitFor();
  equal(await page.locator('.number .value').count(), 6, 'six numbers');
  check(await page.locator('.number.outside').count() > 0, 'something is outside tolerance');
  await page.locator('.reading strong').waitFor();
  await h.look(page, 'result-move');
  await page.getByRole('button', { name: 'Open the 3-D view' }).click();
  await page.locator('canvas.mesh[data-ready=yes]').waitFor(kSlow);
  await page.locator('canvas.mesh').scrollIntoViewIfNeeded();
  await h.picture(page, 'mesh.png', { fullPage: false });
});

const viewers = [];
await h.step('five viewers cost little memory', async () => {
  await page.goto(`${h.url}#/scan`);
  const before = memory_kB();
  for (let i = 0; i < 4; ++i) {
    const viewer = await h.person(`viewer${i}`, { width: 640, height: 480 });
    await h.logIn(viewer, 'bob');
    await viewer.goto(`${h.url}#/status`);
    viewers.push(viewer);
  }
  const after = memory_kB();
  console.log(`    plumbd: ${before} kB before, ${after} kB with five viewers`);
  check(after - before < 10240, `five viewers take ${after - before} kB more`);
});

await h.step('a third sweep, watched by five and with a download, makes a trend', async () => {
  const { scans } =
    await page.evaluate(() => fetch('/api/v1/scans').then((response) => response.json()));
  const download = viewers[0].evaluate(async (id) => {
    let bytes = 0;
    for (let i = 0; i < 5; ++i) {
      bytes += (await (await fetch(`/api/v1/scans/${id}/files/mesh.ply`)).arrayBuffer()).byteLength;
    }
    return bytes;
  }, scans[0].id);
  await scan();
  const bytes = await download;
  check(bytes > 0, 'the download came');
  // Reported, not judged: on a loaded machine frames drop for other reasons too.
  console.log(`    ${bytes} bytes downloaded meanwhile; plumbd says: `
    + `${h.log.filter((line) => line.includes('frames,')).at(-1)}`);
  for (const viewer of viewers) await viewer.context().close();
  // A loaded machine drops so many frames that the sweep has no answer, and so no place in a trend.
  for (let tries = 0; tries < 3; ++tries) {
    const status = await page.evaluate(() =>
      fetch('/api/v1/status').then((response) => response.json()));
    if (status.last_result.result.numbers.length > 0) break;
    console.log(`    scan ${status.last_result.id} has no numbers: another sweep`);
    await scan();
  }
  await page.locator('.trend').first().waitFor();
  equal(await page.locator('.trend').count(), 6, 'six trends');
});

await h.step('a physicist plans a new version, a second one approves', async () => {
  const bob = await h.person('bob');
  await h.logIn(bob, 'bob');
  await bob.goto(`${h.url}#/patients`);
  await bob.getByRole('link', { name: 'demo' }).click();
  await bob.getByRole('link', { name: /^Plan, Version/ }).first().click();
  const map = bob.getByRole('application');
  await map.scrollIntoViewIfNeeded();
  const box = await map.boundingBox();
  for (const [x, y] of [[0.3, 0.3], [0.65, 0.3], [0.65, 0.65], [0.3, 0.65]]) {
    await bob.mouse.click(box.x + x * box.width, box.y + y * box.height);
  }
  await h.look(bob, 'plan', { axe: false });
  await bob.getByRole('button', { name: 'Save plan' }).click();
  await bob.getByText('Waiting for a second physicist').waitFor();
  equal(await bob.getByRole('button', { name: 'Review and approve' }).count(), 0,
    'not by who planned it');
  const clara = await h.person('clara');
  await h.logIn(clara, 'clara');
  await clara.goto(bob.url());
  await clara.getByRole('button', { name: 'Review and approve' }).click();
  await h.sign(clara);
  await clara.getByText('approved by clara').waitFor();
  await clara.goto(`${h.url}#/patients`);
  await clara.getByRole('link', { name: 'demo' }).click();
  await clara.getByRole('heading', { name: 'References' }).waitFor();
  await h.look(clara, 'patient', { axe: false });
  await clara.goto(`${h.url}#/audit`);
  await clara.getByRole('cell', { name: /approve/ }).first().waitFor();
  await h.look(clara, 'audit', { axe: false });
});

await h.step('the daily check of the real markers: no baseline, then passed', async () => {
  const bob = await h.person('checker');
  await h.logIn(bob, 'bob');
  const takeCheck = async (verdict, tries = 3) => {
    await bob.goto(`${h.url}#/check`);
    await bob.getByRole('button', { name: 'Start a check' }).click();
    await bob.getByRole('button', { name: /Start sweep|Scan again/ }).click(kSlow);
    await endSweep(bob);
    await bob.waitForURL(/#\/check/, kSlow);
    try {
      await bob.locator('.verdict', { hasText: verdict }).waitFor();
    } catch (error) {
      // The check asks for every marker of its baseline. A sweep may miss one at the edge of its
      // way, more so on a loaded machine, and is repeated then, as a person would.
      const said = await bob.locator('tbody tr').allInnerTexts();
      console.log(`    ${said.slice(0, 6).join(' | ').replace(/\s+/g, ' ')}`);
      const missed = said.some((row) => /Markers seen/.test(row) && !/within/.test(row));
      if (!missed || tries === 1) throw error;
      await takeCheck(verdict, tries - 1);
      return;
    }
    const rows = await bob.locator('tbody tr').allInnerTexts();
    console.log(`    ${rows.slice(0, 6).join(' | ').replace(/\s+/g, ' ')}`);
  };
  await takeCheck('NO BASELINE');
  await bob.getByText('A physicist other than the one who took this check').waitFor();
  const second = await h.person('second');
  await h.logIn(second, 'clara');
  await second.goto(`${h.url}#/check`);
  await second.getByText('Set as baseline…').click();
  await second.getByLabel('Reason for the new baseline').fill('first of this room');
  await second.locator('.take-baseline').getByLabel('Your password').fill(h.password);
  await second.getByRole('button', { name: 'Set as baseline' }).click();
  await bob.getByText('set by clara').waitFor();
  await takeCheck('PASSED');
  equal(await bob.getByText('A physicist other than').count(), 0, 'nothing is left to do');
  await h.look(bob, 'check', { axe: false });
  await bob.goto(`${h.url}#/status`);
  await bob.locator('.tile.good', { hasText: 'Daily check' }).waitFor();
  await bob.context().close();
});

await h.step('unplugging during a sweep is said, and the scan is discarded', async () => {
  await page.goto(`${h.url}#/scan`);
  await page.getByRole('button', { name: /Start sweep|Scan again/ }).click(kSlow);
  await page.getByRole('button', { name: 'End sweep' }).waitFor();
  await sim('unplug');
  await page.locator('.headline', { hasText: 'Sensor missing' }).waitFor(kSlow);
  await page.getByRole('alert').getByText('The sensor was unplugged').waitFor();
  await sim('plug');
  await page.locator('.headline', { hasText: 'Ready' }).waitFor(kSlow);
  const { scans } =
    await page.evaluate(() => fetch('/api/v1/scans').then((response) => response.json()));
  check(['failed', 'cancelled'].includes(scans[0].outcome),
    `the scan is no result: ${scans[0].outcome}`);
});

await h.step('settings and update', async () => {
  await page.goto(`${h.url}#/update`);
  await page.getByText('Installed version').waitFor();
  await h.look(page, 'update', { axe: false });
  await page.goto(`${h.url}#/settings`);
  await page.getByRole('button', { name: 'Save' }).waitFor();
  await h.look(page, 'settings', { axe: false });
});

await h.finish();
