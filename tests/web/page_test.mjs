// SPDX-License-Identifier: Apache-2.0
// A run through the page in a real browser: page_test.mjs NODE_MODULES SERVER OUT_FOLDER CHROMIUM
import { readFileSync, writeFileSync } from 'node:fs';
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

async function scan(page, button = 'Start sweep') {
  await page.goto(`${h.url}#/scan`);
  await page.getByRole('button', { name: button }).click();
  await page.locator('.verdict').waitFor({ timeout: 60000 });
}

const engineer = await h.person('engineer');
await h.step('set-up makes the first account and refuses a wrong code', async () => {
  await engineer.goto(h.url);
  await engineer.getByRole('heading', { name: 'First start' }).waitFor();
  await h.look(engineer, 'setup', { axe: false });
  const fill = async (code) => {
    await engineer.getByLabel('Setup code').fill(code);
    await engineer.getByLabel('Name').fill('engineer');
    await engineer.getByLabel('Password', { exact: true }).fill(h.password);
    await engineer.getByLabel('Password again').fill(h.password);
    await engineer.getByRole('button', { name: 'Create account' }).click();
  };
  await fill('AAAA-AAAA');
  await engineer.getByRole('alert').getByText('setup code is wrong').waitFor();
  await engineer.getByLabel('Delete old scans automatically').selectOption('After 2 years');
  await fill(h.setupCode);
  await engineer.getByRole('navigation').waitFor();
  await engineer.goto(`${h.url}#/settings`);
  equal(await engineer.getByLabel('Delete scans after').inputValue(), '730',
    'what was chosen at the set-up');
});

await h.step('the engineer adds accounts', async () => {
  h.tell('checked');  // today, so that nothing is doubtful about a reference
  await engineer.goto(`${h.url}#/users`);
  for (const [name, role] of [['anna', 'technician'], ['bob', 'physicist'],
    ['clara', 'physicist']]) {
    await h.addAccount(engineer, name, role);
  }
  await h.look(engineer, 'users', { axe: false });
});

const anna = await h.person('anna');
const bob = await h.person('bob');
const clara = await h.person('clara');
await h.step('a wrong password is refused in words', async () => {
  await anna.goto(h.url);
  await anna.getByLabel('Name').fill('anna');
  await anna.getByLabel('Password').fill('not this one');
  await anna.getByRole('button', { name: 'Log in' }).click();
  await anna.getByRole('alert').getByText('name or password is wrong').waitFor();
  await h.look(anna, 'login', { axe: false });
  await h.logIn(anna, 'anna');
  await anna.getByText('Recent scans').waitFor();
  await anna.locator('.tile', { hasText: 'Draft references' }).getByText('none').waitFor();
  await h.look(anna, 'status', { axe: false });
});

await h.step('roles see only their own screens', async () => {
  equal(await anna.getByRole('link', { name: 'Audit log', exact: true }).count(), 0,
    'the technician sees no log');
  await anna.goto(`${h.url}#/audit`);
  await anna.getByText('Your role cannot open this page.').waitFor();
});

await h.step('a new patient is scanned for a reference', async () => {
  await h.addPatient(anna, 'PX-0417', 'thorax');
  await anna.getByRole('heading', { name: 'PX-0417' }).waitFor();
  equal(await anna.getByRole('button', { name: 'Start treatment session' }).isDisabled(), true,
    'no fraction without a reference');
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await anna.getByText('Press the button to start a sweep.').waitFor();
  await h.look(anna, 'scan-ready', { axe: false });
  await scan(anna);
  await h.look(anna, 'result-reference', { axe: false });
  // The draft is there by itself, and every screen says whose turn it is.
  await anna.getByText('Saved as draft version 1.').waitFor();
  equal(await anna.getByRole('link', { name: 'Open the draft' }).count(), 0,
    'a technician could do nothing there');
  await anna.goto(`${h.url}#/status`);
  await anna.locator('.tile li', { hasText: 'Waiting for a plan: PX-0417 version 1' }).waitFor();
  await h.look(anna, 'status-waiting');
});

