// SPDX-License-Identifier: Apache-2.0
// A whole day on the real appliance with its virtual sensor, as people work through it: the room's
// calibration, the daily check, a reference, its plan, the approval by a second person, three
// fractions with moves and accepts by two technicians on one tablet, a power cut in the middle of a
// sweep, a lost network, and the report. Nothing is accepted that its person had not been shown.
// day_test.mjs NODE_MODULES PLUMBD PLUMB OUT_FOLDER CHROMIUM
import { execFile } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { Harness } from './harness.mjs';

const [modules, plumbd, plumb, folder, chromium] = process.argv.slice(2);
const socket = join(folder, 'data', 'control.sock');
const kReference = 3;  // scenes: three of the board, the body, the body moved
const kMoved = 4;
const kScenes = 5;
// Small and short sweeps: what is tested is the way through the day, not the accuracy.
const h = await Harness.start({ modules, folder, chromium, command: [plumbd, '--simulated', 'demo',
  '--sim-board', '--sim-size', '320x240', '--sim-scenes', String(kScenes), '--sim-frames', '120',
  '--state', 'FOLDER', '--listen', '127.0.0.1:0', '--control', socket] });
const { check, equal } = h;
const kSlow = { timeout: 180000 };
const run = promisify(execFile);
let shown = 0;
/// The next scene of the last one is the first.
async function scene(number) {
  for (; shown !== number; shown = (shown + 1) % kScenes) {
    await run(plumb, ['--control', socket, 'sim', 'next-scene']);
  }
}
/// At half the speed: what is tested is not how many images a loaded machine loses.
const slowDown = () => run(plumb, ['--control', socket, 'sim', 'speed', '0.5']);
const button = () => run(plumb, ['--control', socket, 'press']);

const engineer = await h.person('engineer');
const anna = await h.person('anna', { width: 1280, height: 800 });
const bob = await h.person('bob');
const clara = await h.person('clara');
const room = await h.person('room');

const state = async () => (await h.api(bob, 'status')).body;
async function until(what, holds) {
  for (const begun = Date.now(); !holds(await state());) {
    check(Date.now() - begun < kSlow.timeout, what);
    await new Promise((ready) => { setTimeout(ready, 100); });
  }
}
/// A sweep by the page, as the screen says; it ends by itself where nothing new is to be seen.
async function scanOn(page) {
  await page.getByRole('button', { name: /Start sweep|Scan again/ }).click(kSlow);
  await page.getByRole('button', { name: 'End sweep' }).waitFor(kSlow);
}
/// The same by the button in the room.
async function scanByButton() {
  const before = (await state()).last_result?.id;
  await button();
  await until('a result',
    (status) => status.state === 'result' && status.last_result?.id !== before);
}

/// Every acceptance: the scan, who signs, and what the page showed to them at that moment.
const signed = [];
async function accept(person, press) {
  const cards = await anna.locator('.number .value').allInnerTexts();
  equal(cards.length, 6, 'six numbers in view of whoever accepts');
  const link = await anna.locator('a[href^="/result?scan="]').first().getAttribute('href');
  signed.push({
    id: new URLSearchParams(link.split('?')[1]).get('scan'), person,
    verdict: (await anna.locator('.verdict').getAttribute('class')).split(' ').at(-1),
    values: cards.map((text) => text.replace('−', '-').replace(/[^-+.\d]/g, '')),
  });
  await press();
}
const acceptInTolerance = (person) => accept(person, async () => {
  await anna.getByRole('button', { name: 'Accept', exact: true }).click();
  await anna.getByText(new RegExp(`Accepted by ${person}`)).waitFor();
});

const kPins = { anna: '4711', dora: '2580' };
async function setPin(name) {
  await anna.goto(`${h.url}#/users`);
  const own = anna.locator('section.card',
    { has: anna.getByRole('heading', { name: 'My PIN or badge' }) });
  await own.getByLabel('New PIN').fill(kPins[name]);
  await own.getByLabel('The same again').fill(kPins[name]);
  await own.getByLabel('Your password').first().fill(h.password);
  await own.getByRole('button', { name: 'Set PIN or badge' }).click();
  await own.getByText('Set.', { exact: true }).waitFor();
}
/// At the same tablet, on the screen that is open.
async function changeTo(name) {
  await anna.getByRole('button', { name: 'Change person' }).click();
  const box = anna.locator('dialog');
  await box.getByRole('button', { name }).click();
  for (const digit of kPins[name]) {
    await box.getByRole('button', { name: digit, exact: true }).click();
  }
  await box.getByRole('button', { name: 'Log in' }).click();
  await anna.getByText(`${name}, with a PIN`).waitFor();
}

