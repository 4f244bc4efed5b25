// SPDX-License-Identifier: Apache-2.0
// Which way the numbers, words, arrows, couch readings and pictures of a result point:
// sides_test.mjs NODE_MODULES SERVER OUT_FOLDER CHROMIUM
// The truths are written here by hand, from what a motion of the body means to who stands beside
// it; none comes from the program.
import { Harness } from './harness.mjs';
import { beginShift } from './shift.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;
const { anna, bob, scan } = await beginShift(h);

// Which side is the patient's is decided once, with the words; no picture may claim more than they
// do.
const marksIn = async (page, where) => [...new Set(await page.locator(`${where} [data-mark]`)
  .evaluateAll((marks) => marks.map((mark) => mark.dataset.mark)))].sort();

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

await h.finish();
