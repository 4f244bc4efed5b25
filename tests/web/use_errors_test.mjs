// SPDX-License-Identifier: Apache-2.0
// What a person could get wrong at the screen, each as a test: use_errors_test.mjs NODE_MODULES
// SERVER OUT_FOLDER CHROMIUM
// The truths are written here by hand, from what a motion of the body means to who stands beside
// it; none comes from the program.
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

const engineer = await h.person('engineer');
const anna = await h.person('anna');
const bob = await h.person('bob');
const clara = await h.person('clara');
const kPeople = [[anna, 'anna', 'technician'], [bob, 'bob', 'physicist'],
  [clara, 'clara', 'physicist']];

async function addPatient(code) {
  await h.addPatient(anna, code);
  await anna.getByRole('heading', { name: code }).waitFor();
}

// Which side is the patient's is decided once, with the words; no picture may claim more than they
// do.
const marksIn = async (page, where) => [...new Set(await page.locator(`${where} [data-mark]`)
  .evaluateAll((marks) => marks.map((mark) => mark.dataset.mark)))].sort();

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
  h.tell('checked');  // today, so that nothing is doubtful about a reference
  for (const [, name, role] of kPeople) await h.addAccountByApi(engineer, name, role);
  await Promise.all(kPeople.map(([page, name]) => h.logIn(page, name)));
  await addPatient('PX-0001');
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await scan();
  for (const page of [bob, clara]) {
    await page.goto(`${h.url}#/patients`);
    await page.getByRole('link', { name: 'PX-0001' }).click();
    await page.getByRole('link', { name: 'Plan, Version 1' }).click();
    if (page === bob) await page.getByRole('button', { name: 'Save plan' }).click();
    else {
      await page.getByRole('button', { name: 'Review and approve' }).click();
      await h.sign(page);
    }
    await page.getByText(page === bob ? 'Plan saved.' : 'approved by clara').waitFor();
  }
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'PX-0001' }).click();
  await anna.getByRole('button', { name: 'Start treatment session' }).click();
});

// What the body did -> the words that put it back. Head first, supine: the head is at the gantry,
// the patient's left is on the right of who faces the gantry. `toward` is where the arrow's tip
// lies from its tail on the screen (x right, y down); a turn seen from above goes the way of the
// clock or against it.
const kSigns = [
  ['z', 8, 'HFS', 'Vertical', '−8.0', 'down', { y: 1 }, 'the body lies 8 mm too high'],
  ['z', -8, 'HFS', 'Vertical', '+8.0', 'up', { y: -1 }, 'too low'],
  ['y', 8, 'HFS', 'Longitudinal', '−8.0', 'away from gantry', { y: 1 },
    'too near the gantry, which is drawn on top'],
  ['y', -8, 'HFS', 'Longitudinal', '+8.0', 'toward gantry', { y: -1 }, 'too far from the gantry'],
  ['x', 8, 'HFS', 'Lateral', '−8.0', 'to patient right', { x: -1 }, 'too far to its own left'],
  ['x', -8, 'HFS', 'Lateral', '+8.0', 'to patient left', { x: 1 }, 'too far to its own right'],
  ['pitch', 2, 'HFS', 'Pitch', '−2.0', 'head down', { y: 1 }, 'the head end is lifted'],
  ['pitch', -2, 'HFS', 'Pitch', '+2.0', 'head up', { y: -1 }, 'the head end hangs'],
  ['roll', 2, 'HFS', 'Roll', '−2.0', 'patient right side down', { y: 1, end: 'left' },
    'its left side hangs'],
  ['roll', -2, 'HFS', 'Roll', '+2.0', 'patient left side down', { y: 1, end: 'right' },
    'its right side hangs'],
  ['yaw', 2, 'HFS', 'Yaw', '−2.0', 'head to patient left', { clockwise: true },
    'turned against the clock: the head went to its right'],
  ['yaw', -2, 'HFS', 'Yaw', '+2.0', 'head to patient right', { clockwise: false },
    'turned with the clock: the head went to its left'],
  // The other postures turn the words over, never the sign or the arrow, which are the room's.
  ['x', 8, 'HFP', 'Lateral', '−8.0', 'to patient left', { x: -1 }, 'prone'],
  ['x', 8, 'FFS', 'Lateral', '−8.0', 'to patient left', { x: -1 }, 'feet first'],
  ['x', 8, 'FFP', 'Lateral', '−8.0', 'to patient right', { x: -1 }, 'feet first, prone'],
  ['pitch', 2, 'FFS', 'Pitch', '−2.0', 'head up', { y: 1 },
    'feet first: what hangs now is the head'],
  ['roll', 2, 'HFP', 'Roll', '−2.0', 'patient left side down', { y: 1, end: 'left' }, 'prone'],
  ['yaw', 2, 'FFS', 'Yaw', '−2.0', 'head to patient left', { clockwise: true },
    'feet first: the feet went left of who faces the gantry, the head right'],
];

/// Tail and tip of the card's arrow on the screen, and the middle of its drawing.
const arrowOf = (card) => card.locator('svg.arrow').evaluate((drawing) => {
  const stroke = drawing.querySelector('path.stroke');
  const matrix = stroke.getScreenCTM();
  // The shaft comes first, the head after it.
  const [first] = stroke.getAttribute('d').split(/(?<=.)M/);
  const shaft = document.createElementNS('http://www.w3.org/2000/svg', 'path');
  shaft.setAttribute('d', first);
  const at = (share) => {
    const point = shaft.getPointAtLength(share * shaft.getTotalLength()).matrixTransform(matrix);
    return { x: point.x, y: point.y };
  };
  const box = drawing.getBoundingClientRect();
  return { tail: at(0), before: at(0.9), tip: at(1),
    middle: { x: box.x + box.width / 2, y: box.y + box.height / 2 } };
});

h.tell('swift');
for (const [axis, amount, posture, name, value, words, toward, why] of kSigns) {
  await h.step(`sign of ${name.toLowerCase()}, ${posture}, ${why}`, async () => {
    h.tell(`moved ${axis} ${amount} ${posture}`);
    await scan();
    const card = anna.locator('.number', { has: anna.getByRole('heading', { name, exact: true }) });
    await card.waitFor();
    check((await card.locator('.value').innerText()).startsWith(value),
      `${name} reads ${value}, found ${await card.locator('.value').innerText()}`);
    equal(await card.locator('.word').innerText(), words, 'the words');
    const { tail, before, tip, middle } = await arrowOf(card);
    if (toward.x) {
      check(Math.sign(tip.x - tail.x) === toward.x && Math.abs(tip.x - tail.x) > 5,
        'the arrow points to its side');
    }
    if (toward.y) {
      check(Math.sign(tip.y - tail.y) === toward.y && Math.abs(tip.y - tail.y) > 5,
        'the arrow points up or down as it should');
    }
    if (toward.end) {
      equal(tip.x < middle.x ? 'left' : 'right', toward.end, 'the end that the arrow is at');
    }
    if (toward.clockwise !== undefined) {
      // On a screen (y down) a positive cross product of radius and motion turns with the clock.
      const cross = (before.x - middle.x) * (tip.y - before.y)
        - (before.y - middle.y) * (tip.x - before.x);
      equal(cross > 0, toward.clockwise, 'the arrow turns with the clock');
    }
    // All others stay: neither a sign nor a direction that somebody could apply.
    for (const other of await anna.locator('.number').all()) {
      if (await other.getByRole('heading').innerText() === name) continue;
      check(/^0\.0/.test(await other.locator('.value').innerText()),
        `only ${name} moves: ${await other.innerText()}`);
      equal(await other.locator('.word').innerText(), 'no change', 'no direction');
    }
  });
}

await h.step('the result opens by itself even if the message of it was lost on the way',
  async () => {
  await anna.addInitScript(() => {
    const listen = EventSource.prototype.addEventListener;
    EventSource.prototype.addEventListener = function hear(kind, take) {
      listen.call(this, kind, (event) => {
        if (kind !== 'result' || !window.losesResults) take(event);
      });
    };
  });
  await anna.goto(`${h.url}#/scan`);
  await anna.reload();
  await anna.evaluate(() => { window.losesResults = true; });
  await scan();
  check(await anna.evaluate(() => window.losesResults), 'in the same page');
  await anna.reload();
});

await h.step('a sweep that was begun and discarded does not make the result before it valid again',
  async () => {
  h.tell('moved y -8 HFS');
  await scan();
  await anna.locator('.verdict.move').waitFor();
  h.tell('slow');
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: 'Scan again' }).click();
  await anna.locator('.chip[data-state=scanning]').waitFor();
  equal((await h.api(anna, 'cancel', 'POST')).status, 200, 'discarded');
  await anna.locator('.chip[data-state=ready]').waitFor();
  await anna.goto(`${h.url}#/result`);
  await anna.locator('.old-note').getByText('SUPERSEDED').waitFor();
  equal(await anna.locator('svg.arrow').count(), 0, 'nothing to apply');
  equal(await anna.locator('.couch').count(), 0, 'no couch readings');
  h.tell('swift');
});

await h.step('a result is not shown while what is doubtful about it cannot be had', async () => {
  const quality = '**/api/v1/scans/*/quality';
  await scan();
  await anna.route(quality, (route) => route.abort());
  await anna.reload();
  await anna.getByText('The appliance is not responding.').first().waitFor();
  equal(await anna.locator('.number').count(), 0, 'no numbers');
  await anna.unroute(quality);
  await anna.reload();
  await anna.locator('.number').first().waitFor();
});