await h.step('a physicist plans, a second one approves', async () => {
  await h.logIn(bob, 'bob');
  await bob.goto(`${h.url}#/patients`);
  await bob.getByRole('row', { name: 'PX-0417' }).getByText('waiting for a plan').waitFor();
  await bob.getByRole('link', { name: 'PX-0417' }).click();
  await bob.getByRole('link', { name: 'Plan, Version 1' }).click();
  await bob.getByText('Nobody has planned this reference yet.').waitFor();
  equal(await bob.getByRole('button', { name: 'Review and approve' }).count(), 0,
    'nothing to approve before it is planned');
  const map = await h.drawRegion(bob, [[0.3, 0.3], [0.7, 0.3], [0.72, 0.7], [0.28, 0.7]]);
  await map.press('n');
  await map.press('ArrowUp');
  await bob.getByRole('button', { name: 'Pick on the map' }).click();
  const scrolled = await map.boundingBox();
  await bob.mouse.click(scrolled.x + 0.5 * scrolled.width, scrolled.y + 0.5 * scrolled.height);
  check(Number(await bob.getByLabel('Isocentre z').inputValue()) > 20,
    'the isocentre lies on the body');
  // The same by keys, at the height that it has; what is undone stands in the fields again.
  const typed = async () => {
    const values = [];
    for (const axis of ['x', 'y', 'z']) {
      values.push(await bob.getByLabel(`Isocentre ${axis}`).inputValue());
    }
    return values.map(Number);
  };
  const picked = await typed();
  await map.press('i');
  await map.press('ArrowRight');
  await map.press('Shift+ArrowUp');
  const moved = await typed();
  check(Math.abs(moved[0] - picked[0] - 5) < 1e-6, `5 mm to the right: ${picked} to ${moved}`);
  check(Math.abs(moved[1] - picked[1] - 50) < 1e-6, `50 mm up: ${picked} to ${moved}`);
  equal(moved[2], picked[2], 'at the same height');
  await map.press('Delete');
  equal(await bob.getByLabel('Isocentre x').inputValue(), '', 'no isocentre');
  // A marker that was laid at the lasers.
  await bob.getByLabel('Marker at the lasers').selectOption('1');
  await bob.getByRole('button', { name: 'Use its centre' }).click();
  const { markers } = await bob.evaluate(async () => {
    const get = async (path) => (await fetch(`/api/v1/${path}`)).json();
    return get(
      `scans/${(await get(`references/${location.hash.split('/')[2]}`)).scan_id}/files/scene.json`);
  });
  const centre =
    [0, 1, 2].map((axis) => markers[1].reduce((sum, corner) => sum + corner[axis] / 4, 0));
  (await typed()).forEach((value, axis) => check(Math.abs(value - 1000 * centre[axis]) < 0.1,
    `the marker's centre: ${value} for ${centre[axis]}`));
  await bob.getByRole('button', { name: 'Undo' }).click();
  equal(await bob.getByLabel('Isocentre x').inputValue(), '', 'the marker is undone');
  await map.press('i');
  check((await typed())[2] > 0.02, 'a new one lies on the skin in the middle of the region');
  await map.press('Shift+ArrowLeft');
  // Not as fast as a scanner types.
  for (let i = 0; i < 5; ++i) await map.press('u', { delay: 60 });
  equal((await typed()).join(), picked.join(), 'undone');
  await bob.getByText('4 corners').waitFor();
  // The site's template: made of what is here, used again after it was cleared.
  await bob.getByText('There is no template for this site yet.').waitFor();
  await bob.getByLabel('Shifts (mm)').fill('4');
  await bob.getByLabel('Hint for the sweep').fill('begin at the feet, end above the chin');
  await bob.getByRole('button',
    { name: 'Save this size, tolerance and posture as the template' }).click();
  await bob.getByText(
    /^Region \d+ × \d+ mm \(x × y\) about the isocentre, ±4 mm, ±1°/).waitFor();
  const size = (await h.api(bob, 'templates')).body.templates[0];
  equal(size.site, 'thorax', 'of the site of the patient');
  equal([size.posture, size.hint].join(': '), 'HFS: begin at the feet, end above the chin',
    'posture and hint');
  await bob.getByText('Hint: begin at the feet').waitFor();
  await bob.getByRole('button', { name: 'Clear the region' }).click();
  await bob.getByLabel('Shifts (mm)').fill('3');
  await bob.getByRole('button', { name: 'Use the template' }).click();
  await bob.getByText('4 corners').waitFor();
  equal(await bob.getByLabel('Shifts (mm)').inputValue(), '4', 'its tolerance');
  await bob.getByRole('button', { name: 'Undo' }).click();
  await bob.getByRole('button', { name: 'Undo' }).click();
  await bob.getByLabel('Shifts (mm)').fill('3');
  await bob.getByText('4 corners').waitFor();
  await h.look(bob, 'plan', { axe: false });
  await bob.getByRole('button', { name: 'Save plan' }).click();
  await bob.getByRole('status').getByText('Plan saved.').waitFor({ state: 'attached' });
  // Who planned it is not asked for a password that would be refused.
  await bob.getByText('Waiting for a second physicist').waitFor();
  equal(await bob.getByRole('button', { name: 'Review and approve' }).count(), 0,
    'not by who planned it');
  await anna.locator('.tile li', { hasText: 'Waiting for approval: PX-0417 version 1' }).waitFor();
  await h.logIn(clara, 'clara');
  // If the check had failed before the scan, the summary says so, as the result does.
  await clara.route(/\/api\/v1\/scans\/[^/]+\/quality$/, async (route) => {
    const response = await route.fetch();
    const quality = await response.json();
    quality.cautions.push('The daily check had failed before this scan.');
    quality.caution_messages.push({ id: 'result.check_failed', arguments: {} });
    await route.fulfill({ response, json: quality });
  });
  await clara.goto(`${h.url}${new URL(bob.url()).hash}`);
  await clara.getByText('4 corners').waitFor();
  // With an unsaved edit nothing can be approved, and what is signed is read-only.
  const review = clara.getByRole('button', { name: 'Review and approve' });
  await clara.getByLabel('Shifts (mm)').fill('5');
  equal(await review.getAttribute('aria-disabled'), 'true', 'no approval with unsaved edits');
  await clara.getByText('There are unsaved changes.').waitFor();
  await clara.getByLabel('Shifts (mm)').fill('3');
  equal(await review.getAttribute('aria-disabled'), null, 'what is stored can be approved');
  // Without today's check nothing is approved, and the screen says what to do.
  h.tell('overdue');
  await clara.getByText('The daily check is overdue').waitFor();
  equal(await review.getAttribute('aria-disabled'), 'true',
    'no approval while the check is overdue');
  await h.look(clara, 'plan-overdue', { axe: false });
  h.tell('checked');
  await clara.getByText('The daily check is overdue').waitFor({ state: 'detached' });
  equal(await review.getAttribute('aria-disabled'), null, 'it can be approved again');
  await review.click();
  const signed = clara.getByRole('region', { name: 'You are signing exactly this' });
  await signed.getByText('4 corners').waitFor();
  equal(await signed.locator('input:not([type=password])').count(), 1,
    'the summary is read-only, but for the reason that a caution asks for');
  const facts = await signed.locator('dl').innerText();
  for (const axis of ['vertical', 'longitudinal', 'lateral', 'pitch', 'roll', 'yaw']) {
    check(new RegExp(
      `Tolerance: ${axis}\\s+±${['pitch', 'roll', 'yaw'].includes(axis) ? '1°' : '3 mm'}`)
      .test(facts), `the tolerance of ${axis}: ${facts}`);
  }
  await signed.getByText('The daily check had failed before this scan.').waitFor();
  await h.look(clara, 'plan-summary', { axe: false });
  await clara.getByLabel('Shifts (mm)').fill('5');
  await signed.waitFor({ state: 'detached' });
  await clara.getByLabel('Shifts (mm)').fill('3');
  await review.click();
  await h.sign(clara, 'not this one');
  await clara.getByRole('alert').getByText('password is wrong').waitFor();
  await h.sign(clara);
  await clara.getByText(/approved by clara, .*\b(UTC|GMT)/).waitFor();
  await h.look(clara, 'plan-approved', { axe: false });
  await clara.unrouteAll();
});

await h.step('corners by keys where the crosshair is, and one taken away by a finger', async () => {
  const tablet = await h.person('tablet', { width: 1024, height: 768 }, { hasTouch: true });
  await h.logIn(tablet, 'bob');
  await tablet.goto(`${h.url}#/patients`);
  await tablet.getByRole('link', { name: 'PX-0417' }).waitFor();
  equal(await tablet.evaluate(() => document.activeElement.type), undefined,
    'no keyboard covers the list');
  await tablet.goto(`${h.url}${new URL(bob.url()).hash}`);
  await tablet.getByText('4 corners').waitFor();
  await tablet.getByRole('button', { name: 'Clear the region' }).click();
  const map = tablet.getByRole('application');
  const said = async (words) => {
    await tablet.locator('#status', { hasText: words }).waitFor({ state: 'attached' });
    return (await tablet.locator('#status').innerText())
      .match(/x (\S+), y (\S+) mm/).slice(1).map(Number);
  };
  await map.press('Shift+ArrowLeft');
  await map.press('ArrowUp');
  const cross = await said('Crosshair');
  await map.press('Enter');
  equal((await said('Corner 1')).join(), cross.join(), 'the corner lies at the crosshair');
  await map.press('Shift+ArrowRight');
  await map.press('Enter');
  equal((await said('Corner 2'))[0], cross[0] + 50,
    'the next one 50 mm to the right');
  await map.press('Shift+ArrowUp');
  await map.press('Enter');
  await tablet.getByText('3 corners').waitFor();
  // The same place again takes the corner that is there, which the arrows then move.
  await map.press('Enter');
  await map.press('ArrowLeft');
  await tablet.getByText('3 corners').waitFor();
  await map.press('Escape');
  const remove = tablet.getByRole('button', { name: 'Delete corner' });
  equal(await remove.getAttribute('aria-disabled'), 'true', 'no corner is selected');
  const box = await tablet.locator('circle.corner').first().boundingBox();
  // A finger aims badly.
  await tablet.touchscreen.tap(box.x + box.width / 2 + 8, box.y + box.height / 2 + 8);
  await tablet.getByText('3 corners').waitFor();
  await remove.tap();
  await tablet.getByText('2 corners').waitFor();
  await tablet.context().close();
});