await h.step('first start, four accounts, and the screen in the room', async () => {
  await slowDown();
  await h.firstStart(engineer);
  await engineer.locator('.headline', { hasText: 'Ready' }).waitFor(kSlow);
  await engineer.goto(`${h.url}#/users`);
  for (const [name, role] of [['anna', 'technician'], ['dora', 'technician'], ['bob', 'physicist'],
    ['clara', 'physicist']]) {
    await h.addAccount(engineer, name, role);
  }
  await room.goto(`${h.url}room`);
  await engineer.getByLabel('Code on the screen')
    .fill(await room.locator('.pair-code').innerText());
  await engineer.getByLabel('Name of the screen').fill('couch side');
  await engineer.locator('form', { hasText: 'Name of the screen' }).getByLabel('Your password')
    .fill(h.password);
  await engineer.getByRole('button', { name: 'Pair the screen' }).click();
  await room.locator('.room-code').waitFor(kSlow);
  await engineer.goto(`${h.url}#/settings`);
  await engineer.getByLabel('Stop a sweep after').fill('3');
  await engineer.getByRole('button', { name: 'Save', exact: true }).click();
  await engineer.getByRole('status').getByText('Saved.').waitFor({ state: 'attached' });
  // Two technicians share the tablet.
  await h.logIn(anna, 'dora');
  await setPin('dora');
  await anna.getByRole('button', { name: 'Log out' }).click();
  for (const [page, name] of [[anna, 'anna'], [bob, 'bob'], [clara, 'clara']]) {
    await h.logIn(page, name);
  }
  await setPin('anna');
  // The demo opens a patient of its own; this day has another one.
  const { session } = await state();
  if (session) {
    equal((await h.api(anna, 'treatment/close', 'POST', { session_id: session.id })).status, 200,
      'closed');
  }
  await h.acknowledge(engineer, anna, bob, clara);
});