await h.step('couch readings: the sum is done, only for a move, only where the room is known',
  async () => {
  h.tell('moved y -8 HFS');  // put right by +8 mm toward the gantry, which counts up
  await scan();
  await anna.getByText('Couch readings: what to set').click();
  await anna.getByLabel('Longitudinal (cm)').fill('-12.4');
  await anna.getByText('Longitudinal: set to −11.6 cm').waitFor();
  await anna.getByLabel('Lateral (cm)').fill('999');
  await anna.getByText('a number in cm').waitFor();
  await anna.getByLabel('Lateral (cm)').fill('0,3');
  await anna.getByText('Lateral: set to 0.3 cm').waitFor();  // below its uncertainty: it stays
  await h.look(anna, 'result-couch', { axe: false });
  h.tell('room unknown');
  await anna.goto(`${h.url}#/status`);
  await anna.reload();
  await anna.goto(`${h.url}#/result`);
  await anna.locator('.number').first().waitFor();
  equal(await anna.locator('.couch').count(), 0, 'not in an unknown room');
  h.tell('room known');
});

await h.step('a couch that counts in cm, downward, and only shifts: numbers, readings, words and '
  + 'what it cannot do, on page, room display and page without script; the verdict stays',
async () => {
  const card = (page, name) =>
    page.locator('.number', { has: page.getByRole('heading', { name, exact: true }) });
  h.tell('moved z 8 HFS');
  await scan();
  equal(await card(anna, 'Vertical').locator('.value').innerText(), '−8.0 mm', 'before');
  await bob.goto(`${h.url}#/check`);
  await bob.getByText('No profile: a couch of six axes').waitFor();
  await bob.getByText('Change the profile…').click();
  await bob.getByLabel('Name of the couch').fill('Couch 2');
  await bob.getByLabel('What it can apply').selectOption('3');
  await bob.getByLabel('Unit of shifts').selectOption('cm');
  await bob.getByLabel('Vertical shrinks upward').check();
  await bob.getByLabel('Leave out what it cannot apply').check();
  await h.look(bob, 'couch-profile', { axe: true });
  const ofCouch = bob.locator('section',
    { has: bob.getByRole('heading', { name: 'Couch', exact: true }) });
  await ofCouch.getByLabel('Your password').fill(h.password);
  await bob.getByRole('button', { name: 'Sign the profile' }).click();
  await bob.getByText('Version 1, signed by bob').waitFor();
  // The same result, at once: the page of it is open.
  await card(anna, 'Vertical').locator('.value', { hasText: '+0.80 cm' }).waitFor();
  equal(await card(anna, 'Vertical').locator('.word').innerText(), 'down', 'the body');
  equal(await anna.locator('.number').count(), 3, 'rotations are in tolerance: left out');
  await anna.getByText('Apply the 3 numbers below that the couch can move').waitFor();
  await anna.getByText('It cannot correct: Pitch, Roll, Yaw.').waitFor();
  await anna.getByText('Couch readings: what to set').click();
  await anna.getByLabel('Vertical (cm)').fill('12.4');
  await anna.getByText('Vertical: set to 13.2 cm').waitFor();
  await h.look(anna, 'result-couch-profile');
  const plain = await anna.context().request.get(`${h.url.replace(/#.*/, '')}result`);
  const page = await plain.text();
  check(page.includes('+0.80 cm') && page.includes('Couch 2') && page.includes('MOVE'),
    'the page without script');
  h.tell('moved yaw 4 HFS');
  await scan();
  await card(anna, 'Yaw').locator('.word', { hasText: 'not by the couch: move the patient' })
    .waitFor();
  equal(await card(anna, 'Yaw').locator('.arrow').count(), 0, 'no arrow for the couch');
  await anna.locator('.verdict.move').waitFor();
  const six = { version: 1, name: 'Couch 2', num_axes: 6, is_in_cm: false, hides_rest: false,
    ...Object.fromEntries(['vertical', 'longitudinal', 'lateral', 'pitch', 'roll', 'yaw'].map(
      (name) => [`reverses_${name}`, false])) };
  equal((await h.api(bob, 'couch', 'POST', { ...six, is_in_cm: true, wraps: true,
    password: h.password })).status, 201, 'one without readings below zero');
  await anna.getByText('995 cm (9950 mm) stands for −5 cm').waitFor();
  await anna.getByText('Couch readings: what to set').click();
  for (const [field, reading, words] of [['Lateral (cm)', '995', 'Lateral: set to 995.0 cm'],
    ['Yaw (°)', '1.5', 'Yaw: set to 357.5 °'], ['Yaw (°)', '-1', 'from 0 to below 360'],
    ['Lateral (cm)', '1000', 'from 0 to below 1000']]) {
    await anna.getByLabel(field).fill(reading);
    await anna.getByText(words).waitFor();
  }
  equal((await h.api(bob, 'couch', 'POST', { ...six, version: 2, password: h.password })).status,
    201, 'back');
});

await h.step('a result of an earlier session of the same patient is not valid in the next one, '
  + 'where nothing has been scanned yet', async () => {
  h.tell('moved z 8 HFS');
  const { id } = await scan();
  await anna.getByText('Accept outside tolerance…').waitFor();
  const { session } = (await h.api(anna, 'status')).body;
  await h.api(anna, 'treatment/close', 'POST', { session_id: session.id });
  equal((await h.api(anna, `patients/${session.patient_id}/open`, 'POST',
    { purpose: 'fraction', reason: '', replaces: '' })).status, 200, 'the next fraction');
  await h.acknowledge(anna);
  await anna.locator('.old-note', { hasText: 'SESSION NOT OPEN' }).waitFor();
  equal(await anna.locator('.number .arrow').count(), 0, 'nothing is commanded');
  equal(await anna.getByText('Accept outside tolerance…').count(), 0, 'nothing to accept');
  equal((await h.api(anna, `scans/${id}/accept-outside`, 'POST',
    { reason: 'of the last fraction', password: h.password })).status, 409,
    'the interface refuses too');
  await anna.locator('.chip', { hasText: 'Ready' }).waitFor();
  await h.look(anna, 'result-of-earlier-session', { axe: false });
  await anna.goto(`${h.url}#/scan`);
  await anna.locator('.headline', { hasText: 'Ready' }).waitFor();
  equal(await anna.locator('.giant').innerText(), 'Start sweep', 'no scan yet, so none again');
  await anna.locator('.who-line', { hasText: '0 scans' }).waitFor();
});

await h.step('where the room was never said: the words are the patient’s, no arrow, mark or '
  + 'reading is the couch’s', async () => {
  h.tell('room unknown');
  await anna.goto(`${h.url}#/status`);
  await anna.reload();
  h.tell('moved y -8 HFS bare');  // to the feet: along the marker's x axis, where the head lies
  await scan();
  const card = (name) =>
    anna.locator('.number', { has: anna.getByRole('heading', { name, exact: true }) });
  // The head lies along the marker's x axis: that card is named head/feet, like its direction, and
  // no card is named after a couch axis.
  await card('Patient head/feet').waitFor();
  equal(await card('Patient head/feet').locator('.value').innerText(), '+8.0 mm',
    'along the marker’s axis');
  equal(await card('Patient head/feet').locator('.word').innerText(), 'toward the head',
    'the words');
  equal(await card('Patient head/feet').locator('.arrow').count(), 0, 'no arrow of the couch');
  equal((await anna.locator('.number h3').allInnerTexts()).join(),
    'Vertical,Patient left/right,Patient head/feet,Tilt left/right,Tilt head/feet,Yaw',
    'the cards');
  await anna.getByText('The axes of the room are not known: directions are those of the patient or '
    + 'of the reference marker, never of the couch.').waitFor();
  equal(await anna.locator('.couch').count(), 0, 'no couch readings');
  await anna.locator('.map-row .map-box .ways').waitFor();
  equal((await marksIn(anna, '.map-row .map-box .ways')).join(), 'feet,head,left,right', 'the map');
  check(!/gantry/i.test(await anna.locator('main').innerText()), 'no word of the gantry');
  await h.look(anna, 'result-no-room', { axe: false });
  h.tell('moved z 8 HFS bare');  // up needs no room
  await scan();
  equal(await card('Vertical').locator('.word').innerText(), 'down (posterior)', 'the words');
  equal(await card('Vertical').locator('.arrow').count(), 1, 'down is down everywhere');
  h.tell('room known');
  h.tell('moved y -8 HFS');  // set, as it was: the room's words and arrows
  await scan();
  equal(await card('Longitudinal').locator('.word').innerText(), 'toward gantry',
    'in a known room');
  equal(await card('Longitudinal').locator('.arrow').count(), 1, 'with its arrow');
  equal(await anna.getByText('The axes of the room are not known').count(), 0,
    'nothing to warn of');
});

await h.step('a result that can no longer be acted on says what was found, and commands nothing',
  async () => {
  h.tell('moved y -8 HFS');
  const shown = await scan();
  await anna.getByRole('heading', { name: /^Correction to apply/ }).waitFor();
  await anna.getByText('heights of all measured parts').first().waitFor();
  equal(await anna.getByText('Correct the posture first').count(), 0, 'nothing to correct');
  equal(await anna.locator('.number .arrow').count(), 1, 'while it is valid it commands');
  // After a restart only the wall clock gives its age, and somebody may have changed that clock.
  h.tell('restarted');
  await anna.getByRole('heading', { name: /^Correction found then/ }).waitFor();
  await anna.locator('.old-note', { hasText: 'OLD' }).waitFor();
  equal(await anna.locator('.number .arrow').count(), 0, 'nothing is commanded');
  h.tell('old');
  await anna.getByRole('heading', { name: /^Correction found then/ }).waitFor();
  for (const where of [`${h.url}#/result`, `${h.url}#/result/${shown.id}`]) {
    await anna.goto(`${h.url}#/status`);
    await anna.goto(where);
    await anna.getByRole('heading', { name: /^Correction found then/ }).waitFor();
    equal(await anna.locator('.number .arrow').count(), 0, 'no arrow');
    equal(await anna.locator('.couch').count(), 0, 'nothing to set');
    equal(await anna.locator('.verdict .word').innerText(), '↔WAS OUTSIDE TOLERANCE',
      'the verdict');
    check(!/Correction to apply|Apply the correction/.test(await anna.locator('main').innerText()),
      'nothing to apply');
    await anna.getByRole('heading', { name: 'Posture difference at this scan', exact: true })
      .waitFor();
    equal(await anna.getByText('Correct the posture first').count(), 0, 'no order');
  }
  await h.look(anna, 'result-review', { axe: false });
  await anna.goto(`${h.url}result?scan=${shown.id}`);
  await anna.getByText(
    'Correction found then, about the middle of the region: not to be applied now').waitFor();
  check(!/Correction to apply|MOVE/.test(await anna.locator('main').innerText()), 'nor in print');
});

