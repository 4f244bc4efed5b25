// What a person could get wrong at the screen, each as a test: use_errors_test.mjs NODE_MODULES SERVER OUT_FOLDER CHROMIUM
// The truths are written here by hand, from what a motion of the body means to who stands beside it; none comes from the program.
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

const engineer = await h.person('engineer');
const anna = await h.person('anna');
const bob = await h.person('bob');
const clara = await h.person('clara');
const kPeople = [[anna, 'anna', 'technician'], [bob, 'bob', 'physicist'], [clara, 'clara', 'physicist']];

async function addPatient(code) {
  await anna.goto(`${h.url}#/patients`);
  await anna.getByLabel('Code', { exact: true }).fill(code);
  await anna.getByRole('button', { name: 'Add a patient' }).click();
  await anna.getByRole('heading', { name: code }).waitFor();
}

/// A sweep from the scan screen to its result.
async function scan() {
  const before = (await h.api(anna, 'scans?limit=1')).body.scans[0]?.id;
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await anna.waitForURL(/#\/result/, { timeout: 60000 });
  await anna.locator('.verdict').waitFor();
  const newest = (await h.api(anna, 'scans?limit=1')).body.scans[0];
  check(newest.id !== before, 'a new scan');
  return newest;
}

await h.step('accounts of three roles, a patient, an approved reference', async () => {
  await h.firstStart(engineer);
  await engineer.goto(`${h.url}#/users`);
  for (const [, name, role] of kPeople) await h.addAccount(engineer, name, role);
  for (const [page, name] of kPeople) await h.logIn(page, name);
  await addPatient('PX-0001');
  await anna.getByRole('button', { name: 'Take a new reference' }).click();
  await scan();
  for (const page of [bob, clara]) {
    await page.goto(`${h.url}#/patients`);
    await page.getByRole('link', { name: 'PX-0001' }).click();
    await page.getByRole('link', { name: 'Plan, Version 1' }).click();
    if (page === bob) await page.getByRole('button', { name: 'Save plan' }).click();
    else await page.getByRole('button', { name: 'Approve' }).click();
    await page.getByText(page === bob ? 'Plan saved.' : 'approved by clara').waitFor();
  }
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'PX-0001' }).click();
  await anna.getByRole('button', { name: 'Open for a fraction' }).click();
});

// What the body did -> the words that put it back. Head first, supine: the head is at the gantry, the patient's left is on the right of
// who faces the gantry. `toward` is where the arrow's tip lies from its tail on the screen (x right, y down); a turn seen from above
// goes the way of the clock or against it.
const kSigns = [
  ['z', 8, 'HFS', 'Vertical', '−8.0', 'down', { y: 1 }, 'the body lies 8 mm too high'],
  ['z', -8, 'HFS', 'Vertical', '+8.0', 'up', { y: -1 }, 'too low'],
  ['y', 8, 'HFS', 'Longitudinal', '−8.0', 'away from gantry', { y: 1 }, 'too near the gantry, which is drawn on top'],
  ['y', -8, 'HFS', 'Longitudinal', '+8.0', 'toward gantry', { y: -1 }, 'too far from the gantry'],
  ['x', 8, 'HFS', 'Lateral', '−8.0', 'to patient right', { x: -1 }, 'too far to its own left'],
  ['x', -8, 'HFS', 'Lateral', '+8.0', 'to patient left', { x: 1 }, 'too far to its own right'],
  ['pitch', 2, 'HFS', 'Pitch', '−2.00', 'head down', { y: 1 }, 'the head end is lifted'],
  ['pitch', -2, 'HFS', 'Pitch', '+2.00', 'head up', { y: -1 }, 'the head end hangs'],
  ['roll', 2, 'HFS', 'Roll', '−2.00', 'patient right side down', { y: 1, end: 'left' }, 'its left side hangs'],
  ['roll', -2, 'HFS', 'Roll', '+2.00', 'patient left side down', { y: 1, end: 'right' }, 'its right side hangs'],
  ['yaw', 2, 'HFS', 'Yaw', '−2.00', 'head to patient left', { clockwise: true }, 'turned against the clock: the head went to its right'],
  ['yaw', -2, 'HFS', 'Yaw', '+2.00', 'head to patient right', { clockwise: false }, 'turned with the clock: the head went to its left'],
  // The other postures turn the words over, never the sign or the arrow, which are the room's.
  ['x', 8, 'HFP', 'Lateral', '−8.0', 'to patient left', { x: -1 }, 'prone'],
  ['x', 8, 'FFS', 'Lateral', '−8.0', 'to patient left', { x: -1 }, 'feet first'],
  ['x', 8, 'FFP', 'Lateral', '−8.0', 'to patient right', { x: -1 }, 'feet first, prone'],
  ['pitch', 2, 'FFS', 'Pitch', '−2.00', 'head up', { y: 1 }, 'feet first: what hangs now is the head'],
  ['roll', 2, 'HFP', 'Roll', '−2.00', 'patient left side down', { y: 1, end: 'left' }, 'prone'],
  ['yaw', 2, 'FFS', 'Yaw', '−2.00', 'head to patient left', { clockwise: true }, 'feet first: the feet went left of who faces the gantry, the head right'],
];

