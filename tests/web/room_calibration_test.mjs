// SPDX-License-Identifier: Apache-2.0
// The room's calibration on the page: room_calibration_test.mjs NODE_MODULES SERVER OUT_FOLDER
// CHROMIUM
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

const engineer = await h.person('engineer');
const anna = await h.person('anna');
const bob = await h.person('bob');
const card = (page) => page.locator('.room-calibration');

await h.step('an engineer, a technician and a physicist log in', async () => {
  await h.firstStart(engineer);
  for (const [page, name, role] of [[anna, 'anna', 'technician'], [bob, 'bob', 'physicist']]) {
    await h.addAccountByApi(engineer, name, role);
    await h.logIn(page, name);
  }
});

async function scanBoard() {
  await bob.goto(`${h.url}#/check`);
  await card(bob).getByRole('button', { name: 'Start a scan of the board' }).click();
  await bob.locator('.who-line', { hasText: 'sweep over the board and all markers' }).waitFor();
  await bob.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await bob.waitForURL(/#\/check/, { timeout: 60000 });
}

await h.step('without a calibration directions are the patient’s, and a technician only reads',
  async () => {
  await anna.goto(`${h.url}#/check`);
  await card(anna).getByText('The axes of the room are not known: directions are those of the '
    + 'patient or of the reference marker, never of the couch. Calibrate the room').waitFor();
  equal(await card(anna).getByRole('button').count(), 0, 'nothing to start or to sign');
  await bob.goto(`${h.url}#/check`);
  const [board] = await Promise.all([bob.waitForEvent('download'),
    card(bob).getByRole('link', { name: 'Print the board (PDF)' }).click()]);
  equal(board.suggestedFilename(), 'plumb_room_board.pdf', 'the board');
  await h.look(bob, 'room-calibration-none');
});

await h.step('three scans, their spread, and a signature with the password', async () => {
  h.tell('board');
  await scanBoard();
  await card(bob).getByText('1 of 3 scans of the board have been made').waitFor();
  equal(await card(bob).getByRole('button', { name: 'Sign the calibration' }).count(), 0,
    'too early to sign');
  await scanBoard();
  await card(bob).getByText('2 of 3 scans of the board have been made').waitFor();
  await scanBoard();
  await card(bob).getByText(
    'The newest 3 scans differ by 0.37 mm and 0.06°; at most 1.0 mm and 0.2° are allowed.')
    .waitFor();
  equal(await card(bob).locator('tbody tr').count(), 3, 'one line a scan');
  await h.look(bob, 'room-calibration-three', { axe: false });
  // By the keyboard alone.
  await card(bob).getByLabel('Your password').focus();
  await bob.keyboard.type('wrong horse battery');
  await bob.keyboard.press('Enter');
  await bob.getByRole('alert').getByText('the password is wrong').waitFor();
  // The other page has no event stream for a while, so it is not notified of this change.
  const events = '**/api/v1/events';
  await anna.route(events, (route) => route.fulfill({ status: 503 }));
  const refused = anna.waitForResponse(events);
  await anna.reload();
  await card(anna).getByText('The newest 3 scans differ').waitFor();
  await refused;
  await card(bob).getByLabel('Your password').focus();
  await bob.keyboard.type(h.password);
  await bob.keyboard.press('Enter');
  await card(bob).getByText(
    /Version 1, signed by bob, .*\b(UTC|GMT)\b.*, gives every comparison the axes of the room/)
    .waitFor();
  await anna.unroute(events);
  // The stream is retried every 15 s; on a busy machine that can take longer than other steps may.
  await card(anna).getByText(/signed by bob/).waitFor({ timeout: 60000 });
  await h.look(bob, 'room-calibration-signed');
});

await h.step('due again, in Spanish, on a phone', async () => {
  // The other page asked for its data before, and its stream opens after this change.
  const events = '**/api/v1/events';
  let open;
  const later = new Promise((done) => { open = done; });
  await anna.route(events, async (route) => {
    await later;
    await route.continue();
  });
  await anna.reload();
  await card(anna).getByText(/signed by bob/).waitFor();
  h.tell('roomdue');
  await card(bob).getByText('Marker 4 moved 8 mm since the room was calibrated.').waitFor();
  open();
  await card(anna).getByText('Marker 4 moved 8 mm since the room was calibrated.').waitFor();
  await bob.evaluate(() => localStorage.setItem('plumb-language-bob', 'es'));
  await bob.setViewportSize({ width: 360, height: 740 });
  await bob.reload();
  await card(bob).getByText('El marcador 4 se movió 8 mm desde que se calibró la sala.').waitFor();
  const wide = await bob.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
  check(wide <= 0, `${wide} px lie out of view to the side`);
  await h.look(bob, 'room-calibration-due', { axe: false });
});

await h.finish();