await h.step('a lifted shoulder is said in words, on the page and in print', async () => {
  h.tell('shoulder');
  const shown = await scan();
  const posture = anna.locator('.body-words > div').first();
  await posture.waitFor();
  await h.look(anna, 'result-posture', { axe: false });
  const said = await posture.locator('li').allInnerTexts();
  check(said.some((words) => /^left side at the head end \d+ mm high$/.test(words)),
    `the left shoulder: ${said.join('; ')}`);
  check(!said.some((words) => /^right side at the head end \d+ mm high$/.test(words)),
    `not the right one: ${said.join('; ')}`);
  equal(await anna.locator('.verdict .flags li').first().innerText(),
    `Posture differs: ${said[0]}.`, 'beside the verdict');
  await anna.getByText('Correct the posture first').waitFor();
  const { body } = await h.api(anna, `results/${shown.id}`);
  equal(body.body.named_by, 'posture', 'what names the parts');
  await anna.goto(`${h.url}result?scan=${shown.id}`);
  await anna.getByText(/left side at the head end \d+ mm high/).first().waitFor();
  await h.look(anna, 'print', { axe: false });
});

const kPatients = ['feet', 'head', 'left', 'right'];
const kPictures = ['.map-row .map-box .ways', '.map-row .profile', '.halves .map-box .ways'];
/// Map, profile, overlay and 3-D of the result that anna sees.
async function marksOfResult(name) {
  await anna.locator('.map-row .map-box .ways').waitFor();
  const found = {};
  for (const where of kPictures) found[where] = await marksIn(anna, where);
  await anna.getByRole('button', { name: 'Open the 3-D view' }).click();
  await anna.locator('canvas.mesh[data-ready=yes]').waitFor({ timeout: 60000 });
  const views = await anna.locator('.mesh-place').getByRole('button').allInnerTexts();
  await h.look(anna, name, { axe: false });
  return { found, views };
}

await h.step('as planned: the pictures name the sides of the patient', async () => {
  h.tell('moved z 8 HFS');
  await scan();
  const { found, views } = await marksOfResult('marks-patient');
  equal(found[kPictures[0]].join(), 'feet,gantry,head,left,right', 'the map');
  equal(found[kPictures[2]].join(), 'feet,gantry,head,left,right', 'the overlay');
  equal(found[kPictures[1]].length, 2, 'both ends of the profile');
  check(found[kPictures[1]].every((name) => kPatients.includes(name)),
    `the profile: ${found[kPictures[1]]}`);
  check(views.includes('Left') && views.includes('Feet'), `3-D views: ${views}`);
  equal(await anna.locator('.marks-note').count(), 0, 'nothing to warn of');
});

await h.step(
  'compared before the room was known: its pictures have no gantry, whatever is known now',
  async () => {
  h.tell('moved z 8 HFS bare');
  const { id } = await scan();
  equal((await h.api(anna, `results/${id}`)).body.body.room_known, false, 'as it was compared');
  const { found } = await marksOfResult('marks-room-since');
  equal(found[kPictures[0]].join(), 'feet,head,left,right', 'the map');
  equal(found[kPictures[2]].join(), 'feet,head,left,right', 'the overlay');
});

await h.step(
  'the slider of the 3-D view moves the surface as the correction will, beside the reference',
  async () => {
  // Where the region lies in the picture from the left, in pixels from the top: all around it is
  // dimmed. Without the cube in the corner and the yellow names of the sides, which stay where they
  // are.
  const middle = () => anna.locator('canvas.mesh').evaluate(async (canvas) => {
    const { data, width, height } = await window.pixelsOf(canvas);
    let [sum, count] = [0, 0];
    for (let i = 0; i < data.length; i += 4) {
      const [x, y] = [(i / 4) % width, Math.floor(i / 4 / width)];
      if (data[i] + data[i + 1] + data[i + 2] < 330 || data[i] - data[i + 2] > 20) continue;
      if (x > 0.6 * width && y > 0.6 * height) continue;
      sum += y;
      ++count;
    }
    return sum / count;
  });
  h.tell('moved z 60 HFS');  // the way back is down
  await scan();
  await anna.getByRole('button', { name: 'Open the 3-D view' }).click();
  await anna.locator('canvas.mesh[data-ready=yes]').waitFor({ timeout: 60000 });
  await anna.locator('.mesh-place').getByRole('button', { name: 'Left', exact: true }).click();
  const share = anna.getByLabel('Share of the correction that is shown');
  const reference = anna.getByLabel('Show the reference');
  equal(await reference.isChecked(), false, 'nothing but the current surface at first');
  await share.fill('1');
  await anna.locator('canvas.mesh[data-corrected="1"]').waitFor();
  await anna.locator('canvas.mesh[data-ghost=yes]').waitFor({ timeout: 60000 });
  equal(await reference.isChecked(), true, 'the reference is beside it');
  await h.look(anna, 'mesh-corrected', { axe: false });
  await reference.uncheck();
  await anna.locator('canvas.mesh[data-ghost=""]').waitFor();
  const at = {};
  for (const part of ['0', '0.25', '0.5']) {
    await share.fill(part);
    await anna.locator(`canvas.mesh[data-corrected="${part}"]`).waitFor();
    at[part] = await middle();
  }
  const [quarter, half] = [at['0.25'] - at['0'], at['0.5'] - at['0']];
  check(half > 1.5, `half of the way moves the picture down by ${half.toFixed(1)} px`);
  check(Math.abs(quarter / half - 0.5) < 0.2, `a quarter of it by ${quarter.toFixed(1)} px`);
});

await h.step(
  'not as planned: no picture names a side of the patient, in a known room and in an unknown one',
  async () => {
  const sides = (list) => list.filter((name) => kPatients.includes(name.toLowerCase()));
  h.tell('across');
  const { id } = await scan();
  equal((await h.api(anna, `results/${id}`)).body.body.named_by, 'room',
    'the words are the room’s');
  const { found, views } = await marksOfResult('marks-room');
  equal(found[kPictures[0]].join(), 'gantry,roomMinusX,roomPlusX', 'the map');
  equal(found[kPictures[2]].join(), 'gantry,roomMinusX,roomPlusX', 'the overlay');
  // The ticks are the marker's x and y, so the marks of the room's axes say whose they are.
  equal(await anna.locator('.map-row .way[data-mark=roomPlusX]').textContent(), 'ROOM +X',
    'whose axis');
  for (const where of kPictures) equal(sides(found[where]).join(), '', where);
  equal(sides(views).join(), '', '3-D views');
  await anna.getByText('axes of the room (IEC 61217), not the patient’s sides').first().waitFor();
  h.tell('room unknown');
  await anna.goto(`${h.url}#/status`);
  await anna.reload();  // or the status might be an older one
  await anna.goto(`${h.url}#/result/${id}`);
  const unknown = await marksOfResult('marks-axes');
  equal(unknown.found[kPictures[0]].join(), 'minusX,minusY,plusX,plusY', 'the map’s own axes');
  for (const where of kPictures) equal(sides(unknown.found[where]).join(), '', where);
  equal(sides(unknown.views).join(), '', '3-D views');
  await anna.getByText('axes of the reference marker, not the patient’s sides').first().waitFor();
  check(!/gantry/i.test((await anna.locator('.map-row .ways').allInnerTexts()).join()),
    'no gantry');
  h.tell('room known');
});

await h.step('unknown, without an answer: no picture of the result names a side of the patient',
  async () => {
  h.tell('stranger');
  await scan();
  const { found, views } = await marksOfResult('marks-no-answer');
  equal(found[kPictures[0]].join(), 'gantry,roomMinusX,roomPlusX', 'the map');
  equal(await anna.getByLabel('After the correction').count(), 0, 'no map of a correction either');
  check(!views.some((name) => kPatients.includes(name.toLowerCase())), `3-D views: ${views}`);
  equal(await anna.getByLabel('Share of the correction that is shown').count(), 0,
    'no answer, no correction to show');
});

