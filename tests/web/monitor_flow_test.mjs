// SPDX-License-Identifier: Apache-2.0
// Live monitoring on the real appliance with its virtual sensor, as people work with it: a
// reference with its outline over the camera's picture, a sweep and its numbers, the sensor is
// mounted, the couch is brought in three steps to where they are zero, a breath is held, the sensor
// is nudged and unplugged, and the power is cut.
// monitor_flow_test.mjs NODE_MODULES PLUMBD PLUMB OUT_FOLDER CHROMIUM
import { execFile } from 'node:child_process';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { Harness } from './harness.mjs';

const [modules, plumbd, plumb, folder, chromium] = process.argv.slice(2);
const socket = join(folder, 'data', 'control.sock');
const kFrames = 120;
const h = await Harness.start({ modules, folder, chromium, command: [plumbd, '--simulated', 'demo',
  '--sim-couch', '--sim-size', '320x240', '--sim-scenes', '2', '--sim-frames', String(kFrames),
  '--state', 'FOLDER', '--listen', '127.0.0.1:0', '--control', socket] });
const { check, equal } = h;
const kSlow = { timeout: 180000 };
const kSweepSpeed = '0.4';  // what is tested is not how many images a loaded machine loses
const kNudged = '5';
const kHeld = '6';
const kSteps = ['2', '3', '4'];
const run = promisify(execFile);
const sim = (...words) => run(plumb, ['--control', socket, 'sim', ...words]);

const engineer = await h.person('engineer');
const tech = await h.person('tech', { width: 390, height: 844 });
const room = await h.person('room', { width: 1920, height: 1080 });
const both = [tech, room];

const state = async () => (await h.api(tech, 'status')).body;
const monitor = async () => (await h.api(tech, 'monitor')).body;
async function until(what, ask, holds) {
  for (const begun = Date.now(); ;) {
    const now = await ask();
    if (holds(now)) return now;
    check(Date.now() - begun < kSlow.timeout, `${what}: ${JSON.stringify(now)}`);
    await new Promise((ready) => { setTimeout(ready, 100); });
  }
}
const says = (page, word) =>
  page.locator('.live-advice', { hasText: word }).waitFor(kSlow);
/// How far the body is from the reference, mm; as both screens show it, none of them an old one.
const kShifts = ['lateral_mm', 'longitudinal_mm', 'vertical_mm'];
const distance_mm = ({ against_reference: numbers }) => (numbers
  ? Math.hypot(...kShifts.map((key) => numbers[key])) : NaN);
const shownFirst = (page) =>
  page.locator('.live-six.judged .live-number strong').first().innerText();

const hasSwept = ({ scan }) => scan?.frames_tracked + scan?.frames_dropped >= kFrames;
async function sweep() {
  await tech.goto(`${h.url}#/scan`);
  await tech.getByRole('button', { name: /Start sweep|Scan again/ }).click(kSlow);
  await until('the whole sweep', state, hasSwept);
  await tech.getByRole('button', { name: 'End sweep' }).click(kSlow);
  await tech.locator('.verdict').waitFor(kSlow);
}
async function look(name) {
  // All of it is on the screen, none of it over another part.
  const [head, view] = await Promise.all(['.room-top', '.live-view'].map((part) =>
    room.locator(part).evaluateAll(([one]) => one?.getBoundingClientRect().toJSON() ?? null)));
  check(!view || (view.top >= head.bottom - 1 && view.bottom <= 1081),
    `${name}: from ${view?.top} to ${view?.bottom}, below ${head.bottom}`);
  await h.look(tech, `flow-phone-${name}`, { axe: false });
  await h.look(room, `flow-room-${name}`, { axe: false, fullPage: false });
}

await h.step('a technician with a phone, and the screen in the room', async () => {
  await sim('speed', kSweepSpeed);
  await h.firstStart(engineer);
  await h.addAccountByApi(engineer, 'tech', 'technician');
  await h.logIn(tech, 'tech');
  await h.logIn(room, 'engineer');
  await room.goto(`${h.url}room`);
  await tech.goto(`${h.url}#/scan`);
  await tech.locator('.headline', { hasText: 'Ready' }).waitFor(kSlow);
});