await h.step('the room is calibrated: three scans of the board, signed', async () => {
  const card = bob.locator('.room-calibration');
  for (const [number, said] of [[0, '1 of 3 scans of the board have been made'],
    [1, '2 of 3 scans of the board have been made'], [2, 'The newest 3 scans differ by']]) {
    await scene(number);
    await bob.goto(`${h.url}#/check`);
    await card.getByRole('button', { name: 'Start a scan of the board' }).click();
    await scanOn(bob);
    await bob.waitForURL(/#\/check/, kSlow);
    await card.getByText(said).waitFor(kSlow);
  }
  console.log(`    ${await card.getByText('The newest 3 scans differ').innerText()}`);
  await card.getByLabel('Your password').fill(h.password);
  await card.getByRole('button', { name: 'Sign the calibration' }).click();
  await card.getByText(/Version 1, signed by bob/).waitFor();
  await h.look(bob, 'calibration');
});

await h.step('the daily check: another person sets the baseline, the next one passes', async () => {
  await scene(kReference);
  const takeCheck = async (verdict) => {
    await anna.goto(`${h.url}#/check`);
    await anna.getByRole('button', { name: 'Start a check' }).click();
    await anna.getByText('sweep over all markers of the room').waitFor();
    await scanOn(anna);
    await anna.waitForURL(/#\/check/, kSlow);
    await anna.locator('.verdict', { hasText: verdict }).waitFor(kSlow);
  };
  await takeCheck('NO BASELINE');
  await room.locator('.verdict', { hasText: 'NO BASELINE' }).waitFor(kSlow);
  await clara.goto(`${h.url}#/check`);
  await clara.getByText('Set as baseline…').click();
  await clara.getByLabel('Reason for the new baseline').fill('first of this room');
  await clara.locator('.take-baseline').getByLabel('Your password').fill(h.password);
  await clara.getByRole('button', { name: 'Set as baseline' }).click();
  await clara.getByText('set by clara').waitFor();
  await takeCheck('PASSED');
  await room.locator('.verdict', { hasText: 'PASSED' }).waitFor(kSlow);
  await room.locator('.room-marks .good', { hasText: 'Daily check passed' }).waitFor();
  await h.look(room, 'room-check', { fullPage: false });
});

await h.step('a new patient is scanned for a reference; it waits as a draft', async () => {
  await h.addPatient(anna, 'PX-0100', 'thorax');
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await scanOn(anna);
  await anna.getByText('Saved as draft version 1.').waitFor(kSlow);
  await room.locator('.verdict', { hasText: 'REFERENCE SCANNED' }).waitFor(kSlow);
  await anna.goto(`${h.url}#/status`);
  await anna.locator('.tile li', { hasText: 'Waiting for a plan: PX-0100' }).waitFor();
  await h.look(anna, 'waiting');
});

await h.step('one physicist plans, a second one approves', async () => {
  await bob.goto(`${h.url}#/status`);
  await bob.locator('.tile', { hasText: 'Draft references' })
    .getByRole('link', { name: 'PX-0100' }).click();
  const map = await h.drawRegion(bob, [[0.35, 0.35], [0.65, 0.35], [0.65, 0.65], [0.35, 0.65]]);
  await map.press('i');
  // Wider than usual: sweeps of this size leave 1 to 2 mm of uncertainty.
  await bob.getByLabel('Shifts (mm)').fill('6');
  await bob.getByLabel('Rotations (degrees)').fill('3');
  await h.look(bob, 'plan');
  await bob.getByRole('button', { name: 'Save plan' }).click();
  await bob.getByRole('status').getByText('Plan saved.').waitFor({ state: 'attached' });
  await clara.goto(`${h.url}${new URL(bob.url()).hash}`);
  await clara.getByRole('button', { name: 'Review and approve' }).click();
  await h.look(clara, 'approval');
  await h.sign(clara);
  await clara.getByText('approved by clara').waitFor();
});

async function openSession(fraction) {
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'PX-0100', exact: true }).click();
  await anna.getByRole('button', { name: /^Start (treatment session|a new fraction)$/ }).click();
  await anna.locator('.who-line', { hasText: `Fraction ${fraction}` }).waitFor();
}
async function closeSession() {
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: 'Close session' }).click();
  const anyway = anna.getByRole('button', { name: 'Close without acceptance' });
  await anna.getByText('No session open').or(anyway).first().waitFor();
  if (await anyway.count()) await anyway.click();
  await anna.getByText('No session open').first().waitFor();
}
const verdict = (page, kind) => page.locator(`.verdict.${kind}`).waitFor(kSlow);

await h.step('fraction 1: one tap to six numbers, the couch is moved, another person accepts',
  async () => {
  await openSession(1);
  await scene(kMoved);
  let taps = 0;
  await anna.exposeFunction('plumbTapped', () => { ++taps; });
  await anna.evaluate(
    () => addEventListener('pointerdown', () => globalThis.plumbTapped(), { capture: true }));
  await scanOn(anna);
  await verdict(anna, 'move');
  equal(await anna.locator('.number').count(), 6, 'six numbers');
  equal(taps, 1, 'taps from the open session to the numbers');
  await verdict(room, 'move');
  equal(await room.locator('.number').count(), 6, 'six numbers in the room');
  await h.look(anna, 'fraction-1-move');
  await h.look(room, 'room-move', { fullPage: false });
  await changeTo('dora');
  await scene(kReference);  // as if the couch had been moved
  await scanByButton();
  await verdict(anna, 'in_tolerance');
  await verdict(room, 'in_tolerance');
  await acceptInTolerance('dora');
  await closeSession();
});