/// Tail and tip of the card's arrow on the screen, and the middle of its drawing.
const arrowOf = (card) => card.locator('svg.arrow').evaluate((drawing) => {
  const stroke = drawing.querySelector('path.stroke');
  const matrix = stroke.getScreenCTM();
  const [first] = stroke.getAttribute('d').split(/(?<=.)M/);  // the shaft comes first, the head after it
  const shaft = document.createElementNS('http://www.w3.org/2000/svg', 'path');
  shaft.setAttribute('d', first);
  const at = (share) => { const point = shaft.getPointAtLength(share * shaft.getTotalLength()).matrixTransform(matrix); return { x: point.x, y: point.y }; };
  const box = drawing.getBoundingClientRect();
  return { tail: at(0), before: at(0.9), tip: at(1), middle: { x: box.x + box.width / 2, y: box.y + box.height / 2 } };
});

for (const [axis, amount, posture, name, value, words, toward, why] of kSigns) {
  await h.step(`sign of ${name.toLowerCase()}, ${posture}, ${why}`, async () => {
    h.tell(`moved ${axis} ${amount} ${posture}`);
    await scan();
    const card = anna.locator('.number', { has: anna.getByRole('heading', { name, exact: true }) });
    await card.waitFor();
    check((await card.locator('.value').innerText()).startsWith(value), `${name} reads ${value}, found ${await card.locator('.value').innerText()}`);
    equal(await card.locator('.word').innerText(), words, 'the words');
    const { tail, before, tip, middle } = await arrowOf(card);
    if (toward.x) check(Math.sign(tip.x - tail.x) === toward.x && Math.abs(tip.x - tail.x) > 5, 'the arrow points to its side');
    if (toward.y) check(Math.sign(tip.y - tail.y) === toward.y && Math.abs(tip.y - tail.y) > 5, 'the arrow points up or down as it should');
    if (toward.end) equal(tip.x < middle.x ? 'left' : 'right', toward.end, 'the end that the arrow is at');
    if (toward.clockwise !== undefined) {
      // On a screen (y down) a positive cross product of radius and motion turns with the clock.
      const cross = (before.x - middle.x) * (tip.y - before.y) - (before.y - middle.y) * (tip.x - before.x);
      equal(cross > 0, toward.clockwise, 'the arrow turns with the clock');
    }
    // All others stay: neither a sign nor a direction that somebody could apply.
    for (const other of await anna.locator('.number').all()) {
      if (await other.getByRole('heading').innerText() === name) continue;
      check(/^0\.0/.test(await other.locator('.value').innerText()), `only ${name} moves: ${await other.innerText()}`);
      equal(await other.locator('.word').innerText(), 'stays', 'no direction');
    }
  });
}

await h.step('a lifted shoulder is said in words, on the page and in print', async () => {
  h.tell('shoulder');
  const shown = await scan();
  const posture = anna.locator('.body-words > div').first();
  await posture.waitFor();
  await h.look(anna, 'result-posture');
  const said = await posture.locator('li').allInnerTexts();
  check(said.some((words) => /^left side at the head end \d+ mm high$/.test(words)), `the left shoulder: ${said.join('; ')}`);
  check(!said.some((words) => /^right side at the head end \d+ mm high$/.test(words)), `not the right one: ${said.join('; ')}`);
  const { body } = await h.api(anna, `results/${shown.id}`);
  equal(body.body.named_by, 'posture', 'what names the parts');
  await anna.goto(`${h.url}result?scan=${shown.id}`);
  await anna.getByText(/left side at the head end \d+ mm high/).first().waitFor();
  await anna.screenshot({ path: h.file('print.png'), fullPage: true });
});