await h.step('the map of a plan names the sides that its posture has in a known room, and says so',
  async () => {
  const { body } = await h.api(bob, 'scans?limit=1');
  await bob.goto(`${h.url}#/plan/${body.scans[0].reference_id}`);
  const way = (name) => bob.locator(`.plan-grid [data-mark=${name}]`);
  await way('head').waitFor();
  equal((await marksIn(bob, '.plan-grid')).join(), 'feet,gantry,head,left,right', 'the plan');
  await bob.locator('.plan-grid').getByText('check that the patient is lying that way').waitFor();
  // On this map the gantry is on the right, so that what is to the right of who faces it is at the
  // bottom.
  const posture = bob.locator('.plan-grid').getByLabel('Posture');
  equal(await posture.inputValue(), 'HFS', 'as approved');
  for (const [name, head, left] of [['HFP', 'right', 'top'], ['FFS', 'left', 'top'],
    ['FFP', 'left', 'bottom'], ['HFS', 'right', 'bottom']]) {
    await posture.selectOption(name);
    const at = {};
    for (const mark of ['head', 'feet', 'left', 'right', 'gantry']) {
      at[mark] = await way(mark).boundingBox();
    }
    check(at.gantry.x > Math.max(at.left.x, at.right.x), `${name}: the gantry is on the right`);
    equal(at.head.x > at.feet.x ? 'right' : 'left', head, `${name}: the head`);
    equal(at.left.y > at.right.y ? 'bottom' : 'top', left, `${name}: the left side`);
  }
  await h.look(bob, 'marks-plan', { axe: false });
  // Its marker lay turned by 90 degrees, and so the room does on its map.
  h.tell('room turned');
  await bob.reload();
  await way('head').waitFor();
  const turned = {};
  for (const mark of ['head', 'feet', 'left', 'right', 'gantry']) {
    turned[mark] = await way(mark).boundingBox();
  }
  check(turned.gantry.y < turned.head.y && turned.head.y < turned.feet.y,
    'the gantry and the head are at the top of the map');
  check(turned.left.x > turned.right.x, 'the left side is on the right of the map');
  h.tell('room unknown');
  await bob.reload();  // or the status might be an older one
  await way('plusY').waitFor();
  equal((await marksIn(bob, '.plan-grid')).join(), 'minusX,minusY,plusX,plusY',
    'nobody knows the room');
  h.tell('room known');
});