await h.step('unsaved work: asked before it is left, kept for its person where the session ends, '
  + 'discarded where they say so', async () => {
  const shift = bob.getByLabel('Shifts (mm)');
  const note = bob.getByText('Your earlier unsaved changes were kept.');
  const kept = () => bob.evaluate(
    () => Object.keys(sessionStorage).filter((key) => key.startsWith('plumb-plan-')).length);
  const logInHere = async (name) => {
    await bob.getByLabel('Name').fill(name);
    await bob.getByLabel('Password').fill(h.password);
    await bob.getByRole('button', { name: 'Log in' }).click();
    await shift.waitFor();
  };
  await bob.reload();
  await shift.fill('4.5');
  const asked = [];
  bob.on('dialog', (dialog) => { asked.push(dialog.message()); dialog.dismiss(); });
  await Promise.all([bob.waitForEvent('dialog'),
    bob.getByRole('link', { name: 'Patients', exact: true }).click()]);
  await bob.waitForURL(/#\/plan\//);
  equal(await shift.inputValue(), '4.5', 'after a refused prompt the page stays as it was');
  equal(asked.join(), 'There are unsaved changes. Leave without saving?', 'the question');
  equal((await h.api(bob, 'logout', 'POST')).status, 200, 'the session ends elsewhere');
  await bob.getByRole('heading', { name: 'Log in' }).waitFor();
  await logInHere('clara');
  equal(await shift.inputValue(), '3', 'another person sees what is stored');
  equal(await note.count(), 0, 'nothing of it was hers');
  await bob.getByRole('button', { name: 'Log out' }).click();
  await bob.getByRole('heading', { name: 'Log in' }).waitFor();
  await logInHere('bob');
  await note.waitFor();
  equal(await shift.inputValue(), '4.5', 'kept');
  await h.look(bob, 'plan-kept');
  await bob.getByRole('button', { name: 'Discard', exact: true }).click();
  await note.waitFor({ state: 'detached' });
  equal(await shift.inputValue(), '3', 'as it is stored');
  equal(await kept(), 0, 'discarded');
  equal(asked.length, 1, 'nothing more to ask');
  // Who says that it is to be left without saving, or logs out, does not find it again.
  bob.removeAllListeners('dialog');
  bob.on('dialog', (dialog) => dialog.accept());
  await shift.fill('4.5');
  await bob.getByRole('link', { name: 'Patients', exact: true }).click();
  await shift.waitFor({ state: 'detached' });  // the address changes before the question is asked
  equal(await kept(), 0, 'left without saving');
  await bob.goBack();
  await shift.fill('4.5');
  equal(await kept(), 1, 'kept as long as it is edited');
  await bob.getByRole('button', { name: 'Log out' }).click();
  await bob.getByRole('heading', { name: 'Log in' }).waitFor();
  equal(await kept(), 0, 'logged out');
  await logInHere('bob');
  equal(await shift.inputValue(), '3', 'as it is stored');
  bob.removeAllListeners('dialog');
});

await h.step('two minutes before the log-out the page warns; keys and pointer count as use',
  async () => {
  const idle = await h.person('idle');
  await h.logIn(idle, 'anna');
  await idle.locator('.tile').first().waitFor();
  const warning =
    idle.locator('#idle').getByText(/^You will be logged out in \d+ s because of inactivity\.$/);
  await h.setClockOn(idle, 12 * 60);  // of 15 min
  await h.ticks(idle);
  equal(await warning.count(), 0, 'three minutes before there is none');
  await h.setClockOn(idle, 65);
  await warning.waitFor();
  await h.look(idle, 'idle-warning', { axe: false, fullPage: false });
  // What is announced does not change with each second.
  const announced = () => idle.getByRole('alert').filter({ hasText: 'logged out' }).innerText();
  const [first, shown] = [await announced(), await warning.innerText()];
  await warning.filter({ hasNotText: shown }).waitFor();
  equal(await announced(), first, 'announced once');
  await h.setClockOn(idle, 60);
  await idle.getByRole('alert').getByText(/out in [1-5]\d s/).waitFor();
  await idle.getByRole('button', { name: 'Stay logged in' }).click();
  await warning.waitFor({ state: 'detached' });
  for (const use of [() => idle.keyboard.press('Shift'), () => idle.mouse.click(5, 300)]) {
    await h.setClockOn(idle, 10 * 60);
    const answered = idle.waitForResponse(/\/api\/v1\/session$/);
    await use();
    await answered;
    await h.setClockOn(idle, 10 * 60);
    await h.ticks(idle);
    equal(await warning.count(), 0, 'used 10 minutes ago');
    await Promise.all([idle.waitForResponse(/\/api\/v1\/session$/), use()]);
  }
  await idle.context().close();
});

await h.step('a fraction shows MOVE with the signs in words', async () => {
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'PX-0417' }).click();
  await anna.locator('table').nth(1).waitFor();
  await h.look(anna, 'patient', { axe: false });
  await anna.getByRole('button', { name: 'Start treatment session' }).click();
  await scan(anna, /Start sweep|Scan again/);
  await anna.locator('.verdict.move').waitFor();
  // The body was carried by 6.2 mm to the gantry, 12.4 mm to its left and raised by 4.1 mm (within
  // the turn's share): the correction goes back.
  const card = (name) => anna.locator('.number', { has: anna.getByRole('heading', { name }) });
  check((await card('Vertical').locator('.value').innerText()).startsWith('−'),
    'vertical is negative');
  equal(await card('Vertical').locator('.word').innerText(), 'down', 'vertical in words');
  check((await card('Longitudinal').locator('.value').innerText()).startsWith('−'),
    'longitudinal is negative');
  equal(await card('Longitudinal').locator('.word').innerText(), 'away from gantry',
    'longitudinal in words');
  equal(await card('Lateral').locator('.word').innerText(), 'to patient right', 'lateral in words');
  check((await card('Yaw').locator('.value').innerText()).startsWith('+'), 'yaw is positive');
  check(await anna.locator('.number.outside').count() >= 3, 'values outside tolerance are marked');
  await anna.locator('.reading strong').waitFor();
  await h.look(anna, 'result-move', { axe: false });
});

await h.step('the map reads millimetres by mouse and keyboard', async () => {
  const map = anna.locator('canvas.map');
  await map.scrollIntoViewIfNeeded();
  const read = async () => {
    const words = await anna.locator('.reading').innerText();
    const [, value, x, y] = /^(.+)\s+at x (\S+), y (\S+) mm$/.exec(words) ?? [];
    return { value, mm: Number(/^([+−]?[\d.]+) mm$/.exec(value)?.[1].replace('−', '-') ?? NaN),
      x: Number(x) / 1000, y: Number(y) / 1000 };
  };
  const near = (found, expected, what) =>
    check(Math.abs(found - expected) < 0.0015, `${what}: ${expected.toFixed(3)}, found ${found}`);
  await map.focus();
  // To where the moved body lies off.
  for (let i = 0; i < 60 && !(Math.abs((await read()).mm) > 4); ++i) await map.press('ArrowUp');
  const start = await read();
  check(Math.abs(start.mm) > 4, `the body lies off: ${start.value}`);
  await anna.getByLabel('After the correction').check();
  await anna.locator('canvas.map[data-map=after]').waitFor();  // it comes only now
  const after = await read();
  near(after.x, start.x, 'the same place');
  check(Math.abs(after.mm) < 0.5 * Math.abs(start.mm),
    `the correction puts it right: ${start.value}, then ${after.value}`);
  await anna.getByLabel('Before', { exact: true }).check();
  await anna.locator('canvas.map[data-map=before]').waitFor();
  equal((await read()).value, start.value, 'and back');
  await map.press('ArrowRight');
  await map.press('Shift+ArrowDown');
  const beside = await read();
  near(beside.x, start.x + 0.005, 'a step to the right');
  near(beside.y, start.y - 0.05, 'a long step down');
  await map.hover({ position: { x: 10, y: 10 } });
  const corner = await read();
  check(corner.x < start.x - 0.05 && corner.y > start.y + 0.05,
    `the pointer reads at the upper left: ${corner.x}, ${corner.y}`);
});