await h.step('the first sweep becomes the reference; before it there is no outline', async () => {
  await tech.locator('.preview img').waitFor(kSlow);
  equal((await h.api(tech, 'preview/outline')).status, 404, 'no reference');
  equal(await tech.locator('.preview .lying').isVisible(), false, 'nor a drawing');
  await sweep();
});

await h.step('its outline lies over the picture, before and during the next sweep', async () => {
  await sim('next-scene');
  await tech.goto(`${h.url}#/status`);
  await tech.goto(`${h.url}#/scan`);
  await until('an outline', async () => (await h.api(tech, 'preview/outline')).body,
    ({ is_placed: isPlaced, lines }) => isPlaced && lines?.length > 0);
  await tech.locator('.preview .lying .line').waitFor(kSlow);
  await tech.locator('.preview').getByText('Yellow: the reference, version 1').waitFor();
  await h.look(tech, 'flow-phone-outline', { axe: false });
  await tech.getByRole('button', { name: /Start sweep|Scan again/ }).click(kSlow);
  await room.locator('.room-sweep .preview .lying .line').waitFor(kSlow);
  await room.locator('.room-sweep .marks-note').waitFor(kSlow);
  const [camera, note] = await room.evaluate(() => ['.camera', '.marks-note'].map((part) =>
    document.querySelector(part)?.getBoundingClientRect().toJSON()));
  check(!camera || camera.height === 0 || camera.bottom <= note.top + 1,
    `the picture down to ${camera?.bottom}, the note from ${note.top}`);
  await look('sweep-outline');
  await tech.getByRole('button', { name: 'End sweep' }).waitFor(kSlow);
  await until('the whole sweep', state, hasSwept);
  await tech.getByRole('button', { name: 'End sweep' }).click(kSlow);
  await tech.locator('.verdict.move').waitFor(kSlow);
  equal(await tech.locator('.number .value').count(), 6, 'six numbers');
});

let swept = '';
await h.step('the sensor is mounted, and the numbers go on from those of the sweep', async () => {
  await sim('speed', '1');
  await sim('mount');
  await until('the sensor at rest', state, ({ press }) => press === 'monitoring');
  await tech.goto(`${h.url}#/monitor`);
  await tech.getByRole('button', { name: 'Start monitoring' }).click(kSlow);
  for (const page of both) await says(page, 'OUT: HOLD');
  const { last_result: last } = await state();
  swept = last.id;
  check(distance_mm(await monitor()) > 3, 'as far as the sweep has said');
  await look('out');
});

await h.step('the couch comes in three steps to where they are zero', async () => {
  let before_mm = distance_mm(await monitor());
  for (const step of kSteps) {
    await sim('move', step);
    const isLast = step === kSteps.at(-1);
    const now = await until(`step ${step}`, monitor, (one) => (isLast ? one.advice === 'in'
      : distance_mm(one) < before_mm - 0.5));
    check(distance_mm(now) < before_mm - 0.5, `nearer: ${before_mm}, ${distance_mm(now)}`);
    check(isLast || now.advice !== 'in', `not yet: ${JSON.stringify(now)}`);
    before_mm = distance_mm(now);
  }
  for (const page of both) await says(page, '✓ IN');
  check(Math.abs(parseFloat((await shownFirst(room)).replace('−', '-'))) < 3, 'near zero');
  await look('in');
});

await h.step('a breath is held at a level that is taught', async () => {
  await sim('move', kHeld);
  const teach = tech.getByRole('button', { name: 'Teach this level' });
  await until('a settled breath', monitor, ({ breathing_mm: height }) => height > 4);
  await until('a taught level', async () => {
    await teach.click(kSlow);
    return monitor();
  }, ({ breath_hold: hold }) => hold !== null);
  await tech.getByText('Breath: in the window').waitFor(kSlow);
  await look('breath-held');
  await sim('move', kSteps.at(-1));  // breathes again
  await tech.getByText('Breath: outside the window').waitFor(kSlow);
  for (const page of both) await says(page, 'OUT: HOLD');
  await tech.getByRole('button', { name: 'End breath hold' }).click();
  for (const page of both) await says(page, '✓ IN');
});

await h.step('a nudged sensor says so, and nothing more', async () => {
  await sim('move', kNudged);
  for (const page of both) {
    await page.locator('.live-why', { hasText: 'The sensor was moved' }).waitFor(kSlow);
    await says(page, 'UNKNOWN: HOLD');
  }
  await look('nudged');
  equal((await monitor()).advice, 'unknown', 'hold');
});