await h.step('during a sweep for a fraction the growing map names the sides of the planned posture',
  async () => {
  h.tell('slow');
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await anna.locator('.live-surface [data-mark=head]').waitFor();
  equal((await marksIn(anna, '.live-surface')).join(), 'feet,gantry,head,left,right',
    'the map that grows');
  await anna.locator('.live-surface')
    .getByText('check that the patient is lying that way').waitFor();
  await h.look(anna, 'marks-live', { axe: false });
  h.tell('fast');
  await anna.waitForURL(/#\/result/, { timeout: 60000 });
});

await h.step('a wrong reference is NO ANSWER with its reason, and nothing to apply', async () => {
  h.tell('stranger');
  const shown = await scan();
  await anna.locator('.verdict.no_answer').waitFor();
  check((await anna.locator('.verdict').innerText()).includes('NO ANSWER'), 'the verdict');
  check(/does not look like this reference/.test(await anna.locator('.verdict .why').innerText()),
    await anna.locator('.verdict .why').innerText());
  equal(await anna.locator('.number').count(), 0, 'no numbers');
  equal(await anna.locator('.correction').count(), 0, 'no correction');
  equal(await anna.locator('.body-words').count(), 0, 'no posture');
  equal(await anna.getByRole('button', { name: 'Accept' }).count(), 0, 'nothing to accept');
  check(!/Apply (?!nothing)/.test(await anna.locator('main').innerText()),
    'nothing is to be applied');
  await h.look(anna, 'result-wrong-reference', { axe: false });
  await anna.goto(`${h.url}result?scan=${shown.id}`);
  await anna.getByText('NO ANSWER').waitFor();
  equal(await anna.locator('table').count(), 0, 'no numbers in print either');
});

await h.step('a marker that was moved is named, and not used', async () => {
  h.tell('shifted');
  await scan();
  await anna.locator('.number').first().waitFor();
  const ignored = anna.locator('.trust > div',
    { hasText: 'Marker 3 was ignored: it moved 12 mm.' });
  await ignored.waitFor();
  await h.look(anna, 'result-marker-moved', { axe: false });
  h.tell('moved z 8 HFS');
  await scan();
  await anna.locator('.trust').waitFor();
  equal(await ignored.count(), 0, 'where none was moved none is named');
});

await h.step('a hole in the region is NO ANSWER that says where, and the map is there and marks it',
  async () => {
  h.tell('hole');
  await scan();
  await anna.locator('.verdict.no_answer').waitFor();
  check(/hole of 1\d\d mm in the region \([a-z ]+\); at most 50 mm are allowed; sweep over it/
    .test(await anna.locator('.verdict').innerText()), await anna.locator('.verdict').innerText());
  equal(await anna.locator('.number').count(), 0, 'no numbers');
  await anna.locator('.reading', { hasText: 'hole in the region' }).waitFor();
  await anna.locator('.trust > div.caution', { hasText: 'Largest hole' }).waitFor();
  await h.look(anna, 'result-hole', { axe: false });
});

await h.step('a direction that the surface hardly determines says so on its card', async () => {
  h.tell('weak');
  await scan();
  const card = (name) =>
    anna.locator('.number', { has: anna.getByRole('heading', { name, exact: true }) });
  await card('Roll').getByText('uncertain direction').waitFor();
  equal(await anna.locator('.number', { hasText: 'uncertain direction' }).count(), 1,
    'only that one');
});

await h.step(
  'a cold sensor and lost frames are said beside the verdict; a cold sensor takes no reference',
  async () => {
  const flags = anna.locator('.verdict .flags li');
  h.tell('checked');
  h.tell('hurried');
  await scan();
  await flags.getByText('33 % of the frames were lost').waitFor();
  // With more than half of the frames lost, the scan cannot be accepted, even with a reason.
  h.tell('halflost');
  await scan();
  await anna.locator('.acceptance').getByRole('button').or(
    anna.locator('.accept-outside')).first().waitFor();
  h.tell('mostlost');
  const lost = await scan();
  await anna.getByText('50.3 % of the frames were lost, more than 50 %').waitFor();
  equal(await anna.locator('.acceptance button, .accept-outside').count(), 0, 'no way to accept');
  await h.look(anna, 'lost-frames', { axe: false });
  equal((await h.api(anna, `scans/${lost.id}/accept`, 'POST')).status, 409, 'nor by the interface');
  equal((await h.api(anna, `scans/${lost.id}/accept-outside`, 'POST',
    { reason: 'nevertheless', password: h.password })).status, 409, 'nor with a reason');
  h.tell('cold');
  await scan();
  await flags.getByText('The sensor had been on for only 17 min').waitFor();
  const { body: { session } } = await h.api(anna, 'status');
  await anna.goto(`${h.url}#/patient/${session.patient_id}`);
  await anna.getByText('The sensor is still warming up').waitFor();
  equal(
    await anna.getByRole('button', { name: 'Scan a new reference' }).getAttribute('aria-disabled'),
    'true', 'blocked');
  equal(await anna.locator('.reference-block a').count(), 0, 'a daily check would not help');
  equal((await h.api(anna, `patients/${session.patient_id}/open`, 'POST',
    { purpose: 'reference', reason: 'colder', replaces: session.id })).status, 409,
    'the interface refuses too');
  await h.look(anna, 'patient-cold', { axe: false });
  // The time is the one that is configured: here 20 min.
  await anna.goto(`${h.url}#/status`);
  await anna.getByText('during the first 20 min.').waitFor();
  h.tell('warm');
  await anna.getByText('during the first 20 min.').waitFor({ state: 'detached' });
  h.tell('cold');
  await anna.goBack();
  await anna.getByText('The sensor is still warming up').waitFor();
  h.tell('warm');
  await anna.getByText('The sensor is still warming up').waitFor({ state: 'detached' });
  await scan();
  equal(await flags.count(), 0, 'warm, and no frames lost');
});

await h.step('what is doubtful about a reference is told to who can scan again, and its approval '
  + 'needs a reason', async () => {
  const open = async (patient, purpose) => {
    const { body: { session } } = await h.api(anna, 'status');
    equal((await h.api(anna, `patients/${patient}/open`, 'POST',
      { purpose, reason: '', replaces: session.id })).status, 200, 'opened');
    await h.acknowledge(anna);
  };
  const { body: { session: { patient_id: before } } } = await h.api(anna, 'status');
  const { body: { id: patient } } = await h.api(anna, 'patients', 'POST',
    { code: 'PX-0077', site: '' });
  h.tell('checked');
  await open(patient, 'reference');
  h.tell('hurried');
  await scan();
  await anna.locator('.verdict .flags').getByText('33 % of the frames were lost').waitFor();
  await anna.getByText('Scan again now, while the patient is here').waitFor();
  equal(await anna.getByRole('button', { name: 'Scan again' }).getAttribute('class'), 'primary',
    'first of all');
  await h.look(anna, 'reference-flags', { axe: false });
  const { body: { references } } = await h.api(bob, `patients/${patient}/references`);
  const [{ id, plan }] = references;
  // In a calibrated room a plan begins with its lasers.
  h.tell('room lasers');
  await bob.goto(`${h.url}#/plan/${id}`);
  await bob.getByText('The isocentre of this draft is where the lasers').waitFor();
  equal(await bob.getByLabel('Isocentre x (mm)').inputValue(), '610', 'where they cross');
  await bob.locator('.side-view').first().waitFor();
  await h.look(bob, 'plan-lasers', { axe: false });
  h.tell('room known');
  equal((await h.api(bob, `references/${id}/plan`, 'PUT', { region_m: plan.region_m,
    isocentre_m: null, posture: 'HFS', couch_markers: false, shift_tolerance_mm: 3,
    rotation_tolerance_deg: 1, revision: 1 })).status, 200, 'planned');
  const { body: { digest, revision } } = await h.api(clara, `references/${id}`);
  equal((await h.api(clara, `references/${id}/approve`, 'POST',
    { digest, revision, password: h.password })).status, 409, 'no reason, no approval');
  // A posture that the surface speaks against needs a tick of its own, for the interface as well.
  h.tell('room contradicts');
  const reasoned = { digest, revision, password: h.password, reason: 'the patient has left' };
  for (const more of [{}, { posture_confirmed: false }]) {
    equal((await h.api(clara, `references/${id}/approve`, 'POST', { ...reasoned, ...more })).status,
      409, 'the posture is not confirmed');
  }
  await clara.goto(`${h.url}#/plan/${id}`);
  await clara.getByRole('button', { name: 'Review and approve' }).click();
  await clara.getByText('The surface speaks against this posture').waitFor();
  await clara.getByLabel('Why it becomes the reference nevertheless').fill('the patient has left');
  await h.sign(clara);
  equal(await clara.getByText('approved by clara').count(), 0, 'not without the tick');
  await clara.getByLabel('the planned posture is right').check();
  await h.look(clara, 'approve-flags', { axe: false });
  await h.sign(clara);
  await clara.getByText('approved by clara').waitFor();
  h.tell('room known');
  await open(before, 'fraction');
});

await h.step('a full disk is a fault that says what to do; the approved reference is still there',
  async () => {
  h.tell('full');
  await anna.goto(`${h.url}#/scan`);
  await anna.locator('.headline', { hasText: 'Fault' }).waitFor();
  equal(await anna.locator('.guidance').innerText(),
    'The disk is full: 90 MB are free, a scan may need 700; remove scans that are no longer '
      + 'needed. Nothing can be scanned until this is fixed.', 'what is wrong and what to do');
  equal(await anna.locator('.giant').getAttribute('aria-disabled'), 'true', 'nothing to start');
  const { body: { session } } = await h.api(anna, 'status');
  await anna.goto(`${h.url}#/patient/${session.patient_id}`);
  await anna.getByText('approved by clara').waitFor();
  h.tell('emptied');
  await anna.goto(`${h.url}#/scan`);
  await anna.locator('.headline', { hasText: 'Ready' }).waitFor();
});

await h.step('during a sweep no update is installed', async () => {
  h.tell('slow');
  await anna.getByRole('button', { name: 'Start sweep' }).click();
  await anna.getByRole('button', { name: 'End sweep' }).waitFor();
  await engineer.goto(`${h.url}#/update`);
  await engineer.getByRole('button', { name: 'Install plumb-0.2.0.raucb' }).click();
  await engineer.getByRole('alert').getByText('A scan is running').waitFor();
  equal((await h.api(anna, 'status')).body.state, 'scanning', 'the sweep goes on');
  await anna.getByRole('button', { name: 'Discard scan' }).click();
  await anna.locator('.headline', { hasText: 'Ready' }).waitFor();
  await h.setClockOn(anna, 2);  // a tap right after the button changed is ignored
  h.tell('swift');
});

await h.step('a result that grows old on the screen turns grey and says so', async () => {
  h.tell('moved z 8 HFS');
  await scan();
  const colour = () =>
    anna.locator('.fresh').evaluate((element) => getComputedStyle(element).filter);
  equal(await anna.locator('.is-old').count(), 0, 'fresh for 2 minutes');
  equal(await colour(), 'none', 'in colour');
  await h.sleep(anna, 100);
  await anna.locator('.identity', { hasText: /1\d\d s/ }).waitFor();
  equal(await anna.locator('.old-note', { hasText: 'OLD' }).count(), 0, 'not yet');
  await h.setClockOn(anna, 30);
  await anna.locator('.old-note', { hasText: 'OLD' }).waitFor();
  await anna.getByText('Do not act on it').waitFor();
  equal(await anna.locator('.is-old').count(), 1, 'marked as old');
  equal(await colour(), 'grayscale(1)', 'grey');
  await h.look(anna, 'result-grown-old', { axe: false });
  await h.setClockOn(anna, -3600);
  await h.ticks(anna);
  check(!/-\d+ (s|min)/.test(await anna.locator('.identity').innerText()),
    'a clock that is set back makes no age negative');
});

await h.step('a result that was missed without a connection is shown as soon as there is one',
  async () => {
  const vertical = anna.locator('.number',
    { has: anna.getByRole('heading', { name: 'Vertical', exact: true }) }).locator('.value');
  check((await vertical.innerText()).startsWith('−8.0'),
    'the older result, while there is no connection');
  h.tell('moved z -8 HFS');
  const { body: { last_result: before } } = await h.api(bob, 'status');
  equal((await h.api(bob, 'scan/start', 'POST')).status, 200, 'another screen starts');
  await bob.waitForFunction((id) => fetch('/api/v1/status')
    .then((response) => response.json()).then((status) => status.last_result.id !== id), before.id,
    { timeout: 30000, polling: 500 });
  check((await vertical.innerText()).startsWith('−8.0'), 'nothing has come');
  await h.wake(anna);
  await vertical.getByText('+8.0').waitFor();
  equal(await anna.locator('.is-old').count(), 0, 'and it is fresh');
});

await h.step('a stream that says nothing any more is no connection, and a result that nobody can '
  + 'know to be valid commands nothing', async () => {
  const commands = async () => [await anna.locator('.number .arrow').count(),
    await anna.getByText('Accept outside tolerance…').count()].join();
  equal(await commands(), '1,1', 'an arrow, and the way to accept it');
  h.server.kill('SIGSTOP');
  try {
    await h.setClockOn(anna, 1);
    await h.ticks(anna);
    equal(await anna.getByText('No connection to the appliance').count(), 0, 'beats may be late');
    await h.setClockOn(anna, 5);
    await anna.getByRole('alert').getByText('No connection to the appliance').waitFor();
    check(/^Last known: Result, \d+ s ago$/.test(await anna.locator('.chip').innerText()),
      'and above');
    await anna.locator('.old-note', { hasText: 'NO CONNECTION' }).waitFor();
    equal(await anna.locator('.is-old').count(), 1, 'grey');
    equal(await commands(), '0,0', 'neither an arrow nor a way to accept it');
  } finally {
    h.server.kill('SIGCONT');
  }
  await anna.locator('.is-old').waitFor({ state: 'detached' });
  equal(await commands(), '1,1', 'again');
  await anna.getByText('No connection to the appliance').first().waitFor({ state: 'detached' });
  await anna.locator('.chip', { hasText: 'Result' }).waitFor();
});

await h.step(
  'who logs out without a connection sees no patient any more, and is logged out once there is one',
  async () => {
  await h.sleep(anna, 0);
  await anna.getByRole('button', { name: 'Log out' }).click();
  await anna.getByText('You will be logged out as soon as it answers.').waitFor();
  equal(await anna.locator('.identity').count(), 0, 'no result');
  equal(await anna.getByRole('navigation').count(), 0, 'no way to one');
  await h.wake(anna);
  await anna.getByRole('heading', { name: 'Log in' }).waitFor();
  equal(await anna.evaluate(() => fetch('/api/v1/status').then((response) => response.status)), 401,
    'nothing without login');
  await h.logIn(anna, 'anna');
});

await h.step('scan again leads to the sweep only in the session of the same patient and purpose, '
  + 'else to where that is confirmed', async () => {
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'PX-0001' }).click();
  // In place of an approved one it takes a reason.
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await anna.getByRole('alert').getByText('State why a new reference is to replace').waitFor();
  equal((await h.api(anna, 'status')).body.session.purpose, 'fraction', 'nothing was opened');
  await anna.getByLabel('Reason for the new reference').fill('weight loss');
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await anna.locator('.who-line', { hasText: 'New reference' }).waitFor();
  const again = anna.getByRole('button', { name: 'Scan again' });
  const { session: { patient_id: patient } } = (await h.api(anna, 'status')).body;
  /// At the result of that scan, or at the newest.
  const scanAgain = async (id = '') => {
    await anna.goto(`${h.url}#/result/${id}`);
    await anna.locator('.verdict').waitFor();
    await again.click();
    await anna.waitForURL(/#\/(scan|patient\/.*)$/);
    return { at: new URL(anna.url()).hash, session: (await h.api(anna, 'status')).body.session };
  };
  let found = await scanAgain();  // of a fraction, while a reference is to be scanned
  equal(found.at, `#/patient/${patient}`, 'to the patient');
  equal(found.session.purpose, 'reference', 'nothing was opened');
  await anna.getByText('Confirm: PX-0001 is on the couch').waitFor();
  await anna.getByRole('button', { name: /^Start (treatment session|a new fraction)$/ }).click();
  await anna.locator('.who-line', { hasText: /PX-0001\s*Fraction/ }).waitFor();
  equal((await scanAgain()).at, '#/scan', 'in its own session to the sweep');
  const { scans } = (await h.api(anna, `patients/${patient}/scans`)).body;
  found = await scanAgain(scans.find(({ purpose }) => purpose === 'reference').id);
  equal(found.at, `#/patient/${patient}`,
    'of a reference to the patient, where its reason is asked');
  equal(found.session.purpose, 'fraction', 'no reference was opened');
  await anna.getByRole('button', { name: 'Close session' }).click();
  await anna.getByText('The session is closed.').waitFor();  // nothing was scanned in it
  found = await scanAgain();
  equal(found.at, `#/patient/${patient}`, 'without a session to the patient');
  equal(found.session, null, 'still none');
  await anna.getByRole('button', { name: 'Start treatment session' }).click();
  await anna.locator('.who-line', { hasText: /PX-0001\s*Fraction/ }).waitFor();
});