await h.step('the surface opens in 3-D', async () => {
  const surface = '**/maps/mesh';
  let go;
  const mayGo = new Promise((ready) => { go = ready; });
  await anna.route(surface, async (route) => {
    await mayGo;
    await route.abort();
  });
  await anna.getByRole('button', { name: 'Open the 3-D view' }).click();
  await anna.getByRole('progressbar', { name: 'Loading the surface' }).waitFor();
  go();
  await anna.locator('.mesh-place').getByText('The appliance is not responding.').waitFor();
  await anna.unroute(surface);
  await anna.route(surface, (route) =>
    route.fulfill({ contentType: 'application/octet-stream', body: 'PLM2 and no more' }));
  await anna.getByRole('button', { name: 'Open the 3-D view' }).click();
  await anna.locator('.mesh-place').getByText('The surface arrived damaged.').waitFor();
  await anna.unroute(surface);
  await anna.getByRole('button', { name: 'Open the 3-D view' }).click();
  await anna.locator('canvas.mesh[data-ready=yes]').waitFor({ timeout: 60000 });
  const mesh = anna.locator('canvas.mesh');
  // What is drawn after the next frame: its bytes, and how much of it is not the ground.
  const drawn = () => mesh.evaluate(async (canvas) => {
    const { data, width, height } = await window.pixelsOf(canvas);
    let bright = 0;
    let corner = 0;
    for (let i = 0; i < data.length; i += 4) {
      if (data[i] + data[i + 1] + data[i + 2] < 90) continue;
      ++bright;
      const [x, y] = [(i / 4) % width, Math.floor(i / 4 / width)];
      if (x > width - 0.2 * height && y > 0.8 * height) ++corner;
    }
    return { bytes: canvas.toDataURL('image/png'), bright, corner: corner / (0.04 * height ** 2) };
  });
  const keep = (name, bytes) =>
    writeFileSync(h.file(`${name}.png`), Buffer.from(bytes.split(',')[1], 'base64'));
  const seen = new Map();
  for (const name of ['Anterior', 'Left', 'Right', 'Head', 'Feet', 'Reset']) {
    const button = anna.locator('.mesh-place').getByRole('button', { name, exact: true });
    await button.focus();
    await anna.keyboard.press('Enter');
    const { bytes, corner } = await drawn();
    equal(seen.get(bytes), undefined, `${name} looks like another view`);
    check(corner > 0.15, `${name}: the cube is in the corner (${corner.toFixed(2)})`);
    seen.set(bytes, name);
    keep(`mesh-${name.toLowerCase()}`, bytes);
  }
  // The cut takes away, the more the further it goes; without it all is there again.
  const whole = await drawn();
  await anna.getByLabel('Cut', { exact: true }).selectOption({ label: 'lengthwise' });
  const where = anna.getByLabel('Position of the cut');
  const half = await drawn();
  check(half.bright < 0.9 * whole.bright, `the cut leaves ${half.bright} of ${whole.bright}`);
  keep('mesh-cut', half.bytes);
  // Every step is drawn again, which takes the emulated graphics card a second: few of them by
  // keys.
  await where.press('ArrowLeft');
  equal(await where.inputValue(), '0.48', 'a key moves the cut');
  await where.fill('0.26');
  const less = await drawn();
  check(less.bright < half.bright, `further, ${less.bright} of ${half.bright}`);
  await anna.getByLabel('Cut', { exact: true }).selectOption({ label: 'none' });
  equal((await drawn()).bytes, whole.bytes, 'and all of it again');
  await anna.getByLabel('Show the reference').check();
  await anna.locator('canvas.mesh[data-ghost=yes]').waitFor({ timeout: 60000 });
  const both = await drawn();
  check(both.bytes !== whole.bytes, 'the reference is seen');
  await mesh.press('ArrowLeft');
  check((await drawn()).bytes !== both.bytes, 'the keys turn it');
  await mesh.press('ArrowRight');
  const share = anna.getByLabel('Reference to current');
  await share.press('ArrowRight');
  equal(await share.inputValue(), '0.55', 'a key moves the slider');
  await share.fill('1');
  const current = await drawn();
  check(current.bytes !== both.bytes, 'the slider goes to the current surface');
  equal((await drawn()).bytes, current.bytes, 'drawn again, nothing flickers');
  await share.fill('0.5');
  keep('mesh', (await drawn()).bytes);
  const [picture] = await Promise.all(
    [anna.waitForEvent('download'), anna.getByRole('button', { name: 'Save picture' }).click()]);
  check(/_3d\.png$/.test(picture.suggestedFilename()), picture.suggestedFilename());
  await h.look(anna, 'result-3d', { axe: false });
});

await h.step('a second page follows the same scan', async () => {
  await clara.goto(`${h.url}#/scan`);
  await h.acknowledge(clara);
  await anna.goto(`${h.url}#/scan`);
  h.tell('slow');
  await anna.getByRole('button', { name: 'Scan again' }).click();
  await clara.getByRole('button', { name: 'End sweep' }).waitFor();
  await h.ticks(anna);
  await h.look(anna, 'scan-sweep', { axe: false });
  await clara.reload();
  await clara.getByRole('button', { name: 'End sweep' }).waitFor();
  h.tell('fast');
  await clara.locator('.verdict').waitFor({ timeout: 60000 });
  await anna.locator('.verdict.in_tolerance').waitFor();
  await h.look(anna, 'result-in-tolerance', { axe: false });
  await anna.getByRole('button', { name: 'Accept' }).click();
  await anna.getByText(/Accepted by anna, .*\b(UTC|GMT)/).waitFor();
  // What comes next is offered there.
  await anna.getByRole('button', { name: 'Close session' }).click();
  await anna.getByText('SESSION NOT OPEN').waitFor();
  equal(await anna.getByRole('button', { name: 'Close session' }).count(), 0, 'it is closed');
  await anna.locator('.identity').getByRole('link', { name: 'PX-0417' }).click();
  await anna.getByRole('button', { name: /^Resume fraction 1/ }).click();
  await anna.locator('.who-line', { hasText: 'PX-0417' }).waitFor();
  await anna.goto(`${h.url}#/result`);
  await anna.locator('.verdict.in_tolerance').waitFor();
});

await h.step('a result grows old over a sleep, and takes its age from the appliance again',
  async () => {
  equal(await anna.locator('.is-old').count(), 0, 'fresh at first');
  await h.sleep(anna, 130);
  await anna.getByText('Do not act on it').waitFor();
  const offline = anna.getByRole('alert').getByText('No connection to the appliance');
  // The browser does not cut the stream that is open: a beat that comes just now says that all is
  // well, and it takes another silence.
  for (let i = 0; i < 8 && !(await offline.isVisible()); ++i) {
    await h.setClockOn(anna, 30);
    await offline.waitFor({ timeout: 2500 }).catch(() => {});
  }
  await offline.waitFor();
  equal(await anna.locator('.is-old').count(), 1, 'the result is grey');
  await h.wake(anna);
  // For the appliance no 2 minutes have passed.
  await anna.locator('.is-old').waitFor({ state: 'detached' });
  await anna.getByRole('alert').getByText('No connection').waitFor({ state: 'detached' });
  h.tell('old');
  await anna.getByText('Do not act on it').waitFor();
  await h.look(anna, 'result-old', { axe: false });
});

