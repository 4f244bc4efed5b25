// SPDX-License-Identifier: Apache-2.0
// Live monitoring on the page and in the room: monitor_test.mjs NODE_MODULES SERVER OUT_FOLDER
// CHROMIUM
// The numbers follow, and an old one is never shown as a new one.
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

const engineer = await h.person('engineer');
const tech = await h.person('tech', { width: 390, height: 844 });
const room = await h.person('room', { width: 1920, height: 1080 });
const advice = (page) => page.locator('.live-advice').innerText();
const first = (page, part) => page.locator(`${part} .live-number strong`).first().innerText();

/// Ten times a second, as the appliance does.
let saying = null;
function keepSaying(words) {
  clearInterval(saying);
  h.tell(`watch ${words}`);
  saying = setInterval(() => h.tell(`watch ${words}`), 100);
}
const fallSilent = () => clearInterval(saying);

await h.step('accounts', async () => {
  await h.firstStart(engineer);
  await h.addAccountByApi(engineer, 'tech', 'technician');
  await h.logIn(tech, 'tech');
});

await h.step('it is started on the page', async () => {
  await tech.goto(`${h.url}#/monitor`);
  const start = tech.getByRole('button', { name: 'Start monitoring' });
  await start.waitFor();
  await start.click();
  await tech.locator('.live-advice', { hasText: 'Looking for the markers' }).waitFor();
  equal((await h.api(tech, 'status')).body.state, 'monitoring', 'the state');
  equal((await h.api(tech, 'monitor/start', 'POST')).status, 409, 'once');
});

await h.step('the numbers follow, since zero and against the reference apart', async () => {
  keepSaying('monitoring in none 0.5');
  await tech.getByText('✓ IN').waitFor();
  check((await advice(tech)).includes('✓ IN'), `advice: ${await advice(tech)}`);
  equal(await tech.locator('.live-six').count(), 2, 'two lines of numbers');
  equal(await tech.locator('.live-six.judged h2').innerText(), 'Against the reference', 'judged');
  equal(await first(tech, '.live-six.judged'), '+1.5 mm', 'against the reference');
  equal(await first(tech, '.live-six:not(.judged)'), '+0.5 mm', 'since zero');
  await tech.locator('.breathing .trace').waitFor();
  check(!await tech.locator('.live-view.is-old').count(), 'it is new');
  await h.look(tech, 'monitor-phone-in');
  keepSaying('monitoring out none 4.2');
  await tech.getByText('▲ OUT: HOLD').waitFor();
  equal(await first(tech, '.live-six.judged'), '+5.2 mm', 'the number has followed');
  await tech.locator('.live-why', { hasText: 'The couch was moved.' }).waitFor();
  await tech.getByText('Delay from image to value: 42 ms').waitFor();
  await h.look(tech, 'monitor-phone-out', { axe: false });
});

await h.step('the room shows the same, larger', async () => {
  await h.logIn(room, 'engineer');
  await room.goto(`${h.url}room`);
  await room.getByText('▲ OUT: HOLD').waitFor();
  keepSaying('monitoring in none -0.8');
  await room.getByText('✓ IN').waitFor();
  equal(await first(room, '.live-six.judged'), '+0.2 mm', 'in the room');
  const sizes = await Promise.all([room, tech].map((page) => page.locator('.live-advice')
    .evaluate((element) => parseFloat(getComputedStyle(element).fontSize))));
  check(sizes[0] > 2 * sizes[1], `larger: ${sizes}`);
  await room.locator('.live-view').getByText('Not connected to a beam').waitFor();
  // Nothing is below the screen, once it is drawn.
  await room.waitForFunction(() =>
    document.documentElement.scrollHeight <= window.innerHeight + 1);
  await h.look(room, 'monitor-room-in', { fullPage: false });
});

await h.step('the map shows how the body lies now, and what of it is not seen', async () => {
  const map = (page) => page.locator('.live-map canvas');
  equal(await map(room).isVisible(), false, 'none is known yet');
  h.tell('lies 12');
  const colours = (page) => map(page).evaluate((canvas) => {
    const pixel = (x, y) => Array.from(canvas.getContext('2d').getImageData(
      Math.floor(x * canvas.width), Math.floor(y * canvas.height), 1, 1).data.slice(0, 3));
    return { head: pixel(0.5, 0.15), feet: pixel(0.5, 0.7), hidden: pixel(0.5, 0.85) };
  });
  for (const page of [tech, room]) {
    await map(page).waitFor();
    const { head, feet, hidden } = await colours(page);
    check(head[0] > head[2] + 40, `orange where it is higher: ${head}`);
    check(feet[2] > feet[0] + 40, `blue where it is lower: ${feet}`);
    check(['255,255,255', '10,10,12'].includes(hidden.join()), `hatched: ${hidden}`);
  }
  await room.waitForFunction(() =>
    document.documentElement.scrollHeight <= window.innerHeight + 1);
  await h.look(tech, 'monitor-phone-map');
  await h.look(room, 'monitor-room-map', { fullPage: false });
  h.tell('lies -12');
  await room.waitForFunction(() => {
    const canvas = document.querySelector('.live-map canvas');
    const [r, , b] = canvas.getContext('2d').getImageData(
      canvas.width >> 1, Math.floor(0.15 * canvas.height), 1, 1).data;
    return b > r + 40;
  });
});