await h.step('two at one plan: neither saves over or approves what they have not seen',
  async () => {
  const shift = (page) => page.getByLabel('Shifts (mm)');
  /// Until the plan is drawn again: what is typed before would be lost.
  const save = async (page) => {
    const field = await shift(page).elementHandle();
    await page.getByRole('button', { name: 'Save plan' }).click();
    await page.waitForFunction((one) => !one.isConnected, field);
  };
  await bob.goto(
    `${h.url}#/plan/${(await h.api(anna, 'scans?limit=1')).body.scans[0].reference_id}`);
  await shift(bob).fill('4');
  await save(bob);  // of an approved one: a new version
  await bob.getByRole('heading', { name: 'Reference 2' }).waitFor();
  await clara.goto(bob.url());
  await clara.getByRole('heading', { name: 'Reference 2' }).waitFor();
  await shift(bob).fill('5');
  await save(bob);
  await clara.getByRole('status').getByText('this is what is stored now').waitFor();
  equal(await shift(clara).inputValue(), '5', 'a field that was not edited is loaded again');
  await clara.getByLabel('Rotations (degrees)').fill('2');
  await shift(bob).fill('6');
  await save(bob);
  await clara.getByRole('alert').getByText('while you were editing it').waitFor();
  equal(await shift(clara).inputValue(), '5', 'what is edited stays');
  await save(clara);
  await clara.getByRole('alert').getByText('Someone else has changed the plan').waitFor();
  equal(await shift(clara).inputValue(), '6', 'what is stored');
  equal(await clara.getByLabel('Rotations (degrees)').inputValue(), '1',
    'nothing of what was refused');
  // As an approval that was on its way while bob saved.
  const { reference, plan } = await clara.evaluate(() =>
    fetch(`/api/v1/references/${location.hash.split('/')[2]}`).then((response) => response.json()))
    .then(({ plan: stored, ...rest }) => ({ reference: rest, plan: stored }));
  await clara.route('**/approve', async (route) => {
    const { region_m, isocentre_m, posture, couch_markers } = plan;
    equal((await h.api(bob, `references/${reference.id}/plan`, 'PUT',
      { region_m, isocentre_m, posture, couch_markers, shift_tolerance_mm: 7,
        rotation_tolerance_deg: 1, revision: reference.revision })).status, 200, 'bob saves');
    await route.continue();
  });
  await clara.getByRole('button', { name: 'Review and approve' }).click();
  await h.sign(clara);
  await clara.getByRole('alert').getByText('Someone else has changed the plan').waitFor();
  equal(await shift(clara).inputValue(), '7', 'what would have been approved unseen');
  await clara.getByText('draft').waitFor();
  await h.look(clara, 'plan-changed');
});

await h.step('two at one note: neither saves over what they have not seen', async () => {
  const path = 'patients/p0001';
  await anna.goto(`${h.url}#/patient/p0001`);
  const note = anna.getByLabel('Note', { exact: true });
  await note.waitFor();
  // As if bob had just saved, and the page had not been notified yet.
  const requests = `**/api/v1/${path}`;
  await anna.route(requests,
    (route) => (route.request().method() === 'GET' ? route.abort() : route.continue()));
  const { site } = (await h.api(bob, path)).body;
  const [, saved] =
    await Promise.all([anna.waitForEvent('requestfailed', (one) => one.url().endsWith(path)),
      h.api(bob, path, 'PUT', { site, note: 'arms up' })]);
  equal(saved.status, 200, 'bob saves');
  await anna.unroute(requests);
  await note.fill('knee rest');
  const save = anna.locator('section', { has: note }).getByRole('button', { name: 'Save' });
  await save.click();
  await anna.getByRole('alert')
    .getByText('This patient was changed by somebody else meanwhile').waitFor();
  equal(await note.inputValue(), 'arms up', 'what is stored');
  await note.fill('arms up, knee rest');
  await save.click();
  await anna.getByRole('status').getByText('Saved.').waitFor({ state: 'attached' });
  equal((await h.api(bob, path)).body.note, 'arms up, knee rest', 'what was seen and changed');
});

await h.step('buttons are large enough for hands in gloves', async () => {
  for (const screen of ['status', 'patients', 'scan', 'result', 'check']) {
    await anna.goto(`${h.url}#/${screen}`);
    await anna.locator('main button, main a.button').first().waitFor();
    const small = await anna.locator('main button:not(.quiet), main a.button').evaluateAll(
      (buttons) => buttons.filter((one) => one.checkVisibility()
        && one.getBoundingClientRect().height < 48).map((one) => one.textContent));
    equal(small.join(), '', `smaller than 48 px on ${screen}`);
  }
});

await h.step('what a form does not accept is said at its field, in the language of the page',
  async () => {
  const speak = async (code) => {
    await anna.evaluate((language) => {
      localStorage.setItem('plumb-language-anna', language);
      window.dispatchEvent(new Event('plumb-language'));
    }, code);
    await anna.locator(`html[lang=${code}]`).waitFor();
  };
  await anna.goto(`${h.url}#/patients`);
  for (const [language, empty, wrong] of [
    ['de', 'Dieses Feld ist leer.', 'Nur Buchstaben ohne Umlaute'],
    ['es', 'Este campo está vacío.', 'Solo letras sin acentos'],
    ['fr', 'Ce champ est vide.', 'Seulement des lettres sans accents'],
    ['en', 'This field is empty.', 'Only letters, digits']]) {
    await speak(language);
    const add = anna.locator('form', { has: anna.locator('[data-code]') });
    const code = add.locator('[data-code]');
    const error = add.locator('.field', { has: anna.locator('[data-code]') })
      .locator('.field-error');
    await add.locator('button').click();
    await error.getByText(empty).waitFor();
    check(await code.evaluate((one) => one === document.activeElement), 'it has the focus');
    await code.fill('José');
    equal(await error.count(), 0, 'it is being corrected');
    await add.locator('button').click();
    await error.getByText(wrong).waitFor();
    equal(await code.getAttribute('aria-invalid'), 'true', 'for readers of screens, too');
    const described = (await code.getAttribute('aria-describedby')).split(' ');
    equal(described[0], await error.getAttribute('id'), 'and read with it');
    await h.look(anna, `field-error-${language}`, { axe: language === 'en' });
    await code.fill('');
    equal(await code.getAttribute('aria-invalid'), null, 'no longer');
  }
  equal((await h.api(anna, 'patients')).body.patients.some(({ code }) => code === 'José'), false,
    'no patient was added');
  await engineer.goto(`${h.url}#/settings`);
  const limit = engineer.getByLabel('Longest sweep (s)');
  await limit.fill('601');
  await engineer.getByRole('button', { name: 'Save', exact: true }).click();
  const saidOfLimit = (words) => engineer.locator('.field', { hasText: 'Longest sweep (s)' })
    .getByText(words).waitFor();
  const save = engineer.getByRole('button', { name: 'Save', exact: true });
  await saidOfLimit('From 5 to 600.');
  await limit.fill('60.5');
  await save.click();
  await saidOfLimit('In steps of 1.');
  await limit.fill('');
  await limit.pressSequentially('1e');
  await save.click();
  await saidOfLimit('This is not a number.');
  await limit.fill('');
  await save.click();
  await saidOfLimit('This field is empty.');
  await engineer.reload();
});

await h.step('what is stored between the steps or beyond the bounds of a field holds nothing up',
  async () => {
    const before = (await h.api(engineer, 'settings')).body;
    await h.api(engineer, 'settings', 'PUT', { auto_stop_s: 12.5 });
    const pause = engineer.getByLabel('Stop a sweep after');
    const save = engineer.getByRole('button', { name: 'Save', exact: true });
    const limit = engineer.getByLabel('Longest sweep (s)');
    let shown = null;  // such as plumb.toml may state; no person can enter it
    await engineer.route('**/api/v1/settings', async (route) => {
      if (route.request().method() !== 'GET' || shown === null) return route.continue();
      const response = await route.fetch();
      const json = { ...await response.json(), auto_stop_s: shown };
      return route.fulfill({ response, json });
    });
    for (const [stored, sweep] of [[12.5, '61'], [0.5, '62']]) {
      shown = stored;
      await engineer.goto(`${h.url}#/status`);
      await engineer.goto(`${h.url}#/settings`);
      await limit.waitFor();
      equal(await pause.inputValue(), `${stored}`, 'what is stored');
      await limit.fill(sweep);
      await save.click();
      await engineer.getByRole('status').getByText('Saved').waitFor();
      shown = null;
      const now = (await h.api(engineer, 'settings')).body;
      equal(`${now.scan_limit_s}`, sweep, 'the other setting');
      equal(now.auto_stop_s, 12.5, 'nobody has changed it');
    }
    await engineer.unrouteAll({ behavior: 'wait' });
    await h.api(engineer, 'settings', 'PUT',
      { auto_stop_s: before.auto_stop_s, scan_limit_s: before.scan_limit_s });
  });

await h.step('half an isocentre is refused at its field', async () => {
  for (const axis of ['x', 'y', 'z']) await clara.getByLabel(`Isocentre ${axis}`).fill('');
  await clara.getByLabel('Isocentre x').fill('500');
  await clara.getByRole('button', { name: 'Save plan' }).click();
  await clara.getByText('Three numbers in millimetres, or all three empty.').waitFor();
  equal(await clara.getByLabel('Isocentre y').getAttribute('aria-invalid'), 'true', 'the field');
  equal(await clara.getByLabel('Isocentre x').inputValue(), '500', 'what was typed stays');
  await h.look(clara, 'plan-half-isocentre');
  await clara.getByLabel('Isocentre y').fill('400');
  await clara.getByLabel('Isocentre z').pressSequentially('1e');
  await clara.getByRole('button', { name: 'Save plan' }).click();
  await clara.getByText('Three numbers in millimetres, or all three empty.').waitFor();
  equal(await clara.getByLabel('Isocentre z').getAttribute('aria-invalid'), 'true',
    'what is not a number');
  for (const axis of ['x', 'y', 'z']) await clara.getByLabel(`Isocentre ${axis}`).fill('');
  await clara.getByRole('button', { name: 'Save plan' }).click();
  await clara.getByRole('status').getByText('Plan saved.').waitFor();
});