await h.step('NO ANSWER says why', async () => {
  await scan(anna, 'Scan again');
  await anna.locator('.verdict.no_answer').waitFor();
  check(/marker/i.test(await anna.locator('.verdict .why').innerText()),
    'the reason names the markers');
  await h.look(anna, 'result-no-answer', { axe: false });
});

await h.step('the trend shows the fractions', async () => {
  await anna.locator('.trend').first().waitFor();
  equal(await anna.locator('.trend').count(), 6, 'six trends');
  await anna.locator('.identity').getByRole('link', { name: 'PX-0417' }).click();
  // Each scan that answered says its numbers, with the digits that are known; one without an answer
  // none.
  await anna.getByText('Vert., long., lat. (mm)').waitFor();
  const numbers = await anna.locator('td.digits').allInnerTexts();
  check(numbers.filter((line) => /^[−+]?\d+(\.\d)?, .+ · .+, .+, [−+]?\d/.test(line)).length >= 2,
    `numbers: ${numbers.join(' | ')}`);
  check(numbers.includes('–'), 'and none where there is no answer');
  await h.look(anna, 'patient-scans');
});

await h.step('unplugging during a sweep discards the scan and says so', async () => {
  h.tell('slow');
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: 'Scan again' }).click();
  await anna.getByRole('button', { name: 'End sweep' }).waitFor();
  h.tell('unplug');
  await anna.locator('.headline', { hasText: 'Sensor missing' }).waitFor();
  equal(await anna.getByRole('button', { name: 'Start sweep' }).isDisabled(), true,
    'no start without a sensor');
  await anna.getByRole('alert').getByText('The sensor was unplugged').waitFor();
  equal(await anna.locator('.verdict').count(), 0, 'no older result is shown for it');
  await h.look(anna, 'scan-unplugged', { axe: false });
  h.tell('plug');
  h.tell('fast');
  await anna.locator('.headline', { hasText: 'Ready' }).waitFor();
  await anna.getByText('The sensor was unplugged').waitFor({ state: 'detached' });
});

await h.step('a failed scan is acknowledged on the page', async () => {
  h.tell('slow');
  await h.setClockOn(anna, 2);  // or it would be the second tap of two
  await anna.getByRole('button', { name: 'Start sweep' }).click();
  await anna.getByRole('button', { name: 'End sweep' }).waitFor();
  h.tell('fail');
  await anna.getByRole('button', { name: 'Acknowledge' }).waitFor();
  await anna.locator('.headline', { hasText: 'Fault' }).waitFor();
  equal(await anna.locator('.guidance').innerText(),
    'The recording cannot be written. Acknowledge it on the scan screen or with the button, then '
      + 'scan again.', 'what is wrong and what to do');
  equal(await anna.getByRole('button', { name: 'Start sweep' }).count(), 0, 'no start before');
  await h.look(anna, 'scan-fault');
  await h.setClockOn(anna, 2);  // likewise
  await anna.getByRole('button', { name: 'Acknowledge' }).click();
  await anna.locator('.headline', { hasText: 'Ready' }).waitFor();
  // The next scan can start.
  await anna.getByRole('button', { name: 'Start sweep', disabled: false }).waitFor();
  h.tell('fast');
});

await h.step('another open patient is pointed out on the result', async () => {
  await h.addPatient(anna, 'PX-0999');
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await anna.getByRole('button', { name: 'Close PX-0417, open PX-0999' }).click();
  await anna.locator('.who-line', { hasText: 'PX-0999' }).waitFor();
  const history =
    await anna.evaluate(() => fetch('/api/v1/scans').then((response) => response.json()));
  const last = history.scans.find((one) => one.result);
  await anna.goto(`${h.url}#/result/${last.id}`);
  await anna.getByText('The session of another patient (PX-0999) is open').waitFor();
});

