// SPDX-License-Identifier: Apache-2.0
// The shortest day in WebKitGTK: log-in, scan, result, acceptance, display in the room:
// webkit_test.mjs NODE_MODULES SERVER OUT_FOLDER DRIVER MINI_BROWSER XVFB
import { Harness } from './harness.mjs';
import { Person, startScreen } from './webdriver.mjs';

const [modules, server, folder, driver, browser, xvfb] = process.argv.slice(2);
const isThere = [driver, browser, xvfb].every((program) => program?.startsWith('/'));
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder,
  chromium: isThere ? driver : '' });
const { check, equal } = h;

const display = await startScreen(xvfb);
const person = (name, width = 1280, height = 900) =>
  Person.start({ driver, browser, display, folder, name, width, height });
const anna = await person('anna');
const bob = await person('bob', 400, 800);
const room = await person('room', 1920, 1080);
// The harness takes their pictures where a step fails.
h.browser.contexts = () => [{ pages: () => [anna, bob, room] }];
let patient;

/// A first log-in, with the password that somebody else chose.
async function logIn(page, name) {
  await page.goto(h.url);
  await page.fill('Name', name);
  await page.fill('Password', h.firstPassword);
  await page.click('button', 'Log in');
  await page.fill('Password that you were given', h.firstPassword);
  await page.fill('Your own password', h.password);
  await page.fill('Password again', h.password);
  await page.click('button', 'Change password');
  await page.until('the menu', () => page.run(() => Boolean(
    document.querySelector('#top a.brand') && !document.querySelector('[type=password]'))));
}

async function sweep(page, shows, verdict) {
  h.tell(shows);
  await page.goto(`${h.url}#/scan`);
  const begins = () => page.run(() => {
    const button = document.querySelector('button.giant');
    const words = button && !button.disabled ? button.textContent : '';
    return ['Start sweep', 'Scan again'].includes(words) ? words : '';
  });
  await page.until('a sweep', async () => {
    await page.click('button', await page.until('a button that starts', begins));
    // A press is lost where the screen is drawn anew just then.
    return page.until('its beginning', async () => !await begins(), 5000).catch(() => false);
  });
  await page.until(verdict, () => page.run(
    (word) => document.querySelector('.verdict .word')?.textContent.includes(word), verdict));
}

await h.step('set-up, accounts and log-in', async () => {
  check(/^MiniBrowser|WebKit/i.test(anna.browser), `WebKit, found ${anna.browser}`);
  await anna.goto(h.url);
  await anna.fill('Setup code', h.setupCode);
  await anna.fill('Name', 'engineer');
  await anna.fill('Password', h.password);
  await anna.fill('Password again', h.password);
  await anna.click('button', 'Create account');
  await anna.see('Ready');
  h.tell('checked');
  for (const name of ['anna', 'bob']) {
    equal((await anna.api('users', 'POST', { name, role: 'physicist',
      password: h.firstPassword, own_password: h.password })).status, 201, name);
  }
  await logIn(bob, 'bob');
  await bob.picture('webkit-status-phone');
});

await h.step('the display in the room is paired', async () => {
  await room.goto(`${h.url}room`);
  const code = await room.until('a code',
    () => room.run(() => document.querySelector('.pair-code')?.innerText.trim()));
  equal((await anna.api('displays', 'POST', { code, name: 'wall', password: h.password })).status,
    201, `pairing ${code}`);
  await room.until('the display', () => room.run(() =>
    Boolean(document.querySelector('.room-top'))));
  await anna.api('logout', 'POST');
  await logIn(anna, 'anna');
});

await h.step('a patient, a reference scan, its plan and its approval', async () => {
  const added = await anna.api('patients', 'POST', { code: 'PX-7', site: 'thorax' });
  equal(added.status, 201, 'a patient');
  patient = added.body.id;
  await anna.goto(`${h.url}#/patient/${patient}`);
  await anna.click('button', 'Scan a new reference');
  await sweep(anna, 'checked', 'New reference');
  await anna.click('link', 'Open the draft');
  await anna.click('button', 'Save plan');
  await anna.see('Waiting for a second physicist');
  const { body } = await anna.api(`patients/${patient}`);
  const { body: draft } = await bob.api(`references/${body.draft_reference_id}`);
  equal((await bob.api(`references/${draft.id}/approve`, 'POST', { revision: draft.revision,
    digest: draft.digest, password: h.password })).status, 200, 'the approval');
});

await h.step('a fraction is scanned, seen in the room, and accepted', async () => {
  await anna.api('treatment/close', 'POST', { session_id: '' });
  await anna.goto(`${h.url}#/patient/${patient}`);
  await anna.click('button', 'Start treatment session');
  await room.until('the patient in the room', () => room.run(() =>
    document.body.innerText.includes('PX-7')));
  await sweep(anna, 'moved z 8 HFS', 'MOVE');
  await anna.see('−8.0');
  await room.until('the verdict in the room', () => room.run(() =>
    document.body.innerText.includes('MOVE') && document.body.innerText.includes('−8.0')));
  await anna.picture('webkit-result-move');
  await room.picture('webkit-room-move');
  // Nothing is cut off or lies over something else.
  for (const page of [anna, room]) {
    equal(await page.run(() => document.documentElement.scrollWidth - window.innerWidth > 0), false,
      'no sideways scroll');
  }
  await sweep(anna, 'tolerated', 'IN TOLERANCE');
  await anna.click('button', 'Accept');
  await anna.see('Accepted by anna');
  await anna.picture('webkit-result-accepted');
});

for (const page of [anna, bob, room]) await page.close();
await h.finish();
