// SPDX-License-Identifier: Apache-2.0
// How many taps the tasks of a day take, keys not counted: none may come to take more.
// taps_test.mjs NODE_MODULES SERVER OUT_FOLDER CHROMIUM
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { equal } = h;

let taps = 0;
/// A browser whose taps are counted.
async function person(name) {
  const page = await h.person(name);
  await page.exposeFunction('plumbTapped', () => { ++taps; });
  await page.addInitScript(() => addEventListener('pointerdown', ({ isTrusted }) => {
    if (isTrusted) globalThis.plumbTapped();
  }, { capture: true }));
  return page;
}
async function takes(count, work) {
  taps = 0;
  await work();
  equal(taps, count, 'taps');
}
const button = (page, name) => page.getByRole('button', { name }).click();
/// A wristband's scanner types as fast as no person does.
const wristband = (page, code) => page.evaluate((text) => {
  document.activeElement?.blur();  // such events type into no field
  for (const key of [...text, 'Enter']) {
    (document.activeElement ?? document.body).dispatchEvent(
      new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
  }
}, code);

const engineer = await person('engineer');
const anna = await person('anna');
const bob = await person('bob');
const clara = await person('clara');
const room = await person('room');

await h.step('set-up and first account: one form', () => takes(1, () => h.firstStart(engineer)));

await h.step('an account and a screen in the room: one form each', async () => {
  h.tell('checked');
  await engineer.goto(`${h.url}#/users`);
  await takes(1, () => h.addAccount(engineer, 'anna', 'technician'));
  for (const name of ['bob', 'clara']) await h.addAccountByApi(engineer, name, 'physicist');
  for (const [page, name] of [[anna, 'anna'], [bob, 'bob'], [clara, 'clara']]) {
    await h.logIn(page, name);
  }
  await room.goto(`${h.url}room`);
  const code = await room.locator('.pair-code').innerText();
  await takes(1, async () => {
    await engineer.getByLabel('Code on the screen').fill(code);
    await engineer.getByLabel('Name of the screen').fill('couch side');
    await engineer.locator('form', { hasText: 'Name of the screen' }).getByLabel('Your password')
      .fill(h.password);
    await button(engineer, 'Pair the screen');
    await room.locator('.room-word').waitFor();
  });
});

await h.step('calibration of the room: two a sweep and the signature', async () => {
  h.tell('board');
  await bob.goto(`${h.url}#/check`);
  const card = bob.locator('.room-calibration');
  await takes(7, async () => {
    for (const made of ['1 of 3 scans', '2 of 3 scans', 'The newest 3 scans']) {
      await button(card, 'Start a scan of the board');
      await button(bob, /Start sweep|Scan again/);
      await bob.waitForURL(/#\/check/, { timeout: 60000 });
      await card.getByText(made).waitFor();
    }
    await card.getByLabel('Your password').fill(h.password);
    await button(card, 'Sign the calibration');
    await card.getByText('signed by bob').waitFor();
  });
});

await h.step('daily check: two', async () => {
  h.tell('checked');
  await anna.goto(`${h.url}#/check`);
  await takes(2, async () => {
    await button(anna, 'Start a check');
    await button(anna, /Start sweep|Scan again/);
    await anna.waitForURL(/#\/check/, { timeout: 60000 });
  });
});

await h.step('a new patient until the reference is there: three', async () => {
  await takes(3, async () => {
    await h.addPatient(anna, 'PX-1', 'thorax');
    await button(anna, 'Scan a new reference');
    await button(anna, /Start sweep|Scan again/);
    await anna.getByText('Saved as draft version 1.').waitFor({ timeout: 60000 });
  });
});

await h.step('a plan: its link, four corners, and one to save', async () => {
  await bob.goto(`${h.url}#/patients`);
  await bob.getByRole('link', { name: 'PX-1' }).click();
  await takes(6, async () => {
    await bob.getByRole('link', { name: 'Plan, Version 1' }).click();
    await h.drawRegion(bob, [[0.3, 0.3], [0.7, 0.3], [0.72, 0.7], [0.28, 0.7]]);
    await button(bob, 'Save plan');
    await bob.getByRole('status').getByText('Plan saved.').waitFor({ state: 'attached' });
  });
});

await h.step('its approval: three, with the link', async () => {
  await clara.goto(`${h.url}#/patients`);
  await clara.getByRole('link', { name: 'PX-1' }).click();
  await takes(3, async () => {
    await clara.getByRole('link', { name: 'Plan, Version 1' }).click();
    await button(clara, 'Review and approve');
    await h.sign(clara);
    await clara.getByText('approved by clara').first().waitFor();
  });
});

await h.step('a fraction, from the wristband to six numbers: two; then one each to scan again, '
  + 'to accept and to close', async () => {
  await anna.goto(`${h.url}#/scan`);
  await button(anna, 'Close session');
  await anna.getByText('No session open').first().waitFor();
  await h.acknowledge(bob, clara);
  h.tell('moved z 8 HFS');
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'PX-1' }).waitFor();
  await takes(2, async () => {
    await wristband(anna, 'PX-1');
    await button(anna, 'Start treatment session');
    await button(anna, /Start sweep|Scan again/);
    await anna.locator('.verdict.move').waitFor({ timeout: 60000 });
    equal(await anna.locator('.number').count(), 6, 'numbers');
  });
  await takes(2, async () => {
    await anna.getByText('Accept outside tolerance…').click();
    await anna.getByLabel('Reason', { exact: true }).fill('swelling');
    await anna.getByLabel('Your password').fill(h.password);
    await button(anna, 'Accept outside tolerance');
    await anna.getByText(/Accepted outside tolerance by anna/).waitFor();
  });
  h.tell('tolerated');
  await anna.goto(`${h.url}#/scan`);
  await takes(1, async () => {
    await button(anna, /Start sweep|Scan again/);
    await anna.locator('.verdict.in_tolerance').waitFor({ timeout: 60000 });
  });
  await takes(1, async () => {
    await button(anna, 'Accept');
    await anna.getByText('Accepted by anna').waitFor();
  });
  await takes(1, async () => {
    const close = anna.locator('.acceptance').getByRole('button', { name: 'Close session' });
    await close.click();
    await close.waitFor({ state: 'detached' });
  });
});

await h.finish();