await h.step('fraction 2: a power cut in the middle of a sweep leaves nothing to accept',
  async () => {
  await openSession(2);
  await scene(kMoved);
  await scanOn(anna);
  const { scan: cut } = await state();
  await h.cutPower();
  // Whoever stands there sees that nothing is known; no number of before comes in its place.
  for (const page of [anna, room]) {
    await page.getByText(/no connection/i).first().waitFor(kSlow);
    await page.getByText(/last known: scanning/i).first().waitFor();
  }
  equal(await anna.getByRole('button', { name: /^Accept/ }).count(), 0, 'nothing to accept');
  equal(await anna.locator('.number .arrow').count(), 0, 'no arrow to follow');
  await h.powerOn();
  shown = 0;  // the simulated device starts with its first scene again
  await slowDown();
  // Nobody is logged in any more, and a PIN counts only once the password has been given again.
  await anna.getByLabel('Password').waitFor(kSlow);
  await h.logIn(bob, 'bob');
  await h.logIn(engineer, 'engineer');
  await until('the unit is ready', ({ state: now }) => now === 'ready');
  await h.logIn(clara, 'clara');
  await h.logIn(anna, 'anna');
  await anna.getByRole('button', { name: 'Log out' }).click();
  await h.logIn(anna, 'dora');
  // The demo has opened its own patient.
  await h.acknowledge(anna, bob, clara);
  await anna.goto(`${h.url}#/result/${cut.id}`);
  await anna.locator('.verdict.none').waitFor();
  await h.look(anna, 'after-power-cut', { axe: false });
  equal(await anna.locator('.number').count(), 0, 'no numbers of a sweep that was cut off');
  for (const way of ['accept', 'accept-outside']) {
    const { status } = await h.api(anna, `scans/${cut.id}/${way}`, 'POST',
      way === 'accept' ? undefined : { reason: 'the power was gone', password: h.password });
    equal(status, 409, `${way} of a sweep that was cut off`);
  }
});

await h.step('the session is resumed, and accepted outside tolerance with a password', async () => {
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'PX-0100', exact: true }).click();
  await anna.getByRole('button', { name: /^Resume fraction 2/ }).click();
  await anna.getByRole('button', { name: /^Close demo.*, open PX-0100/ }).click();
  await anna.locator('.who-line', { hasText: 'Fraction 2' }).waitFor();
  await scene(kMoved);
  // The control socket refuses as the button does, in the language of whoever types.
  equal((await h.api(engineer, 'settings', 'PUT', { scan_wristband: true })).status, 200, 'asked');
  const { stdout: refusal } = await run(plumb,
    ['--language', 'de', '--control', socket, 'press']);
  check(/lesen Sie zuerst das Armband des Patienten/.test(refusal), `the refusal: ${refusal}`);
  await anna.getByLabel('Wristband of PX-0100').fill('px0100');
  await anna.locator('.wristband').getByRole('button', { name: 'Confirm' }).click();
  await anna.getByText('PX-0100 confirmed for the next sweep').waitFor();
  await scanByButton();
  equal((await h.api(engineer, 'settings', 'PUT', { scan_wristband: false })).status, 200, 'not');
  await anna.goto(`${h.url}#/result`);
  await verdict(anna, 'move');
  await verdict(room, 'move');
  await accept('dora', async () => {
    await anna.getByText('Accept outside tolerance…').click();
    await anna.getByLabel('Reason', { exact: true }).fill('the couch is at its end stop');
    await anna.getByLabel('Your password').fill(h.password);
    await anna.getByRole('button', { name: 'Accept outside tolerance' }).click();
    await anna.getByText(/Accepted outside tolerance by dora, .*: the couch is at its end stop/)
      .waitFor();
  });
  await closeSession();
});

await h.step('fraction 3: one press of the button, and the sweep ends by itself', async () => {
  await changeTo('anna');
  await openSession(3);
  await scene(kReference);
  await button();
  await verdict(anna, 'in_tolerance');
  await verdict(room, 'in_tolerance');
  equal(await anna.locator('.number').count(), 6, 'six numbers');
});

