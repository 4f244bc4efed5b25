// SPDX-License-Identifier: Apache-2.0
// A patient's set-up sheet, and the statistics of set-up: patient_test.mjs NODE_MODULES SERVER
// OUT_FOLDER CHROMIUM
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

const engineer = await h.person('engineer');
const anna = await h.person('anna');
const bob = await h.person('bob', { width: 360, height: 740 });
let patient;

const ok = async (page, path, method, body) => {
  const answer = await h.api(page, path, method, body);
  check(answer.status < 300, `${method} ${path}: ${answer.status} ${JSON.stringify(answer.body)}`);
  return answer.body;
};
const onSheet = (page) => page.locator('section', {
  has: page.getByRole('heading', { name: 'Set-up sheet' }),
});

async function sweep(page, shows) {
  h.tell(shows);
  await page.goto(`${h.url}#/scan`);
  await page.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await page.locator('.verdict').waitFor({ timeout: 60000 });
}

await h.step('a patient with an approved reference', async () => {
  await h.firstStart(engineer);
  h.tell('checked');
  await h.addAccountByApi(engineer, 'anna', 'physicist');
  await h.addAccountByApi(engineer, 'bob', 'physicist');
  await h.logIn(anna, 'anna');
  await h.logIn(bob, 'bob');
  patient = (await ok(anna, 'patients', 'POST', { code: 'PX-8', site: 'thorax' })).id;
  await ok(anna, `patients/${patient}/open`, 'POST',
    { purpose: 'reference', reason: '', replaces: '' });
  await h.acknowledge(anna, bob);
  await sweep(anna, 'checked');
  const { draft_reference_id: draft } = await ok(anna, `patients/${patient}`);
  const { plan, revision } = await ok(anna, `references/${draft}`);
  await ok(anna, `references/${draft}/plan`, 'PUT',
    { region_m: plan.region_m, isocentre_m: plan.isocentre_m, posture: plan.posture,
      couch_markers: false, shift_tolerance_mm: 3, rotation_tolerance_deg: 1, revision });
  const read = await ok(bob, `references/${draft}`);
  await ok(bob, `references/${draft}/approve`, 'POST', { revision: read.revision,
    digest: read.digest, password: h.password, reason: 'looked at it' });
  await ok(anna, 'treatment/close', 'POST', { session_id: '' });
  await h.acknowledge(anna, bob);
});

await h.step('alert and immobilisation are shown where it is confirmed who is there', async () => {
  await anna.goto(`${h.url}#/patient/${patient}`);
  await onSheet(anna).getByLabel('Alert').fill('pacemaker on the left');
  await onSheet(anna).getByLabel('Immobilisation').fill('wing board 3, knee rest B');
  await onSheet(anna).getByRole('button', { name: 'Save' }).click();
  await anna.locator('.set-up .caution', { hasText: 'pacemaker' }).first().waitFor();
  const session = anna.locator('section', {
    has: anna.getByRole('heading', { name: 'Session', exact: true }),
  });
  await session.getByText('pacemaker on the left').waitFor();
  await session.getByText('wing board 3, knee rest B').waitFor();
  equal((await ok(anna, `patients/${patient}`)).alert, 'pacemaker on the left', 'what is stored');
});

await h.step('a photo is taken with the sensor on purpose, and removed', async () => {
  equal(await anna.locator('.set-up-photo').count(), 0, 'none was taken by itself');
  h.tell('camera');
  for (const begun = Date.now(); (await h.api(anna, 'preview')).status !== 200;) {
    check(Date.now() - begun < 30000, 'a picture of the camera');
  }
  await onSheet(anna).getByRole('button', { name: 'Take a photo' }).click();
  const photo = onSheet(anna).locator('.set-up-photo');
  await photo.waitFor();
  check(await photo.evaluate((image) => image.decode().then(() => image.naturalWidth > 0)),
    'a picture');
  await h.look(anna, 'set-up-sheet');
  await bob.evaluate(() => localStorage.clear());
  await bob.goto(`${h.url}#/patient/${patient}`);
  await bob.locator('.set-up-photo').first().waitFor();
  await h.look(bob, 'set-up-sheet-phone');
  await onSheet(anna).getByRole('button', { name: 'Remove the photo' }).click();
  await photo.waitFor({ state: 'detached' });
  equal((await h.api(anna, `patients/${patient}/photo`)).status, 404, 'it is gone');
});

await h.step('mean and deviation over the fractions', async () => {
  for (const shows of ['moved z 8 HFS', 'moved z 4 HFS']) {
    await anna.goto(`${h.url}#/patient/${patient}`);
    await anna.getByRole('button', { name: /^Start (treatment session|a new fraction)/ }).click();
    await anna.waitForURL(/#\/scan/);
    await sweep(anna, shows);
    await sweep(anna, 'tolerated');
    await ok(anna, 'treatment/close', 'POST', { session_id: '' });
    await h.acknowledge(anna, bob);
  }
  const { courses: [course, ...others] } = await ok(anna, `patients/${patient}/statistics`);
  equal(others.length, 0, 'one reference, one course');
  equal(course.reference_version, 1, 'its version');
  equal(course.fractions, 2, 'fractions');
  equal(course.scans, 4, 'scans');
  await anna.goto(`${h.url}#/patient/${patient}`);
  const card = anna.locator('section',
    { has: anna.getByRole('heading', { name: 'Statistics' }) });
  await card.getByText('−6.0 ± 2.8 mm').waitFor();
  await card.locator('.trend').first().waitFor();
  await h.look(anna, 'statistics-patient');
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'Statistics' }).click();
  await anna.getByRole('cell', { name: 'PX-8' }).waitFor();
  await h.look(anna, 'statistics');
  await anna.getByLabel('Scan', { exact: true }).selectOption('last');
  await anna.getByRole('cell', { name: '−6.0 ± 2.8 mm' }).waitFor({ state: 'detached' });
  await bob.goto(`${h.url}#/statistics`);
  await bob.getByText('PX-8').first().waitFor();
  await h.look(bob, 'statistics-phone');
});

await h.finish();