await h.step('an isocentre is in millimetres, seen from the side, and where it is implausible '
  + 'confirmed or refused', async () => {
  const fill = async (...point) => {
    for (const [i, axis] of ['x', 'y', 'z'].entries()) {
      await clara.getByLabel(`Isocentre ${axis} (mm)`).fill(`${point[i]}`);
    }
  };
  const doubt = clara.locator('.isocentre-doubt');
  const save = clara.getByRole('button', { name: 'Save plan' });
  // Of each marker it is said where it lies; the middle of the first one is taken.
  const markers = clara.getByLabel('Marker at the lasers');
  const [first] = await markers.locator('option').allInnerTexts();
  const [, x, y] = /^Marker \d+: x (−?\d+), y (−?\d+) mm$/.exec(first) ?? [];
  await clara.getByRole('button', { name: 'Use its centre' }).click();
  for (const [axis, value] of [['x', x], ['y', y]]) {
    const taken = await clara.getByLabel(`Isocentre ${axis} (mm)`).inputValue();
    check(Math.abs(Number(taken) - Number(value.replace('−', '-'))) <= 0.5,
      `${axis} of ${first}: ${taken}`);
  }
  await fill(600, 450, 40);  // in the middle of the body
  equal(await clara.locator('.side-view').count(), 2, 'two sections');
  equal(await doubt.count(), 0, 'nothing to doubt');
  await h.look(clara, 'plan-side', { axe: false });
  await fill(600, 450, 900);  // 9 cm, typed as something else
  await doubt.getByText('probably a wrong unit').waitFor();
  await save.click();
  await clara.getByRole('alert').getByText('probably a wrong unit').waitFor();
  await fill(600, 450, 300);
  await doubt.getByText(/^The isocentre lies \d+ mm above the skin\.$/).waitFor();
  await save.click();
  await clara.getByRole('alert').getByText('confirm that it is meant to lie there').waitFor();
  await clara.getByLabel('It is meant to lie there').check();
  await save.click();
  await clara.getByRole('status').getByText('Plan saved.').waitFor();
  const where = `references/${new URL(clara.url()).hash.split('/')[2]}`;
  equal(JSON.stringify((await h.api(clara, where)).body.plan.isocentre_m), '[0.6,0.45,0.3]',
    'stored in metres');
  for (const axis of ['x', 'y', 'z']) await clara.getByLabel(`Isocentre ${axis}`).fill('');
  await save.click();
  await clara.getByRole('status').getByText('Plan saved.').waitFor();
});

await h.step('an account: only what was changed is sent', async () => {
  await engineer.goto(`${h.url}#/users`);
  await h.addAccount(engineer, 'dora', 'technician');
  const row = engineer.getByRole('row', { name: 'dora' });
  await row.getByText('Change', { exact: true }).click();
  await row.getByLabel('Your password').fill(h.password);
  await row.getByRole('button', { name: 'Save' }).click();
  await engineer.getByRole('alert').getByText('Nothing was changed.').waitFor();
  await row.getByLabel('Disabled').check();
  const [request] = await Promise.all([engineer.waitForRequest((one) => one.method() === 'PUT'),
    row.getByRole('button', { name: 'Save' }).click()]);
  equal(request.postData(), `{"disabled":true,"own_password":"${h.password}"}`, 'what is sent');
  await row.getByText('disabled', { exact: true }).waitFor();
});

/// What an authenticator shows: RFC 6238 by the browser's own crypto library.
const totp = (secret, step) => engineer.evaluate(async ([base32, counter]) => {
  const letters = 'ABCDEFGHIJKLMNOPQRSTUVWXYZ234567';
  const bits = [...base32].map((one) => letters.indexOf(one).toString(2).padStart(5, '0')).join('');
  const key = new Uint8Array(bits.match(/.{8}/g).map((one) => parseInt(one, 2)));
  const hmac = await crypto.subtle.importKey('raw', key, { name: 'HMAC', hash: 'SHA-1' }, false,
    ['sign']);
  const message = new DataView(new ArrayBuffer(8));
  message.setUint32(4, counter);
  const digest = new DataView(await crypto.subtle.sign('HMAC', hmac, message.buffer));
  const number = digest.getUint32(digest.getUint8(19) & 15) & 0x7fffffff;
  return String(number % 1000000).padStart(6, '0');
}, [secret, step]);

await h.step('an authenticator is set up, asked for at log-in and signature, and removed',
  async () => {
  const now = () => Math.floor(Date.now() / 30000);
  await bob.goto(`${h.url}#/users`);
  const part = (name) => bob.locator('section', { has: bob.getByRole('heading', { name }) });
  const own = part('My authenticator');
  await own.getByLabel('Your password').fill(h.password);
  await own.getByRole('button', { name: 'Set up an authenticator' }).click();
  const secret = await own.locator('.secret').innerText();
  const uri = `otpauth://totp/Plumb:bob?secret=${secret}`;
  check((await own.innerText()).includes(uri), 'the address');
  await own.getByLabel('Code that the authenticator now shows').fill(await totp(secret, now() - 1));
  await own.getByRole('button', { name: 'Finish' }).click();
  await own.locator('.recovery li').first().waitFor();
  const codes = await own.locator('.recovery li').allInnerTexts();
  equal(codes.length, 10, 'recovery codes');
  const elsewhere = await h.person('bob elsewhere');
  await elsewhere.goto(h.url);
  await elsewhere.getByLabel('Name').fill('bob');
  await elsewhere.getByLabel('Password').fill(h.password);
  await elsewhere.getByRole('button', { name: 'Log in' }).click();
  await elsewhere.getByLabel('Code of your authenticator').fill(codes[0]);
  await elsewhere.getByRole('button', { name: 'Log in' }).click();
  await elsewhere.getByRole('navigation').waitFor();
  await bob.reload();
  const sessions = part('My log-ins');
  await sessions.getByText('this one').waitFor();
  equal(await sessions.locator('tbody tr').count(), 2, 'where he is logged in');
  await h.look(bob, 'own-account');
  await sessions.getByRole('button', { name: 'End all others' }).click();
  await elsewhere.getByRole('button', { name: 'Log in' }).waitFor();
  await elsewhere.context().close();
  await own.getByLabel('Your password').fill(h.password);
  await own.getByLabel('Code of your authenticator').fill(codes[1]);
  await own.getByRole('button', { name: 'Remove the authenticator' }).click();
  await own.getByText('Not set up.').waitFor();
});

await h.step('the wrong patient: both codes are on the screen', async () => {
  h.tell('moved z 8 HFS');
  const last = await scan();
  await addPatient('PX-0002');
  await anna.getByText('Confirm: PX-0002 is on the couch').waitFor();
  equal(await anna.getByRole('button', { name: 'Start treatment session' }).isDisabled(), true,
    'no fraction without a reference of its own');
  await anna.getByRole('button', { name: 'Scan a new reference' }).click();
  await anna.getByRole('button', { name: 'Close PX-0001, open PX-0002' }).click();
  // The scan screen names who is open.
  await anna.locator('.who-line', { hasText: 'PX-0002' }).waitFor();
  await anna.goto(`${h.url}#/result/${last.id}`);
  await anna.getByText('The session of another patient (PX-0002) is open').waitFor();
  check((await anna.locator('.identity').innerText()).includes('PX-0001'),
    'the result names whose it is');
  // A minute old, but of somebody who is not on the couch any more: nothing of it is to be applied.
  await anna.goto(`${h.url}#/result`);
  await anna.getByText('SESSION NOT OPEN').waitFor();
  await anna.locator('.verdict', { hasText: 'WAS OUTSIDE TOLERANCE' }).waitFor();
  equal(await anna.locator('.number .arrow').count(), 0, 'no arrow');
  equal(await anna.getByText('Accept outside tolerance').count(), 0, 'nothing to accept');
  await h.look(anna, 'result-other-session');
});

await h.step('three roles: what a screen hides the interface refuses', async () => {
  const scans = (await h.api(anna, 'scans?limit=1')).body.scans;
  const user = { name: 'mallory', role: 'engineer', password: 'correct horse battery' };
  const plan = ['PUT', 'references/r0001/plan', { region_m: [], isocentre_m: null,
    shift_tolerance_mm: 3, rotation_tolerance_deg: 1, posture: 'HFS', couch_markers: false }];
  const kRefused = [
    [anna, ['GET', 'users'], ['POST', 'users', user], ['GET', 'audit'], plan,
      ['POST', 'references/r0001/approve'],
      ['POST', 'references', { scan_id: scans[0].id, reason: '' }], ['DELETE', 'patients/p0001'],
      ['POST', 'update', { bundle: 'plumb-0.2.0.raucb' }], ['POST', 'diagnostics']],
    [bob, ['GET', 'users'], ['POST', 'users', user],
      ['POST', 'update', { bundle: 'plumb-0.2.0.raucb' }], ['POST', 'diagnostics']],
    [engineer, ['POST', 'patients', { code: 'PX-1', site: '' }], plan,
      ['POST', 'references/r0001/approve'], ['POST', `scans/${scans[0].id}/accept`],
      ['DELETE', 'patients/p0001']],
  ];
  for (const [page, ...calls] of kRefused) {
    for (const [method, path, body] of calls) {
      equal((await h.api(page, path, method, body)).status, 403, `${method} ${path}`);
    }
  }
  for (const [page, allowed] of [[anna, ['Status', 'Patients', 'Scan', 'Result']],
    [bob, ['Audit log']], [engineer, ['Audit log', 'Settings', 'Update']]]) {
    for (const name of allowed) {
      equal(await page.getByRole('navigation').getByRole('link', { name, exact: true }).count(), 1,
        `${name} is offered`);
    }
  }
  for (const [page, hidden] of [[anna, 'Install'], [bob, 'Install'],
    [anna, 'Download diagnostics']]) {
    await page.goto(`${h.url}#/update`);
    await page.getByText('Installed version').waitFor();
    equal(await page.getByRole('button', { name: hidden }).count(), 0, `${hidden} is not offered`);
  }
});