await h.step('the network is lost for 7 s: nothing can be accepted until what is shown holds',
  async () => {
  const begun = Date.now();
  const offers = anna.getByRole('button', { name: /^Accept/ });
  h.server.kill('SIGSTOP');
  try {
    for (const page of [anna, room]) {
      await page.locator('.old-note', { hasText: 'NO CONNECTION' }).waitFor({ timeout: 15000 });
      equal(await page.locator('.number .arrow').count(), 0, 'no arrow to follow');
    }
    // To the end of the 7 s.
    do equal(await offers.count(), 0, 'nothing to accept'); while (Date.now() - begun < 7000);
  } finally {
    h.server.kill('SIGCONT');
  }
  await anna.locator('.old-note', { hasText: 'NO CONNECTION' }).waitFor({ state: 'detached' });
  await offers.waitFor();
});

await h.step('a tablet without network accepts neither a result that has been replaced nor the new',
  async () => {
  const { last_result: before } = await state();
  const offer = anna.getByRole('button', { name: 'Accept', exact: true });
  // It goes as the finger comes down, and then for longer.
  const request = /\/accept$/;
  await anna.route(request, (route) => route.abort());
  await offer.click();
  await anna.getByRole('alert').getByText('The appliance is not responding').waitFor(kSlow);
  await anna.unroute(request);
  await h.sleep(anna, 7);  // a stream that is open survives the loss of a network in this browser
  await anna.locator('.old-note', { hasText: 'NO CONNECTION' }).waitFor(kSlow);
  equal(await offer.count(), 0, 'nothing to accept');
  await scanByButton();
  const { last_result: newest } = await state();
  check(newest.id !== before.id, 'another result');
  equal((await h.api(bob, `scans/${before.id}`)).body.accepted_by, null, 'the tap changed nothing');
  equal((await h.api(bob, `scans/${before.id}/accept`, 'POST')).status, 409,
    'the one before is no longer accepted by anybody');
  await h.wake(anna);
  // The tablet comes to the newest by itself, shows it, and only then offers it.
  await anna.locator(`a[href^="/result?scan=${newest.id}&"]`).first()
    .waitFor({ state: 'attached', ...kSlow });
  await verdict(anna, 'in_tolerance');
  await acceptInTolerance('anna');
  await anna.locator('.trend').first().waitFor();
  await h.look(anna, 'fraction-3');
  await closeSession();
});

await h.step('exactly what was accepted had been shown, number by number, to whoever signed',
  async () => {
  const { scans } = (await h.api(clara, 'scans?limit=50')).body;
  const accepted = scans.filter(({ accepted_by: who }) => who).reverse();
  equal(JSON.stringify(accepted.map(({ id, accepted_by: who }) => [id, who])),
    JSON.stringify(signed.map(({ id, person }) => [id, person])), 'scans and people');
  for (const [i, { result }] of accepted.entries()) {
    equal(result.verdict, signed[i].verdict, `verdict of ${accepted[i].id}`);
    for (const [k, { name, value }] of result.numbers.entries()) {
      const text = signed[i].values[k];
      const digits = (text.split('.')[1] ?? '').length;
      check(Math.abs(Number(text) - value) <= 0.5 * 10 ** -digits + 1e-6,
        `${name} of ${accepted[i].id}: ${value} was shown as ${text}`);
    }
  }
  const { entries } = (await h.api(clara, 'audit?limit=200')).body;
  equal(entries.filter(({ action }) => /^scan\.accept/.test(action)).length, signed.length,
    'acceptances in the log');
  console.log(`    ${signed.length} acceptances: ${signed.map(({ person, verdict: word, values }) =>
    `${person} ${word} (${values.join(' ')})`).join('; ')}`);
});

