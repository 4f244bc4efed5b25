// SPDX-License-Identifier: Apache-2.0
// The shortest day in Debian's Firefox: log-in, scan, result, acceptance, display in the room:
// firefox_test.mjs NODE_MODULES SERVER OUT_FOLDER FIREFOX
import { Harness } from './harness.mjs';

const [modules, server, folder, firefox] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium: firefox });
const { check, equal } = h;

const engineer = await h.person('engineer');
const anna = await h.person('anna');
const bob = await h.person('bob', { width: 360, height: 740 });
const room = await h.person('room', { width: 1920, height: 1080 });
let patient;

async function sweep(page, shows) {
  h.tell(shows);
  await page.goto(`${h.url}#/scan`);
  await page.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await page.getByRole('button', { name: 'End sweep' }).waitFor();
  await page.locator('.verdict').waitFor({ timeout: 60000 });
}

await h.step('set-up, accounts and log-in', async () => {
  await h.firstStart(engineer);
  h.tell('checked');
  await h.addAccountByApi(engineer, 'anna', 'physicist');
  await h.addAccountByApi(engineer, 'bob', 'physicist');
  await h.logIn(anna, 'anna');
  await h.logIn(bob, 'bob');
  check((await anna.evaluate(() => navigator.userAgent)).includes('Firefox'), 'Firefox');
  await h.look(anna, 'firefox-status');
});

await h.step('a patient, a reference scan, its plan and its approval', async () => {
  await h.addPatient(anna, 'PX-7', 'thorax');
  await anna.waitForURL(/#\/patient\//);
  patient = /patient\/(.*)$/.exec(anna.url())[1];
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await anna.waitForURL(/#\/scan/);
  await sweep(anna, 'checked');
  await anna.getByRole('link', { name: 'Open the draft' }).click();
  await anna.getByRole('button', { name: 'Save plan' }).click();
  await anna.getByText('Plan saved').first().waitFor();
  await h.acknowledge(bob);
  await bob.goto(anna.url());
  await bob.getByRole('button', { name: 'Review and approve' }).click();
  await h.sign(bob);
  await bob.getByText('approved by bob').first().waitFor();
  await h.look(bob, 'firefox-approved-phone');
});

await h.step('the display in the room is paired', async () => {
  await room.goto(`${h.url}room`);
  const code = (await room.locator('.pair-code').innerText()).trim();
  equal((await h.api(engineer, 'displays', 'POST',
    { code, name: 'wall', password: h.password })).status, 201, `pairing ${code}`);
  await room.locator('.room-top').waitFor();
});

await h.step('a fraction is scanned, seen in the room, and accepted', async () => {
  await h.api(anna, 'treatment/close', 'POST', { session_id: '' });
  await h.acknowledge(anna, bob);
  await anna.goto(`${h.url}#/patient/${patient}`);
  await anna.getByRole('button', { name: 'Start treatment session' }).click();
  await room.getByText('PX-7').waitFor();
  await sweep(anna, 'moved z 8 HFS');
  await anna.locator('.verdict', { hasText: 'MOVE' }).waitFor();
  await room.locator('.verdict, .room-word', { hasText: 'MOVE' }).first().waitFor();
  await h.look(anna, 'firefox-result-move');
  await h.look(room, 'firefox-room-move', { fullPage: false });
  await sweep(anna, 'tolerated');
  await anna.getByRole('button', { name: 'Accept' }).click();
  await anna.getByText('Accepted by anna').first().waitFor();
  await anna.getByRole('button', { name: 'Open the 3-D view' }).click();
  await anna.locator('canvas').first().waitFor();
  await h.look(anna, 'firefox-result-accepted');
});

await h.finish();
