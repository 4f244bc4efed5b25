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
  await session.getByRole('img', { name: 'Body of the reference, from above' }).waitFor();
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
});

const drawing = (page) => onSheet(page).getByRole('application', { name: 'Drawing' });
const drawn = async (page) => (await ok(page, `patients/${patient}/drawing`)).points;
/// The lines and dots that are seen in a picture.
const seen = (place) => place.locator('.drawn.over').count();

await h.step('it is drawn on, by mouse and by keys, and seen where it is confirmed', async () => {
  await onSheet(anna).getByText('Draw on it…').click();
  await drawing(anna).scrollIntoViewIfNeeded();
  const box = await drawing(anna).boundingBox();
  const at = (x, y) => [box.x + x * box.width, box.y + y * box.height];
  for (const [from, to] of [[[0.2, 0.5], [0.4, 0.5]], [[0.6, 0.2], [0.6, 0.9]]]) {
    await anna.mouse.move(...at(...from));
    await anna.mouse.down();
    await anna.mouse.move(...at(...to), { steps: 4 });
    await anna.mouse.up();
  }
  equal(await seen(drawing(anna)), 2, 'two lines');
  await onSheet(anna).getByRole('button', { name: 'Undo' }).click();
  equal(await seen(drawing(anna)), 1, 'one is taken back');
  await drawing(anna).focus();
  for (const key of ['ArrowRight', 'Shift+ArrowUp', 'Enter', 'Enter', 'u']) {
    await anna.keyboard.press(key);
  }
  await anna.locator('#status', { hasText: 'Dot 3 is set' }).waitFor();
  await h.look(anna, 'set-up-drawing');
  await onSheet(anna).getByRole('button', { name: 'Save the drawing' }).click();
  await onSheet(anna).locator('.set-up .set-up-picture .drawn.over').nth(1)
    .waitFor({ state: 'attached' });
  const points = await drawn(anna);
  equal(points.filter(([, , begins]) => begins === 1).length, 2, 'a line and a dot');
  check(points.slice(0, -1).every(([x, y]) => x > 0.19 && x < 0.41 && Math.abs(y - 0.5) < 0.01),
    `the line lies where it was drawn: ${JSON.stringify(points)}`);
  equal(JSON.stringify(points.at(-1)), '[0.52,0.4,1]', 'the dot');
  const session = anna.locator('section', {
    has: anna.getByRole('heading', { name: 'Session', exact: true }),
  });
  await session.locator('.drawn.over').nth(1).waitFor({ state: 'attached' });
});

await h.step('by finger, on a phone; what somebody else has drawn meanwhile is not overwritten',
  async () => {
  const touch = await h.person('touch', { width: 360, height: 740 },
    { hasTouch: true });
  await h.logIn(touch, 'bob');
  await touch.goto(`${h.url}#/patient/${patient}`);
  await onSheet(touch).getByText('Draw on it…').tap();
  await drawing(touch).locator('.drawn.over').nth(1).waitFor({ state: 'attached' });
  await drawing(touch).scrollIntoViewIfNeeded();
  const box = await drawing(touch).boundingBox();
  await touch.touchscreen.tap(box.x + 0.9 * box.width, box.y + 0.5 * box.height);
  equal(await seen(drawing(touch)), 3, 'a dot where it was touched');
  await h.look(touch, 'set-up-drawing-phone');
  await ok(anna, `patients/${patient}/drawing`, 'PUT', { points: [],
    sheet_revision: (await ok(anna, `patients/${patient}`)).sheet_revision });
  await onSheet(touch).getByRole('button', { name: 'Save the drawing' }).tap();
  await touch.getByRole('alert').getByText('changed by somebody else meanwhile').waitFor();
  equal(await seen(drawing(touch)), 3, 'what was drawn is still there');
  equal((await drawn(anna)).length, 0, 'and nothing was overwritten');
  check(await onSheet(touch).getByRole('button', { name: 'Remove the photo' }).isDisabled(),
    'the photo stays while somebody draws on it');
  await onSheet(touch).getByRole('button', { name: 'Give up this drawing' }).tap();
  // The sheet as it is now.
  await onSheet(touch).getByRole('button', { name: 'Remove the photo', disabled: false }).waitFor();
  await onSheet(touch).locator('[data-edited]').waitFor({ state: 'detached' });
  await touch.context().close();
});

await h.step('a drawing goes with its photo; without one it lies over the outline of a body',
  async () => {
  await ok(anna, `patients/${patient}/drawing`, 'PUT', { points: [[0.5, 0.5, 1]],
    sheet_revision: (await ok(anna, `patients/${patient}`)).sheet_revision });
  await onSheet(anna).getByRole('button', { name: 'Remove the photo' }).click();
  await onSheet(anna).locator('img.set-up-photo').waitFor({ state: 'detached' });
  equal((await h.api(anna, `patients/${patient}/photo`)).status, 404, 'it is gone');
  equal((await drawn(anna)).length, 0, 'and what was drawn over it');
  await onSheet(anna).getByText('Draw on it…').click();
  await drawing(anna).focus();
  await anna.keyboard.press('Enter');
  await onSheet(anna).getByRole('button', { name: 'Save the drawing' }).click();
  await onSheet(anna).locator('.set-up svg.set-up-photo').waitFor();
  await h.look(anna, 'set-up-drawing-outline');
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