await h.step('one of two sensors fails: page and room say which one continues alone', async () => {
  h.tell('alone VIRTUAL-0002');
  for (const page of [tech, room]) {
    await page.locator('.live-view .caution', { hasText: 'VIRTUAL-0001 continues alone' })
      .waitFor();
  }
  await h.look(tech, 'monitor-phone-alone');
  await h.look(room, 'monitor-room-alone');
  h.tell('alone');
  for (const page of [tech, room]) {
    await page.locator('.live-view .caution', { hasText: 'continues alone' })
      .waitFor({ state: 'hidden' });
  }
});

await h.step('an unknown state says why', async () => {
  keepSaying('blind unknown covered 0');
  await tech.getByText('? UNKNOWN: HOLD').waitFor();
  await tech.locator('.live-why', { hasText: 'Too little of the body is seen.' }).waitFor();
  equal(await first(tech, '.live-six.judged'), '–', 'no number');
  await h.look(room, 'monitor-room-unknown', { axe: false, fullPage: false });
});

await h.step('an old number is grey, then gone, where no word comes', async () => {
  keepSaying('monitoring in none 0.5');
  await tech.getByText('✓ IN').waitFor();
  fallSilent();
  await tech.locator('.live-view.is-old').waitFor();
  check((await advice(tech)).includes('UNKNOWN'), 'what is old is not judged');
  await tech.locator('.live-why', { hasText: 'No image arrives.' }).waitFor();
  await tech.waitForFunction(() =>
    document.querySelector('.live-number strong').textContent === '–');
  await tech.locator('.breathing strong', { hasText: '–' }).waitFor();
  await h.picture(tech, 'monitor-phone-old.png');
});

await h.step('a sweep has to confirm, until the setting lets a signature', async () => {
  keepSaying('monitoring in none 0.5');
  await tech.getByText('A sweep must confirm the position').waitFor();
  equal(await tech.getByRole('button', { name: 'Accept this position' }).count(), 0, 'no button');
  const signed = await h.api(tech, 'monitor/accept', 'POST', { password: h.password });
  equal(signed.status, 409, 'by sweep');
  await h.api(engineer, 'settings', 'PUT', { accept_live: 'signature' });
  await tech.reload();
  const accept = tech.getByRole('button', { name: 'Accept this position' });
  await accept.waitFor();
  await tech.getByLabel('Your password').fill(h.password);
  await h.look(tech, 'monitor-phone-accept');
  await accept.click();
  await tech.getByText('✓ Accepted by tech').waitFor();
});

await h.step('a level is taught, and the screen for the patient coaches', async () => {
  keepSaying('monitoring in none 0.5');
  await tech.getByRole('button', { name: 'Teach this level' }).click();
  await tech.getByText(/^Level [\d.]+ mm, window 3.5 mm/).waitFor();
  // The window lies about the trace's height.
  await tech.locator('.breathing rect.gate').waitFor({ state: 'attached' });
  await h.look(tech, 'monitor-phone-gate', { axe: false });
  fallSilent();
  const level = (await h.api(tech, 'monitor')).body.breath_hold.level_mm;
  await room.goto(`${h.url}breath`);
  const words = room.locator('.breath-word');
  const breathe = async (height, breath, expected, picture) => {
    const speak = () => h.tell(`breathe ${height} ${breath}`);
    speak();
    saying = setInterval(speak, 100);
    await words.filter({ hasText: expected }).waitFor();
    if (picture) await h.look(room, picture, { fullPage: false, axe: picture === 'breath-good' });
    clearInterval(saying);
  };
  await breathe(level - 4, 'out', 'Breathe in a little more', 'breath-in');
  await breathe(level + 4, 'out', 'Breathe out a little');
  await breathe(level + 1, 'out', 'Hold your breath');
  await breathe(level, 'in', 'Good. Keep holding', 'breath-good');
  equal(/\d/.test(await room.locator('main').innerText()), false, 'no number');
  // Where no word comes it does not go on saying that all is good.
  await words.filter({ hasText: 'We cannot see your breathing' }).waitFor();
  equal(await room.locator('.breath-bar .air').count(), 0, 'no old height');
  keepSaying('monitoring in none 0.5');
  await tech.getByRole('button', { name: 'End breath hold' }).click();
  await words.filter({ hasText: 'Please breathe normally.' }).waitFor();
  await room.goto(`${h.url}room`);
  fallSilent();
});

await h.step('it ends by the button, and its numbers can be had', async () => {
  await tech.getByRole('button', { name: 'Stop monitoring' }).click();
  await tech.locator('.live-advice', { hasText: 'Not monitoring' }).waitFor();
  equal((await h.api(tech, 'status')).body.state, 'ready', 'the state');
  const answer = await tech.evaluate(async () => {
    const response = await fetch('/api/v1/monitor/record.csv');
    return [response.status, response.headers.get('Content-Disposition')];
  });
  equal(answer[0], 200, 'the record');
  check(answer[1].includes('plumb_monitoring.csv'), answer[1]);
  await room.locator('.live-view').waitFor({ state: 'detached' });
});

await h.step('a record beside its scan is read, and says that a power cut ended it', async () => {
  h.tell('recorded 000007');
  await tech.goto(`${h.url}#/monitoring/000007-1`);
  await tech.getByText('The record is incomplete').waitFor();
  await tech.getByText('4.5 mm every 3.8 s').waitFor();
  await tech.locator('dd', { hasText: 'IN: 4.3 min (90 %)' }).waitFor();
  await tech.locator('li', { hasText: 'Too little of the body is seen.' }).waitFor();
  await h.look(tech, 'monitor-record-phone');
  const taken = await tech.evaluate(() => fetch('/api/v1/scans/000007/monitoring/1.csv?download')
    .then((answer) => answer.headers.get('Content-Disposition')));
  check(taken.includes('plumb_monitoring_000007_1.csv'), taken);
});

await h.finish();