await h.step('no check today: no new reference, and a fraction is marked in the history',
  async () => {
  const patient =
    (await h.api(anna, 'patients')).body.patients.find(({ code }) => code === 'PX-0001');
  const marked = () => anna.locator('.badge.overdue').count();
  h.tell('checked');
  await anna.goto(`${h.url}#/patient/${patient.id}`);
  await anna.getByRole('button', { name: 'Scan a new reference' }).waitFor();
  equal(
    await anna.getByRole('button', { name: 'Scan a new reference' }).getAttribute('aria-disabled'),
    null, 'after the check');
  const before = await marked();
  await anna.getByRole('button', { name: 'Start a new fraction' }).click();
  await anna.getByRole('button', { name: /^Close PX-0002/ }).click();
  await anna.locator('.who-line', { hasText: 'PX-0001' }).waitFor();
  await scan();
  h.tell('overdue');
  await scan();
  await anna.getByText('The daily check was overdue at this scan.').waitFor();
  await anna.goto(`${h.url}#/patient/${patient.id}`);
  await anna.getByText('The daily check is overdue').waitFor();
  equal(
    await anna.getByRole('button', { name: 'Scan a new reference' }).getAttribute('aria-disabled'),
    'true', 'blocked');
  equal(await anna.locator('.reference-block a').getAttribute('href'), '#/check', 'the next step');
  equal(await marked(), before + 1, 'one of the two is marked');
  const refused = await h.api(anna, `patients/${patient.id}/open`, 'POST',
    { purpose: 'reference', reason: '' });
  equal(refused.status, 409, 'the interface refuses too');
  await h.look(anna, 'patient-overdue', { axe: false });
  h.tell('checked');
});

await h.step('site and note are corrected; an archived patient is out of the list, not gone',
  async () => {
  const open = (await h.api(anna, 'patients')).body.patients.find(({ code }) => code === 'PX-0002');
  await bob.goto(`${h.url}#/patient/${open.id}`);
  await bob.getByLabel('Site').fill('pelvis');
  await bob.getByLabel('Note').fill('knee rest,\narms on the chest');
  await bob.locator('form', { has: bob.getByLabel('Site') })
    .getByRole('button', { name: 'Save', exact: true }).click();
  await bob.getByRole('heading', { name: 'PX-0002 pelvis' }).waitFor();
  equal((await h.api(bob, `patients/${open.id}`)).body.note, 'knee rest, arms on the chest',
    'one line');
  await h.look(bob, 'patient-about', { axe: false });
  await bob.getByRole('button', { name: 'Archive', exact: true }).click();
  await bob.getByText('This patient is archived and cannot be opened').first().waitFor();
  equal(await bob.getByRole('button', { name: 'Scan a new reference' }).count(), 0,
    'not to be opened');
  await bob.goto(`${h.url}#/patients`);
  await bob.getByRole('link', { name: 'PX-0001' }).waitFor();
  equal(await bob.getByRole('link', { name: 'PX-0002' }).count(), 0, 'out of the list');
  await bob.getByLabel('Include archived patients').check();
  await bob.getByRole('link', { name: 'PX-0002' }).click();
  await bob.getByRole('button', { name: 'Restore from archive' }).click();
  await bob.getByRole('button', { name: 'Archive', exact: true }).waitFor();
  await bob.goto(`${h.url}#/patients`);
  await bob.getByRole('link', { name: 'PX-0002' }).waitFor();
  await anna.goto(`${h.url}#/patient/${open.id}`);
  await anna.getByLabel('Note').waitFor();
  equal(await anna.getByRole('button', { name: 'Archive', exact: true }).count(), 0,
    'not offered to a technician');
});

await h.step('a press of the button is use of a screen that shows the sweep, and of no other',
  async () => {
  const idle = await h.person('idle');
  await h.logIn(idle, 'anna');
  h.tell('slow');
  let uses = 0;
  idle.on('request', (one) => { if (/\/api\/v1\/session$/.test(one.url())) ++uses; });
  for (const [screen, most] of [['status', 0], ['scan', 1]]) {
    await idle.goto(`${h.url}#/${screen}`);
    await idle.locator('.headline').waitFor();
    await h.ticks(idle);  // what the screens before have asked for was asked
    uses = 0;
    h.tell('press');
    await idle.locator('.chip[data-state=scanning]').waitFor();
    await h.ticks(idle);
    equal(uses, most, `uses of ${screen}`);
    equal((await h.api(anna, 'cancel', 'POST')).status, 200, 'discarded');
    await idle.locator('.chip[data-state=ready]').waitFor();
  }
  await idle.context().close();
});

await h.step('a PIN within a shift: people change in one browser, and signatures keep the password',
  async () => {
  const desk = await h.person('desk');
  const setPin = async (pin) => {
    await desk.goto(`${h.url}#/users`);
    const own = desk.locator('section.card',
      { has: desk.getByRole('heading', { name: 'My PIN or badge' }) });
    await own.getByLabel('New PIN').fill(pin);
    await own.getByLabel('The same again').fill(pin);
    await own.getByLabel('Your password').first().fill(h.password);
    await own.getByRole('button', { name: 'Set PIN or badge' }).click();
    await own.getByText('Set.', { exact: true }).waitFor();
  };
  const type = async (where, pin) => {
    for (const digit of pin) await where.getByRole('button', { name: digit, exact: true }).click();
    await where.getByRole('button', { name: 'Log in' }).click();
  };
  await h.logIn(desk, 'anna');
  equal(await desk.getByRole('button', { name: 'Change person' }).count(), 0, 'nobody else');
  await setPin('4711');
  await desk.getByRole('button', { name: 'Log out' }).click();
  await desk.getByRole('button', { name: 'Log in with name and password' }).click();
  await desk.getByLabel('Name').fill('bob');
  await desk.getByLabel('Password').fill(h.password);
  await desk.getByRole('button', { name: 'Log in', exact: true }).click();
  await desk.locator('#top a.brand').waitFor();
  await setPin('2580');
  // The screen stays, and what is open on it.
  await desk.goto(`${h.url}#/scan`);
  await desk.getByRole('button', { name: 'Change person' }).click();
  const box = desk.locator('dialog');
  await h.look(desk, 'change-person', { axe: false });
  await box.getByRole('button', { name: 'anna' }).click();
  await h.look(desk, 'pin', { axe: false });
  const begun = Date.now();
  await type(box, '4711');
  await desk.getByText('anna, with a PIN').waitFor();
  console.log(`        changed in ${Date.now() - begun} ms, four taps included`);
  equal(await desk.evaluate(() => location.hash), '#/scan', 'the same screen');
  // Back to the physicist, who is a technician now: no plan, no log, and every signature asks.
  await desk.getByRole('button', { name: 'Change person' }).click();
  await box.getByRole('button', { name: 'bob' }).click();
  await desk.keyboard.type('2580');
  await desk.keyboard.press('Enter');
  await desk.getByText('bob, with a PIN').waitFor();
  equal(await desk.getByRole('link', { name: 'Audit log' }).count(), 0, 'rights of a technician');
  equal((await h.api(desk, 'audit')).status, 403, 'the interface refuses, too');
  equal((await h.api(desk, 'session')).body.role, 'physicist', 'whoever it is');
  // Three wrong ones end it: only the password helps.
  await desk.getByRole('button', { name: 'Log out' }).click();
  await desk.getByRole('heading', { name: 'Who are you?' }).waitFor();
  await h.look(desk, 'people');
  await desk.getByRole('button', { name: 'bob' }).click();
  for (const said of ['2 more tries', 'one more try', 'log in with the password']) {
    await type(desk, '1379');
    await desk.getByRole('alert').getByText(said).waitFor();
  }
  await h.look(desk, 'pin-refused');
  await desk.reload();
  await desk.getByRole('button', { name: 'anna' }).waitFor();
  equal(await desk.getByRole('button', { name: 'bob', exact: true }).count(), 0, 'not by PIN');
  await desk.getByRole('button', { name: 'Log in with name and password' }).click();
  await desk.getByLabel('Password').waitFor();
  await desk.context().close();
});

await h.step('unplugged in the middle of a sweep: no result, and none of before in its place',
  async () => {
  h.tell('slow');
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await anna.getByRole('button', { name: 'End sweep' }).waitFor();
  h.tell('unplug');
  await anna.getByRole('alert').getByText('The sensor was unplugged').waitFor();
  equal(await anna.locator('.number').count(), 0, 'no numbers');
  equal((await h.api(anna, 'scans?limit=1')).body.scans[0].outcome, 'failed', 'the scan');
});

await h.step('in safe mode everybody reads why nobody can log in, and it ends by itself',
  async () => {
  const fault = 'the database /state/plumb.db is damaged (malformed): put a backup in its place, '
    + 'or move it and the folder scans away to start over';
  const body = { error: 'log in first', setup_required: false, fault, certificate: '' };
  await Promise.all([['', 'Password'], ['room', 'Log in']].map(async ([where, after]) => {
    const visitor = await h.person('visitor');
    await visitor.route('**/api/v1/session', (route) => route.fulfill({ status: 401, json: body }));
    await visitor.goto(`${h.url}${where}`);
    await visitor.getByRole('heading', { name: 'Out of order' }).waitFor();
    await visitor.getByText(fault).waitFor();
    equal(await visitor.locator('input').count(), 0, 'fields to fill in');
    await visitor.unroute('**/api/v1/session');
    await (where === '' ? visitor.getByLabel(after) : visitor.getByRole('button', { name: after }))
      .waitFor();
    await visitor.context().close();
  }));
});

await h.finish();