await h.step('the daily check: overdue, without a baseline, passed, failed', async () => {
  h.tell('overdue');
  await anna.goto(`${h.url}#/status`);
  await anna.getByText('No check has passed today.').waitFor();
  await anna.goto(`${h.url}#/check`);
  await anna.getByText('NOT DONE').waitFor();
  await h.look(anna, 'check-never', { axe: false });
  const takeCheck = async () => {
    await anna.goto(`${h.url}#/check`);
    await anna.getByRole('button', { name: 'Start a check' }).click();
    await anna.getByText('sweep over all markers of the room').waitFor();
    await anna.getByRole('button', { name: /Start sweep|Scan again/ }).click();
    await anna.waitForURL(/#\/check/, { timeout: 60000 });
  };
  await takeCheck();
  await anna.locator('.verdict', { hasText: 'NO BASELINE' }).waitFor();
  equal(await anna.getByText('Set as baseline').count(), 0, 'a technician sets no baseline');
  await bob.goto(`${h.url}#/check`);
  await h.acknowledge(bob);
  const asBaseline = bob.locator('.take-baseline');
  await asBaseline.waitFor();
  // Asked again, with the same answer, it stays where it is.
  const asked = bob.waitForResponse(/\/api\/v1\/checks$/);
  await bob.evaluate(() => document.dispatchEvent(new Event('visibilitychange')));
  await (await asked).finished();
  await h.api(bob, 'checks');
  equal(await asBaseline.count(), 1, 'the form is still there');
  await asBaseline.getByText('Set as baseline…').click();
  await asBaseline.getByLabel('Reason for the new baseline').fill('first of this room');
  await asBaseline.getByLabel('Your password').fill(h.password);
  await asBaseline.getByRole('button', { name: 'Set as baseline' }).click();
  await bob.getByText('12 markers, set by bob').waitFor();
  equal(await asBaseline.count(), 0, 'it is the baseline');
  await takeCheck();
  await anna.locator('.verdict', { hasText: 'PASSED' }).waitFor();
  const trends = (await anna.locator('.trend figcaption').allInnerTexts()).join('; ');
  check(!/\d\.\d{3}/.test(trends), `no digits beyond those measured: ${trends}`);
  await h.look(anna, 'check-passed', { axe: false });
  // A marker at the edge that was not seen does not fail it, and is named.
  h.tell('markerunseen');
  await takeCheck();
  const unseen = 'Marker 4 was not seen well and was not checked';
  await anna.locator('.verdict.in_tolerance', { hasText: 'PASSED' }).locator('.caution')
    .getByText(unseen).waitFor();
  await h.look(anna, 'check-unseen', { axe: false });
  await anna.goto(`${h.url}#/status`);
  await anna.locator('.tile', { hasText: 'Daily check' }).getByText(unseen).waitFor();
  // One that passed, and the baseline is there: nothing is left to say to who took it.
  equal((await h.api(bob, 'checks/open', 'POST')).status, 200, 'bob takes one');
  h.tell('press');
  await asBaseline.waitFor({ state: 'detached' });
  equal(await bob.getByText('A physicist other than').count(), 0, 'no card for that');
  h.tell('markermoved');
  await takeCheck();
  await anna.locator('.verdict', { hasText: 'FAILED' }).waitFor();
  await anna.getByText('marker 7 moved 12 mm').first().waitFor();
  check(await anna.locator('.trend circle.mark.within').count() > 0,
    'a check that passed is a circle in the trend');
  check(await anna.locator('.trend path.mark.outside').count() > 0,
    'one that failed has another shape');
  equal(await anna.locator('.trend').first().locator('.tick.middle').count(), 1,
    'several checks of one day have one label');
  await h.look(anna, 'check-failed', { axe: false });
  // A failed one becomes the baseline by no tap: what changes, a reason and the password.
  equal(await asBaseline.getByRole('button', { name: 'Set as baseline' }).isVisible(), false,
    'behind a fold');
  await asBaseline.getByText('Set as baseline…').click();
  await asBaseline.getByText('This check FAILED.').waitFor();
  await asBaseline.getByText('Marker 7 lies 12.0 mm from where it was.').waitFor();
  await asBaseline.getByRole('button', { name: 'Set as baseline' }).click();
  equal((await h.api(bob, 'checks')).body.baseline.set_by, 'bob', 'not without a reason');
  await h.look(bob, 'check-baseline', { axe: false });
  const { body: { checks } } = await h.api(bob, 'checks');
  equal((await h.api(bob, `checks/${checks[0].id}/baseline`, 'POST', {})).status, 400,
    'nor by the interface');
  check((await h.api(bob, 'checks')).body.baseline.check_id !== checks[0].id, 'it is not');
  await anna.goto(`${h.url}#/status`);
  await anna.locator('.tile', { hasText: 'Daily check' })
    .getByText('failed', { exact: true }).waitFor();
  await anna.getByText('Find out why the check failed').waitFor();
  const { check_failed: failed, reference_block: block } = (await h.api(anna, 'status')).body;
  check(failed && /daily check has failed/.test(block),
    'after a pass of the same day it counts, too');
  await h.look(anna, 'status-check-failed', { axe: false });
});

await h.step('patients, log, settings and update look finished', async () => {
  await bob.goto(`${h.url}#/patients`);
  await bob.getByRole('link', { name: 'PX-0417' }).waitFor();
  await h.look(bob, 'patients', { axe: false });
  await bob.goto(`${h.url}#/audit`);
  await bob.getByRole('cell', { name: 'Reference approved' }).waitFor();
  await h.look(bob, 'audit', { axe: false });
  await bob.getByLabel('Filter').fill('reference approved');
  await bob.getByText(/^1 of \d+ entries$/).waitFor();
  equal(await bob.locator('tbody tr').count(), 1, 'only what was looked for');
  const [download] = await Promise.all(
    [bob.waitForEvent('download'), bob.getByRole('button', { name: 'Download as CSV' }).click()]);
  const csv = readFileSync(await download.path(), 'utf8').trim().split('\r\n');
  equal(csv.length, 2, 'a head and one entry');
  check(csv[1].includes('"Reference approved"'), csv[1]);
  // Settings that cannot be read are replaced on the page; no default looks like one of them.
  const settingsUrl = '**/api/v1/settings';
  const why = 'what is stored cannot be read: the stored settings cannot be read: expected a JSON '
    + 'object, found none; it was changed from outside, or its disk failed. Put a backup of the '
    + 'database in its place, or save it again';
  await engineer.route(settingsUrl, (route) => (route.request().method() === 'GET'
    ? route.fulfill({ status: 500, json: { error: why } }) : route.continue()));
  await engineer.goto(`${h.url}#/settings`);
  const unreadable = engineer.getByRole('alert').getByText('the stored settings cannot be read');
  await unreadable.waitFor();
  await h.look(engineer, 'settings-unreadable', { axe: false });
  const form = engineer.locator('form.columns');
  const numbers = form.locator('input[type=number]');
  const choices = form.locator('select');
  const all =
    await form.locator('input, select').evaluateAll((fields) => fields.map((one) => one.value));
  equal(all.join(), ',,,,,,,,,,,,,', 'nothing is filled in');
  const sent = [];
  const note = (request) => { if (request.method() === 'PUT') sent.push(request.postDataJSON()); };
  engineer.on('request', note);
  const save = engineer.getByRole('button', { name: 'Save' });
  await save.click();
  for (const [k, value] of ['5', '1', '10', '60', '0', '15', '3.5'].entries()) {
    await numbers.nth(k).fill(value);
  }
  for (const [k, value] of ['HFS', 'sweep', 'A4', 'true'].entries()) {
    await choices.nth(k).selectOption(value);
  }
  for (const k of [5, 6]) await choices.nth(k).selectOption('false');
  await save.click();
  equal(await form.evaluate((one) => one.checkValidity()), false, 'one choice is missing');
  await choices.nth(4).selectOption('false');
  await save.click();
  await engineer.getByRole('status').getByText('Saved.').waitFor({ state: 'attached' });
  equal(sent.length, 1, 'nothing was sent before all was entered');
  equal(JSON.stringify(
    [sent[0].posture, sent[0].idle_logout_min, sent[0].couch_markers, sent[0].keep_recordings]),
    '["HFS",15,true,false]', 'what was entered');
  equal(await unreadable.count(), 0, 'the fault is no longer shown');
  engineer.off('request', note);
  await engineer.unroute(settingsUrl);
  await engineer.reload();
  await engineer.getByLabel('Log out after … min of inactivity').fill('20');
  const elsewhere = { retention_days: 365, keep_recordings: true };
  equal((await h.api(engineer, 'settings', 'PUT', elsewhere)).status, 200,
    'another page changes other settings');
  await engineer.getByRole('button', { name: 'Save' }).click();
  await engineer.getByRole('status').getByText('Saved.').waitFor({ state: 'attached' });
  const both = (await h.api(engineer, 'settings')).body;
  equal([both.retention_days, both.keep_recordings, both.idle_logout_min].join(), '365,true,20',
    'nobody undoes what another has changed');
  equal(await numbers.nth(4).inputValue(), '365', 'what is stored is shown');
  await engineer.getByText('No backup has been made yet.').waitFor();
  await engineer.getByRole('button', { name: 'Back up now' }).click();
  await engineer.getByText(/Last backup: .*, by engineer\./).waitFor();
  const verify = engineer.getByRole('button', { name: 'Note: verified now' });
  equal(await verify.isVisible(), false, 'a plain backup is opened by the unit itself');
  h.tell('encrypts');
  await engineer.getByRole('button', { name: 'Back up now' }).click();
  await engineer.getByText('No verification of a backup has been noted yet.').waitFor();
  await verify.click();
  await engineer.getByText(/A backup was last verified: .*, by engineer\./).waitFor();
  h.tell('nobackup');
  await engineer.getByRole('button', { name: 'Back up now' }).click();
  await engineer.getByRole('alert').getByText('no folder for backups is configured').waitFor();
  await h.look(engineer, 'settings', { axe: false });
  const profile = engineer.locator('.sensor-profile');
  const rows = profile.locator('tbody tr');
  equal(await rows.count(), 3, 'versions of the profile');
  check((await rows.first().innerText()).includes('−1.90 %'), await rows.first().innerText());
  const [file] = await Promise.all([engineer.waitForEvent('download'),
    rows.nth(1).getByRole('link', { name: 'Download' }).click()]);
  equal(file.suggestedFilename(), 'plumb_sensor_profile_3.json', 'the file of that version');
  const change = async (choice, password) => {
    await profile.getByLabel('What to do').selectOption({ label: choice });
    await profile.getByLabel('Your password').fill(password);
    await profile.getByRole('button', { name: 'Change the profile' }).click();
  };
  await change('Restore version 3', 'wrong horse battery');
  await engineer.getByRole('alert').getByText('the password is wrong').waitFor();
  equal(await rows.count(), 3, 'a wrong password changes nothing');
  await change('Restore version 3', h.password);
  await engineer.getByRole('status')
    .getByText('The earlier version is in use.').waitFor({ state: 'attached' });
  // The newest version.
  await rows.first().locator('> :first-child', { hasText: /^5(\D|$)/ }).waitFor();
  await change('Start again without a profile', h.password);
  await engineer.getByRole('status')
    .getByText('The next scan starts without a profile.').waitFor({ state: 'attached' });
  await rows.first().getByText('reset').waitFor();
  await h.look(engineer, 'settings-profile');
  await bob.goto(`${h.url}#/settings`);
  await bob.locator('.sensor-profile tbody tr').first().waitFor();
  equal(await bob.locator('.sensor-profile form').count(), 0, 'a physicist only looks');
  await engineer.goto(`${h.url}#/update`);
  await engineer.getByText('plumb-0.2.0.raucb').waitFor();
  await h.look(engineer, 'update', { axe: false });
  const focused = () => engineer.evaluate(() => document.activeElement.getAttribute('aria-label'));
  await engineer.getByRole('button', { name: 'Install plumb-0.2.0.raucb' }).focus();
  h.tell('plugged');
  await engineer.getByText('plumb-0.5.0.raucb').waitFor();
  equal(await focused(), 'Install plumb-0.2.0.raucb', 'the list is drawn again below the keyboard');
  const send = async (name, text) => {
    await engineer.getByLabel('Update file', { exact: true }).setInputFiles({ name,
      mimeType: 'application/octet-stream', buffer: Buffer.from(text.padEnd(100000, 'x')) });
    await engineer.getByRole('button', { name: 'Upload' }).click();
  };
  await send('photo.raucb', 'GIF89a');
  await engineer.getByRole('alert').getByText('photo.raucb is not a bundle').waitFor();
  await send('plumb-0.3.0.raucb', 'hsqs');
  await engineer.getByRole('button', { name: 'Install plumb-0.3.0.raucb' }).click();
  await engineer.getByText('Copying image to rootfs.1').waitFor();
  equal(await engineer.locator('progress[value="0.4"]').count(), 1, 'the progress');
  equal(await focused(), 'Install plumb-0.3.0.raucb', 'a button that is off keeps the focus');
  equal(await engineer.getByRole('button', { name: 'Install plumb-0.2.0.raucb' }).isDisabled(),
    true, 'one installation at a time');
  equal(await engineer.getByRole('button', { name: 'Install plumb-0.4.0.raucb from the USB stick' })
    .isDisabled(), true, 'nor the one on the stick beside it');
  await h.look(engineer, 'update-installing');
  h.tell('installed');
  await engineer.getByText('restart the appliance to use it').waitFor();
  await bob.goto(`${h.url}#/update`);
  await bob.getByText('plumb-0.3.0.raucb').first().waitFor();
  equal(await bob.getByRole('button', { name: /Install|Upload|Remove|Restart/ }).count(), 0,
    'a physicist updates nothing');
});

await h.step('the restart into an update: with the password, never during a session; a roll-back '
  + 'is reported until it is seen', async () => {
  const restart = async (password) => {
    await engineer.locator('.restart').getByLabel('Your password').fill(password);
    await engineer.getByRole('button', { name: 'Restart now' }).click();
  };
  const alert = engineer.getByRole('alert');
  await h.acknowledge(engineer);
  await h.look(engineer, 'update-restart', { axe: false });
  await restart('not the password');
  await alert.getByText('the password is wrong').waitFor();
  const session = async () => (await h.api(anna, 'status')).body.session;
  check(await session() !== null, 'a session is open');
  await restart(h.password);
  await alert.getByText('The session of a patient is open')
    .or(alert.getByText('the session of a patient is open')).waitFor();
  equal((await h.api(anna, 'treatment/close', 'POST', { session_id: (await session()).id })).status,
    200, 'closed');
  await h.acknowledge(anna, bob, engineer);
  await restart(h.password);
  await engineer.getByRole('status')
    .getByText('The appliance restarts').waitFor({ state: 'attached' });
  h.tell('rolledback');
  await engineer.getByText('gone back to the previous system').waitFor();
  equal(await engineer.getByRole('button', { name: 'Restart now' }).count(), 0,
    'nothing waits for a restart');
  await h.look(engineer, 'update-rolled-back', { axe: false });
  await bob.goto(`${h.url}#/status`);
  await bob.getByText('gone back to the previous system').waitFor();
  await engineer.getByRole('button', { name: 'I have seen it' }).click();
  await engineer.getByText('gone back to the previous system').waitFor({ state: 'detached' });
});

await h.step('a factory reset: its kind chosen, wiping with its word typed, the password again',
  async () => {
  await engineer.goto(`${h.url}#/update`);
  const submit = engineer.getByRole('button', { name: 'Reset the appliance' });
  const word = engineer.getByLabel('Type WIPE to confirm');
  const password = engineer.getByLabel('Your password').last();
  await submit.waitFor();
  equal(await word.isVisible(), false, 'no word to type yet');
  await engineer.getByLabel('What to reset').selectOption('wipe');
  await engineer.getByText('They can be recovered only from a backup').waitFor();
  await word.fill('wipe');
  await password.fill(h.password);
  await submit.click();
  check(await word.evaluate((input) => input.validity.patternMismatch), 'another word is not sent');
  const resets = async () => (await h.api(engineer, 'audit')).body.entries
    .filter(({ action }) => action.startsWith('system.factory')).length;
  equal(await resets(), 0, 'nothing was asked for');
  await word.fill('WIPE');
  await password.fill('not the password');
  await submit.click();
  await engineer.getByRole('alert').getByText('the password is wrong').waitFor();
  equal(await resets(), 0, 'nor with another password');
  await engineer.getByLabel('What to reset').selectOption('keep_records');
  equal(await word.isVisible(), false, 'keeping the records asks for no word');
  await h.look(engineer, 'factory-reset', { axe: false });
  await password.fill(h.password);
  await submit.click();
  await engineer.getByRole('status').getByText('resets itself').waitFor({ state: 'attached' });
  equal(await resets(), 1, 'it was asked for once');
});

await h.step('a patient is deleted with the code and the password', async () => {
  const { id } = (await h.api(anna, 'patients', 'POST', { code: 'PX-GONE', site: '' })).body;
  await bob.goto(`${h.url}#/patient/${id}`);
  await bob.getByText('Delete patient data').click();
  const submit = async (code, password) => {
    await bob.getByLabel('Code', { exact: true }).fill(code);
    await bob.getByLabel('Your password').fill(password);
    await bob.getByRole('button', { name: 'Delete permanently' }).click();
  };
  await submit('PX-0001', h.password);
  await bob.getByRole('alert').getByText('The code does not match.').waitFor();
  await submit('PX-GONE', 'not this one');
  await bob.getByRole('alert').getByText('password is wrong').waitFor();
  equal((await h.api(bob, `patients/${id}`)).status, 200, 'still there');
  await bob.getByLabel('Your password').scrollIntoViewIfNeeded();
  await h.look(bob, 'patient-delete', { axe: false });
  await submit('px-gone', h.password);
  await bob.waitForURL(/#\/patients$/);
  equal((await h.api(bob, `patients/${id}`)).status, 404, 'gone');
});

await h.step(
  'a scan is deleted with a reason and its number; one that a reference is made of is not',
  async () => {
  const { scans } = (await h.api(bob, 'scans')).body;
  const reference = scans.find((one) => one.purpose === 'reference' && one.outcome === 'done');
  await bob.goto(`${h.url}#/result/${reference.id}`);
  await bob.locator('.verdict').waitFor();
  await bob.getByText('Delete this scan…').click();
  await bob.getByText(/This scan is the source of reference version \d+/).waitFor();
  equal(await bob.getByRole('button', { name: 'Delete permanently' }).count(), 0,
    'nothing to press');
  equal((await h.api(bob, `scans/${reference.id}`, 'DELETE', { reason: 'a test' })).status, 409,
    'nor through the interface');
  const { id } = scans.find((one) => one.outcome === 'failed');
  await anna.goto(`${h.url}#/result/${id}`);
  await anna.locator('.verdict').waitFor();
  equal(await anna.getByText('Delete this scan…').count(), 0, 'a technician deletes nothing');
  await bob.goto(`${h.url}#/result/${id}`);
  await bob.getByText('Delete this scan…').click();
  await bob.getByText('The log keeps the number of the scan').waitFor();
  await bob.locator('.remove-scan').scrollIntoViewIfNeeded();
  await h.look(bob, 'result-delete', { axe: false });
  await bob.locator('.remove-scan').getByLabel('Reason').fill('markers were covered');
  await bob.getByLabel(`Type ${id} to confirm`).fill('something');
  await bob.getByRole('button', { name: 'Delete permanently' }).click();
  await bob.getByRole('alert').getByText(`Type the number ${id}`).waitFor();
  equal((await h.api(bob, `scans/${id}`)).status, 200, 'it is still there');
  await bob.getByLabel(`Type ${id} to confirm`).fill(id);
  await bob.getByRole('button', { name: 'Delete permanently' }).click();
  await bob.waitForURL(/#\/patient\//);
  equal((await h.api(bob, `scans/${id}`)).status, 404, 'it is gone');
  const { entries } = (await h.api(bob, 'audit')).body;
  equal(entries.find((one) => one.action === 'scan.remove').subject, id,
    'the log keeps its number');
});

await h.step('the last log-in and failed attempts are shown', async () => {
  const again = await h.person('again');
  for (let i = 0; i < 2; ++i) {
    await again.goto(h.url);
    await again.getByLabel('Name').fill('clara');
    await again.getByLabel('Password').fill('not her password');
    await again.getByRole('button', { name: 'Log in' }).click();
    await again.getByRole('alert').getByText('name or password is wrong').waitFor();
  }
  await h.logIn(again, 'clara');
  await again.locator('.last-login',
    { hasText: /Last log-in: .*, from 127\.0\.0\.1\. 2 failed attempts since/ }).waitFor();
  await h.look(again, 'last-login');
  await again.context().close();
});

await h.step('a keyboard alone logs in, starts a sweep and ends it', async () => {
  const keys = await h.person('keys');
  await keys.goto(h.url);
  await keys.getByRole('heading', { name: 'Log in' }).waitFor();
  await keys.keyboard.type('anna');
  await keys.keyboard.press('Tab');
  await keys.keyboard.type(h.password);
  await keys.keyboard.press('Enter');
  await keys.getByRole('navigation').waitFor();
  await keys.locator('.tile').first().waitFor();
  await keys.locator('tbody tr').first().waitFor();
  const focused = () => h.focused(keys);
  const tile = keys.locator('.tile').getByRole('link', { name: 'Daily check' });
  await tile.focus();
  h.tell('unplug');
  await keys.locator('.tile.bad', { hasText: 'missing' }).waitFor();
  equal(await focused(), 'Daily check', 'a tile that is drawn again keeps the focus');
  h.tell('plug');
  await keys.locator('.tile.good', { hasText: 'attached' }).waitFor();
  const { body: { patients } } = await h.api(anna, 'patients');
  equal((await h.api(anna, `patients/${patients.find((one) => one.code === 'PX-0417').id}/open`,
    'POST', { purpose: 'fraction', reason: '',
      replaces: (await h.api(anna, 'status')).body.session?.id ?? '' })).status, 200,
    'a patient to compare');
  await h.acknowledge(keys, anna);
  await keys.locator('.brand').focus();
  for (let i = 0; i < 40 && (await focused()) !== 'Scan'; ++i) await keys.keyboard.press('Tab');
  await h.look(keys, 'focus', { axe: false });
  await keys.keyboard.press('Enter');
  await keys.getByRole('button', { name: 'Start sweep' }).waitFor();
  for (let i = 0; i < 8 && (await focused()) !== 'Start sweep'; ++i) {
    await keys.keyboard.press('Tab');
  }
  equal(await focused(), 'Start sweep', 'the start button is reached from the main part');
  h.tell('slow');
  await keys.keyboard.press('Enter');
  await keys.getByRole('button', { name: 'End sweep', disabled: false }).waitFor();
  equal(await focused(), 'End sweep', 'the focus stays on the button');
  await h.setClockOn(keys, 2);  // likewise
  await keys.keyboard.press('Enter');
  await keys.waitForURL(/#\/result/);
  await keys.close();
});

await h.step('two taps start a sweep and do not end it', async () => {
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: 'Scan again' }).waitFor();
  await anna.evaluate(async () => {
    const button = document.querySelector('.giant');
    button.click();
    while (button.textContent !== 'End sweep') {
      await new Promise((ready) => { setTimeout(ready, 10); });
    }
    button.click();
  });
  await h.ticks(anna);
  equal((await h.api(anna, 'status')).body.state, 'scanning', 'the sweep goes on');
  await anna.getByRole('button', { name: 'Discard scan' }).click();
  await anna.locator('.headline', { hasText: 'Ready' }).waitFor();
  equal(await h.focused(anna), 'Start sweep', 'the focus goes on where the button is gone');
  h.tell('fast');
});

await h.step('without script the last result is shown, without WebGL the pictures', async () => {
  const plain = await h.person('plain', { width: 1280, height: 900 }, { javaScriptEnabled: false });
  await plain.goto(`${h.url}result`);
  await plain.getByLabel('Name').fill('anna');
  await plain.getByLabel('Password', { exact: true }).fill(h.password);
  await plain.getByRole('button', { name: 'Log in' }).click();
  await plain.getByText('NO ANSWER').waitFor();
  check((await plain.getByRole('complementary').innerText()).includes('Not a medical device'),
    'the notice is there');
  await h.picture(plain, 'plain-result.png');
  const flat = await h.person('flat');
  await flat.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = new Proxy(HTMLCanvasElement.prototype.getContext,
      { apply: (target, self, args) =>
        (args[0].startsWith('webgl') ? null : Reflect.apply(target, self, args)) });
  });
  await h.logIn(flat, 'anna');
  await flat.goto(`${h.url}#/result`);
  await flat.getByRole('button', { name: 'Open the 3-D view' }).click();
  await flat.getByText('WebGL is missing').waitFor();
});

await h.step('the first page is small and asks no other server', async () => {
  const page = await h.person('weight');
  const sizes = [];
  const hosts = new Set();
  page.on('response', async (response) => {
    hosts.add(new URL(response.url()).host);
    const size = Number((await response.allHeaders())['content-length'] ?? 0);
    sizes.push(size);
  });
  const begun = Date.now();
  await page.goto(h.url);
  await page.getByRole('button', { name: 'Log in' }).waitFor();
  const paint = await page.evaluate(
    () => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? -1);
  const total = sizes.reduce((sum, size) => sum + size, 0);
  console.log(`    first page ${total} bytes, first paint ${Math.round(paint)} ms, login shown `
    + `after ${Date.now() - begun} ms`);
  check(total < 150000, `first page is ${total} bytes`);
  equal(hosts.size, 1, 'one host');
});

await h.step('the session ends with log out', async () => {
  await anna.goto(`${h.url}#/status`);
  await anna.getByRole('button', { name: 'Log out' }).click();
  await anna.getByRole('heading', { name: 'Log in' }).waitFor();
  equal(await anna.evaluate(() => fetch('/api/v1/status').then((response) => response.status)), 401,
    'nothing without login');
});

await h.finish();