await h.step('on a slow line: 1.5 MB at most before the map is there, 10 s at 1 Mbit/s',
  async () => {
  const slow = await h.person('slow');
  const line = await slow.context().newCDPSession(slow);
  await line.send('Network.enable');
  let bytes = 0;
  line.on('Network.loadingFinished', ({ encodedDataLength }) => { bytes += encodedDataLength; });
  await h.logIn(slow, 'bob');
  await slow.locator('.tile').first().waitFor();
  const { scans } = (await h.api(slow, 'scans')).body;
  const moved = scans.filter(({ result }) => result?.verdict === 'move');
  const seconds = async (one) => {
    const begun = Date.now();
    await slow.goto(`${h.url}#/result/${one.id}`);
    await slow.locator('canvas.map[data-map=before]').waitFor(kSlow);
    return (Date.now() - begun) / 1000;
  };
  // What this machine takes by itself, with whatever else it does, is not the line's.
  const logIn = bytes;
  const own = await seconds(moved[1]);
  await slow.goto(`${h.url}#/status`);
  await line.send('Network.emulateNetworkConditions',
    { offline: false, latency: 50, downloadThroughput: 125000, uploadThroughput: 125000 });
  bytes = logIn;
  const whole = await seconds(moved[0]);
  console.log(`    ${bytes} bytes since the login page, ${bytes - logIn} of them for the result; `
    + `the map after ${whole.toFixed(1)} s, ${own.toFixed(1)} s on a fast line`);
  check(bytes < 1.5e6, `at most 1.5 MB before the map is there, found ${bytes} bytes`);
  check(whole < 10 + own,
    `the map is there within 10 s on a slow line, found ${whole} s, ${own} s on a fast one`);
  await slow.context().close();
});

await h.step('the history, the reports and the log tell the day in the words that people know',
  async () => {
  await clara.goto(`${h.url}#/patients`);
  await clara.getByRole('link', { name: 'PX-0100', exact: true }).click();
  await clara.getByRole('region', { name: 'Scans' }).locator('tbody tr').nth(6).waitFor();
  const rows =
    await clara.getByRole('region', { name: 'Scans' }).locator('tbody tr').allInnerTexts();
  equal(rows.length, 7, 'a reference and six scans, one of them cut off');
  equal(rows.filter((row) => row.includes('dora')).length, 2, 'two were accepted by dora');
  equal(rows.filter((row) => row.includes('anna')).length, 1, 'and one by anna');
  await h.look(clara, 'patient');
  const { scans } = (await h.api(clara, `patients/${clara.url().split('/').at(-1)}/scans`)).body;
  const fetched = (path) => clara.evaluate(async (where) => {
    const response = await fetch(`/api/v1/${where}`);
    return { status: response.status, bytes: [...new Uint8Array(await response.arrayBuffer())] };
  }, path);
  for (const [name, path] of [['report', `scans/${scans[0].id}/report.pdf`],
    ['report-outside', `scans/${scans[2].id}/report.pdf`],
    ['report-es', `scans/${scans[0].id}/report.pdf?language=es`],
    ['course', `patients/${scans[0].patient_id}/report.pdf`],
    ['course-es', `patients/${scans[0].patient_id}/report.pdf?language=es`]]) {
    const { status, bytes } = await fetched(path);
    equal(status, 200, path);
    equal(Buffer.from(bytes.slice(0, 5)).toString(), '%PDF-', `${path} is a PDF`);
    writeFileSync(h.file(`${name}.pdf`), Buffer.from(bytes));
  }
  await clara.goto(`${h.url}#/audit`);
  await clara.getByRole('cell', { name: 'Scan accepted outside tolerance' }).waitFor();
  const on = async (action) => (await clara.locator('tbody tr',
    { has: clara.getByRole('cell', { name: action, exact: true }) })
    .first().locator('td').nth(3).innerText());
  equal(await on('Reference approved'), 'PX-0100, reference version 1', 'the approval');
  equal(await on('Session opened'), 'PX-0100, Fraction 3', 'the newest session');
  equal(await on('Scan accepted'), `PX-0100, scan ${scans[0].id}`, 'the newest accept');
  equal(await on('Scan started'), 'PX-0100, Fraction 3', 'the newest scan');
  const started = await clara.locator('tbody tr',
    { has: clara.getByRole('cell', { name: 'Scan started', exact: true }) }).allInnerTexts();
  check(/the control socket/.test(started[0]), `the press on the control socket: ${started[0]}`);
  check(started.some((row) => /\banna\b.*PX-0100, Fraction 1/s.test(row)),
    `the first on the page: ${started.join(' | ')}`);
  equal(await on('Patient added'), 'PX-0100', 'the patient');
  equal(await on('Screen paired'), 'couch side', 'the screen');
  check(/^check of /.test(await on('Baseline set')), `the check: ${await on('Baseline set')}`);
  await h.look(clara, 'audit');
});

await h.finish();