await h.step('it is unplugged: monitoring ends, and no number is left', async () => {
  await sim('unplug');
  await until('no sensor', state, ({ state: now }) => now === 'no_sensor');
  await says(tech, 'Not monitoring');
  equal(await tech.locator('.live-number').count(), 0, 'no number');
  await room.locator('.room-word').waitFor(kSlow);
  await look('unplugged');
});

await h.step('what the sweep said does not hold where the couch has been since', async () => {
  await sim('plug');
  await until('a sensor', state, ({ state: now }) => now === 'ready');
  await sim('move', kSteps.at(-1));
  await tech.getByRole('button', { name: 'Start monitoring' }).click(kSlow);
  for (const page of both) {
    await page.locator('.live-why', { hasText: 'not found where it was scanned' }).waitFor(kSlow);
    await says(page, 'UNKNOWN: HOLD');
  }
  const now = await monitor();
  equal(now.against_reference, null, 'nothing against the reference');
  check(now.since_zero !== null, 'but since zero');
  await look('moved-since');
  await tech.getByRole('button', { name: 'Stop monitoring' }).click();
  await until('ready', state, ({ state: one }) => one === 'ready');
});

await h.step('a sweep confirms the position, and monitoring goes on from it', async () => {
  await sim('next-scene');  // the first body, which lies where the couch was brought to
  await sim('speed', kSweepSpeed);
  await sweep();
  await tech.locator('.verdict.in_tolerance').waitFor(kSlow);
  await sim('speed', '1');
  await sim('move', kSteps.at(-1));
  await until('the sensor at rest', state, ({ press }) => press === 'monitoring');
  await tech.goto(`${h.url}#/monitor`);
  await tech.getByRole('button', { name: 'Start monitoring' }).click(kSlow);
  for (const page of both) await says(page, '✓ IN');
});

let scan = '';
await h.step('a power cut while it is in: nothing is known, and nothing is accepted', async () => {
  const { id } = (await state()).last_result;
  scan = id;
  await until('numbers', monitor, ({ advice }) => advice === 'in');
  await h.cutPower();
  for (const page of both) {
    await page.getByText(/no connection/i).first().waitFor(kSlow);
    await page.waitForFunction(() => [...document.querySelectorAll('.live-number strong')]
      .every((one) => one.textContent === '–'));
    equal(await page.locator('.live-advice.in').count(), 0, 'nothing says in');
  }
  await look('power-cut');
  await h.powerOn();
  await tech.getByLabel('Password').waitFor(kSlow);
  await h.logIn(tech, 'tech');
  await until('ready', state, ({ state: now }) => now === 'ready');
  const now = await monitor();
  equal(now.active, false, 'it does not go on by itself');
  equal(now.against_reference, null, 'no number');
  equal((await h.api(tech, 'monitor/accept', 'POST',
    { password: h.password, reason: 'before the cut' })).status, 409, 'nothing is accepted');
  equal((await h.api(tech, 'monitor/start', 'POST')).status, 409, 'without a sweep');
});

await h.step('the records are there, also of the session that was cut off', async () => {
  for (const [of, count] of [[swept, 2], [scan, 1]]) {
    const { body } = await h.api(tech, `scans/${of}/monitoring`);
    equal(body.records.length, count, 'one for each');
    check(body.records.every(({ fault }) => !fault), JSON.stringify(body));
  }
  const [whole, cut] = await Promise.all([swept, scan].map((of) =>
    h.api(tech, `scans/${of}/monitoring/1.json`).then((answer) => answer.body)));
  check(whole.states_s.moved_sensor > 0, 'the nudge is in it');
  check(whole.states_s.monitoring > 1 && cut.states_s.monitoring > 0, 'times in each state');
  await tech.goto(`${h.url}#/monitoring/${swept}-1`);
  await tech.getByRole('heading', { name: 'Live monitoring' }).first().waitFor(kSlow);
  await h.look(tech, 'flow-phone-record', { axe: false });
  const audit = await h.api(engineer, 'audit?limit=50').catch(() => null);
  check(!JSON.stringify(audit?.body ?? '').includes('monitor.accept'), 'no acceptance in the log');
});

await h.finish();