await h.step('a wrong reference is NO ANSWER with its reason, and nothing to apply', async () => {
  h.tell('stranger');
  const shown = await scan();
  await anna.locator('.verdict.no_answer').waitFor();
  check((await anna.locator('.verdict').innerText()).includes('NO ANSWER'), 'the verdict');
  check(/does not look like this reference/.test(await anna.locator('.verdict .why').innerText()), await anna.locator('.verdict .why').innerText());
  equal(await anna.locator('.number').count(), 0, 'no numbers');
  equal(await anna.locator('.correction').count(), 0, 'no correction');
  equal(await anna.locator('.body-words').count(), 0, 'no posture');
  equal(await anna.getByRole('button', { name: 'Accept' }).count(), 0, 'nothing to accept');
  check(!/Apply/.test(await anna.locator('main').innerText()), 'nothing is to be applied');
  await h.look(anna, 'result-wrong-reference');
  await anna.goto(`${h.url}result?scan=${shown.id}`);
  await anna.getByText('NO ANSWER').waitFor();
  equal(await anna.locator('table').count(), 0, 'no numbers in print either');
});

await h.step('a result that grows old on the screen turns grey and says so', async () => {
  h.tell('moved z 8 HFS');
  await scan();
  equal(await anna.locator('.is-old').count(), 0, 'fresh at first');
  const colour = () => anna.locator('.fresh').evaluate((element) => getComputedStyle(element).filter);
  equal(await colour(), 'none', 'in colour');
  h.tell('old');
  await anna.getByText('Do not act on it').waitFor();
  equal(await anna.locator('.is-old').count(), 1, 'marked as old');
  equal(await colour(), 'grayscale(1)', 'grey');
  await h.look(anna, 'result-grown-old', { axe: false });
});

await h.step('the wrong patient: both codes are on the screen', async () => {
  const last = (await h.api(anna, 'scans?limit=1')).body.scans[0];
  await addPatient('PX-0002');
  await anna.getByText('Is PX-0002 the patient on the couch?').waitFor();
  equal(await anna.getByRole('button', { name: 'Open for a fraction' }).isDisabled(), true, 'no fraction without a reference of its own');
  await anna.getByRole('button', { name: 'Take a new reference' }).click();
  await anna.locator('.who-line', { hasText: 'PX-0002' }).waitFor();  // the scan screen names who is open
  await anna.goto(`${h.url}#/result/${last.id}`);
  await anna.getByText('Another patient (PX-0002) is open').waitFor();
  check((await anna.locator('.identity').innerText()).includes('PX-0001'), 'the result names whose it is');
});

await h.step('three roles: what a screen hides the interface refuses', async () => {
  const scans = (await h.api(anna, 'scans?limit=1')).body.scans;
  const user = { name: 'mallory', role: 'engineer', password: 'correct horse battery' };
  const plan = ['PUT', 'references/r0001/plan', { region_m: [], isocentre_m: null, shift_tolerance_mm: 3, rotation_tolerance_deg: 1, posture: 'HFS', couch_markers: false }];
  const kRefused = [
    [anna, ['GET', 'users'], ['POST', 'users', user], ['GET', 'audit'], plan, ['POST', 'references/r0001/approve'], ['POST', 'references', { scan_id: scans[0].id, reason: '' }], ['DELETE', 'patients/p0001'], ['POST', 'update', { bundle: 'plumb-0.2.0.raucb' }], ['POST', 'diagnostics']],
    [bob, ['GET', 'users'], ['POST', 'users', user], ['POST', 'update', { bundle: 'plumb-0.2.0.raucb' }], ['POST', 'diagnostics']],
    [engineer, ['POST', 'patients', { code: 'PX-1', site: '' }], plan, ['POST', 'references/r0001/approve'], ['POST', `scans/${scans[0].id}/accept`], ['DELETE', 'patients/p0001']],
  ];
  for (const [page, ...calls] of kRefused) for (const [method, path, body] of calls) equal((await h.api(page, path, method, body)).status, 403, `${method} ${path}`);
  for (const [page, allowed] of [[anna, ['Status', 'Patients', 'Scan', 'Result']], [bob, ['Log']], [engineer, ['Log', 'Settings', 'Update']]]) {
    for (const name of allowed) equal(await page.getByRole('navigation').getByRole('link', { name, exact: true }).count(), 1, `${name} is offered`);
  }
  for (const [page, hidden] of [[anna, 'Install'], [bob, 'Install'], [anna, 'Download diagnostics']]) {
    await page.goto(`${h.url}#/update`);
    await page.getByText('Installed version').waitFor();
    equal(await page.getByRole('button', { name: hidden }).count(), 0, `${hidden} is not offered`);
  }
});

await h.step('unplugged in the middle of a sweep: no result, and none of before in its place', async () => {
  h.tell('slow');
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await anna.getByRole('button', { name: 'End sweep' }).waitFor();
  h.tell('unplug');
  await anna.getByRole('alert').getByText('The sensor is gone').waitFor();
  equal(await anna.locator('.number').count(), 0, 'no numbers');
  equal((await h.api(anna, 'scans?limit=1')).body.scans[0].outcome, 'failed', 'the scan');
});

await h.finish();
