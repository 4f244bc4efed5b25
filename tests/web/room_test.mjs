// SPDX-License-Identifier: Apache-2.0
// The room and the treatment session: room_test.mjs NODE_MODULES SERVER OUT_FOLDER CHROMIUM
// Who is on the couch, what may be acted on, who follows the button, and many screens at once.
import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;
const kSlow = { timeout: 60000 };

const engineer = await h.person('engineer');
const anna = await h.person('anna');
const bob = await h.person('bob');
const clara = await h.person('clara');

const ok = async (page, path, method, body) => {
  const answer = await h.api(page, path, method, body);
  check(answer.status < 300, `${method} ${path}: ${answer.status} ${JSON.stringify(answer.body)}`);
  return answer.body;
};
const state = async () => (await h.api(bob, 'status')).body;
const until = async (what, holds) => {
  for (const begun = Date.now(); !holds(await state());) {
    check(Date.now() - begun < 60000, what);
    await new Promise((ready) => { setTimeout(ready, 100); });
  }
};
const inState = (name) => until(`state ${name}`, (status) => status.state === name);
const styleOf = (page, part, name) =>
  page.locator(part).first().evaluate((element, what) => getComputedStyle(element)[what], name);
const sizeOf = async (page, part) => parseFloat(await styleOf(page, part, 'fontSize'));
/// A sweep with the button, to its result.
async function press() {
  const before = (await state()).last_result?.id;
  h.tell('press');
  await until('a result',
    (status) => status.state === 'result' && status.last_result?.id !== before);
}
async function addPatient(code) {
  return (await ok(anna, 'patients', 'POST', { code, site: 'thorax' })).id;
}
async function approvedPatient(code) {
  const id = await addPatient(code);
  const open = (await state()).session?.id ?? '';
  await ok(anna, `patients/${id}/open`, 'POST',
    { purpose: 'reference', reason: '', replaces: open });
  await press();
  // A code that does not fit on the line wraps as a whole and is not broken at its hyphen.
  const link = bob.locator('.tile .whole', { hasText: code });
  equal(await link.evaluate((element) => {
    const before = document.createRange();
    before.setStart(element.parentElement, 0);
    before.setEndBefore(element);
    element.parentElement.style.width =
      `${before.getBoundingClientRect().width + 0.6 * element.offsetWidth}px`;
    return element.getClientRects().length;
  }), 1, 'a code is not broken at its hyphen');
  const { draft_reference_id: draft } = await ok(anna, `patients/${id}`, 'GET');
  const { plan, ...read } = await ok(bob, `references/${draft}`, 'GET');
  await ok(bob, `references/${draft}/plan`, 'PUT',
    { region_m: plan.region_m, isocentre_m: plan.isocentre_m, posture: plan.posture,
      couch_markers: plan.couch_markers, shift_tolerance_mm: plan.tolerance.shift_mm,
      rotation_tolerance_deg: plan.tolerance.rotation_deg, revision: read.revision });
  const { digest, revision } = await ok(clara, `references/${draft}`, 'GET');
  await ok(clara, `references/${draft}/approve`, 'POST',
    { revision, digest, password: h.password });
  await h.acknowledge(anna, bob, clara);
  return id;
}
const openOnPage = async (page, code,
  button = /^Start (treatment session|a new fraction)$/) => {
  await page.goto(`${h.url}#/patients`);
  await page.getByRole('link', { name: code, exact: true }).click();
  await page.getByRole('button', { name: button }).click();
};

let patient;
await h.step('accounts, and a patient with an approved reference', async () => {
  await h.firstStart(engineer);
  h.tell('checked');  // today, so that nothing is doubtful about a reference
  for (const [name, role] of [['anna', 'technician'], ['bob', 'physicist'],
    ['clara', 'physicist']]) {
    await h.addAccountByApi(engineer, name, role);
  }
  await Promise.all(
    [[anna, 'anna'], [bob, 'bob'], [clara, 'clara']].map(([page, name]) => h.logIn(page, name)));
  patient = await approvedPatient('P-0042');
});

const room = await h.person('room', { width: 1920, height: 1080 });
/// Asks for the password again, as every change of accounts and screens does.
async function removeScreen(name) {
  const row = engineer.getByRole('row', { name });
  await row.getByLabel(`Remove ${name}`).click();
  await row.getByLabel('Your password').fill(h.password);
  await row.getByRole('button', { name: 'Remove', exact: true }).click();
}

await h.step('the room display is paired by the code that it shows, and changes nothing',
  async () => {
  await room.goto(`${h.url}room`);
  const code = await room.locator('.pair-code').innerText();
  check(/^[0-9A-Z]{3}-[0-9A-Z]{3}$/.test(code), `a code to type: ${code}`);
  await h.look(room, 'room-pairing', { axe: false });
  await engineer.goto(`${h.url}#/users`);
  await engineer.getByLabel('Code on the screen').fill('ZZZ-ZZZ');
  await engineer.getByLabel('Name of the screen').fill('couch side');
  const pair = engineer.locator('form', { hasText: 'Name of the screen' });
  await pair.getByLabel('Your password').fill(h.password);
  await engineer.getByRole('button', { name: 'Pair the screen' }).click();
  await engineer.getByRole('alert').getByText('no screen shows this code').waitFor();
  await engineer.getByLabel('Code on the screen').fill(code.toLowerCase());
  await pair.getByLabel('Your password').fill(h.password);
  await engineer.getByRole('button', { name: 'Pair the screen' }).click();
  await engineer.getByRole('cell', { name: 'couch side', exact: true }).waitFor();
  await h.look(engineer, 'displays');
  await room.locator('.room-code').waitFor();
  for (const [method, path, body] of [['POST', 'press'], ['POST', 'scan/start'],
    ['GET', 'patients'], ['GET', 'users'],
    ['POST', `patients/${patient}/open`, { purpose: 'fraction', reason: '' }],
    ['POST', 'treatment/close', { session_id: '' }]]) {
    equal((await h.api(room, path, method, body)).status, 403, `${method} ${path} by the display`);
  }
});

await h.step('a link with the key pairs a display without a code, and does not keep the key',
  async () => {
  // Another pairing's secret is as good a key as that of a provisioning file.
  const { code, secret } = await ok(engineer, 'displays/pair', 'POST');
  const wall = await h.person('wall', { width: 1280, height: 800 });
  await wall.goto(`${h.url}room#key=${secret}`);
  await wall.locator('.pair-code').waitFor();
  equal(new URL(wall.url()).hash, '', 'a key that is not paired is not kept either');
  await ok(engineer, 'displays', 'POST', { code, name: 'wall', password: h.password });
  await wall.goto(`${h.url}room?theme=light#key=${secret}`);
  await wall.locator('.room-code').waitFor();
  equal(new URL(wall.url()).search + new URL(wall.url()).hash, '?theme=light',
    'the address has no key');
  equal((await h.api(wall, 'press', 'POST')).status, 403, 'it changes nothing');
  await engineer.goto(`${h.url}#/users`);
  await engineer.reload();
  await removeScreen('wall');
  await wall.locator('.pair-code').waitFor(kSlow);
  await wall.context().close();
});

await h.step('a person may log in on the screen in the room instead of pairing it', async () => {
  const tablet = await h.person('tablet', { width: 1280, height: 800 });
  await tablet.goto(`${h.url}room`);
  await tablet.getByRole('button', { name: 'Log in' }).click();
  await tablet.getByLabel('Name').fill('bob');
  await tablet.getByLabel('Password').fill(h.password);
  await tablet.getByRole('button', { name: 'Log in' }).click();
  await tablet.locator('.room-code').waitFor();
  equal(await tablet.locator('#alert').innerText(), '', 'nothing went wrong');
  await tablet.context().close();
});

await h.step('one tap opens, confirms and leads to the sweep; the room says whose session',
  async () => {
  await openOnPage(anna, 'P-0042');
  await anna.getByRole('button', { name: /Start sweep|Scan again/ }).waitFor();
  await room.locator('.room-code', { hasText: 'P-0042' }).waitFor();
  // Which version is compared with, and of when.
  const { session: { reference } } = await state();
  const { references } = await ok(bob, `patients/${patient}/references`, 'GET');
  const made = references.find(({ id }) => id === reference.id).created_at;
  const day = new Date(made).toLocaleDateString('en-GB',
    { year: 'numeric', month: 'short', day: '2-digit' });
  const compared = `Reference version ${reference.version}, ${day}`;
  await room.locator('.room-fraction', { hasText: 'Fraction 1' }).getByText(compared).waitFor();
  await anna.locator('.who-line', { hasText: compared }).waitFor();
});

await h.step('the outline of the reference lies over the picture, for the posture', async () => {
  h.tell('camera');
  const notes = {
    waits: 'appears when four room markers are seen', outside: 'outside this picture',
    placed: 'Yellow: the reference, version 1, as it lay.',
  };
  for (const [what, note] of Object.entries(notes)) {
    h.tell(`outline ${what}`);
    for (const page of [anna, room]) {
      const picture = page.locator('.preview');
      await picture.getByText(note).waitFor(kSlow);
      equal(await picture.getByRole('img', { name: note }).count(), what === 'placed' ? 1 : 0,
        `${what}: a drawing with its words`);
    }
  }
  // Where it says, over the picture and not beside it.
  for (const page of [anna, room]) {
    // All at once: the picture is drawn again twice a second.
    const { line, picture, shown } = await (await page.waitForFunction(() => {
      const drawn = document.querySelector('.lying .line');
      const image = document.querySelector('.preview img');
      if (!drawn || !image || !image.naturalWidth) return null;
      const [lineAt, imageAt] = [drawn, image].map((one) => one.getBoundingClientRect().toJSON());
      return { line: lineAt, picture: imageAt, shown: image.naturalWidth / image.naturalHeight };
    })).jsonValue();
    const width = Math.min(picture.width, picture.height * shown);
    const left = picture.x + (picture.width - width) / 2;
    check(Math.abs(line.x - (left + 0.25 * width)) < 5, `left end: ${line.x} of ${left}, ${width}`);
    check(Math.abs(line.x + line.width - (left + 0.8 * width)) < 5, 'right end');
  }
  await room.waitForFunction(() =>
    document.documentElement.scrollHeight <= window.innerHeight + 1);
  await h.look(room, 'room-outline', { fullPage: false });
  await anna.setViewportSize({ width: 390, height: 844 });
  await h.look(anna, 'scan-phone-outline');
  await anna.setViewportSize({ width: 1280, height: 800 });
  for (const what of ['other', 'placed', 'none']) {  // one of another patient is never shown
    h.tell(`outline ${what}`);
    for (const page of [anna, room]) {
      await page.locator('.lying').waitFor({ state: what === 'placed' ? 'visible' : 'hidden' });
    }
  }
  for (const page of [anna, room]) await page.locator('.preview img').waitFor();
  h.tell('outline placed');
});

await h.step('the room follows the button by itself, in words of 10 cm', async () => {
  h.tell('slow');
  h.tell('moved z 8 HFS');
  h.tell('press');
  const kAdvice = ['slower', 'closer', 'farther', 'lost', 'too_slow', 'good', 'enough'];
  for (const [language, words] of [
    ['es', ['MÁS DESPACIO', 'MÁS CERCA', 'MÁS LEJOS', 'PERDIDO', 'EQUIPO LENTO', 'BIEN',
      'SUFICIENTE']],
    ['en', ['SLOWER', 'CLOSER', 'FARTHER', 'LOST', 'COMPUTER TOO SLOW', 'GOOD', 'ENOUGH']]]) {
    await room.goto(`${h.url}room?language=${language}`);
    for (const [i, word] of words.entries()) {
      h.tell(`guide ${kAdvice[i]}`);
      const shown = room.locator('.room-word', { hasText: word });
      await shown.waitFor(kSlow);
      // On a screen of 40 inches (88 cm wide): the height of capital letters. The width leaves 10
      // cm to words of up to 7 letters, 7 cm to those of up to 9, and 5 cm to longer ones: MÁS
      // DESPACIO, EQUIPO LENTO and COMPUTER TOO SLOW are among these.
      const size =
        await shown.evaluate((element) => parseFloat(getComputedStyle(element).fontSize));
      const cm = size * 0.73 * 88.5 / 1920;
      check(cm >= (word.length > 9 ? 5 : word.length > 7 ? 7 : 10),
        `${word} is ${cm.toFixed(1)} cm high`);
      const box = await shown.boundingBox();
      check(box.x >= 0 && box.x + box.width <= 1920, `${word} fits`);
      await h.look(room, `room-${kAdvice[i]}-${language}`, { axe: false, fullPage: false });
    }
  }
  equal(await room.locator('.forming .live-number').count(), 6, 'the numbers that form');
  await room.getByText('So far, provisional').waitFor(kSlow);
  equal(await room.locator('.number').count(), 0, 'no result during the sweep');
  // Also beside the note of whose sides the marks are.
  await room.locator('.room-sweep .marks-note').waitFor(kSlow);
  for (const [width, height] of [[1280, 800], [1920, 1080]]) {
    await room.setViewportSize({ width, height });
    // All at once: the map is drawn again twice a second.
    const [map, sweep, ...words] = await room.evaluate(() =>
      ['.live-surface .map-box', '.room-sweep', '.marks-note', '.live-surface .keys']
        .map((place) => document.querySelector(place).getBoundingClientRect().toJSON()));
    check(map.height > 0.95 * sweep.height || map.width > 0.45 * sweep.width,
      `the map has its space at ${width}x${height}: ${map.width} x ${map.height} of ${sweep.width} `
        + `x ${sweep.height}`);
    for (const { bottom } of words) {
      check(bottom <= height, `note and keys in view at ${width}x${height}: down to ${bottom}`);
    }
  }
  h.tell('guide');
  h.tell('fast');
  await room.locator('.room-word', { hasText: 'COMPUTING' }).waitFor(kSlow);
  equal(await room.locator('.number').count(), 0, 'nor while it is computed');
  await room.locator('.verdict.move').waitFor(kSlow);
  equal(await room.locator('.number').count(), 6, 'six numbers');
  await room.locator('.room-map canvas').waitFor();
  // Patient and uncertainty are read from 3 m: digits of 1 cm at least, and nothing below the edge.
  for (const [place, least] of [['.room-code', 2], ['.number .value', 2], ['.number .half', 1],
    ['.number .limit', 0.9]]) {
    const size = await room.locator(place)
      .first().evaluate((element) => parseFloat(getComputedStyle(element).fontSize));
    const cm = size * 0.73 * 88.5 / 1920;
    check(cm >= least, `${place} is ${cm.toFixed(1)} cm high`);
  }
  for (const [width, height] of [[1280, 800], [1920, 1080]]) {
    await room.setViewportSize({ width, height });
    // With the longest words that there are in either language.
    const lowest = await room.evaluate(() => {
      const words = { '.number .word': 'hacia la izquierda del paciente',
        '.number .judged': '▲ fuera de tolerancia' };
      const texts = Object.entries(words).flatMap(([where, text]) =>
        [...document.querySelectorAll(where)]
          .map((element) => [element, element.textContent, text]));
      for (const [element, , text] of texts) element.textContent = text;
      const bottom = Math.max(...[...document.querySelectorAll('.number')]
        .map((card) => card.getBoundingClientRect().bottom));
      for (const [element, text] of texts) element.textContent = text;
      return bottom;
    });
    check(lowest <= height, `all six in view at ${width}x${height}: down to ${lowest}`);
    const crowded =
      await room.evaluate(() => [...document.querySelectorAll('.number')].filter((card) => {
      const text = document.createRange();
      text.selectNodeContents(card.querySelector('.value'));
      const arrow = card.querySelector('.arrow');
      return arrow && text.getBoundingClientRect().right > arrow.getBoundingClientRect().left;
    }).map((card) => card.querySelector('.value').textContent));
    equal(crowded.join(), '', `no arrow lies on its number at ${width}x${height}`);
    for (const part of ['.room-map .legend', '.room-posture', '.room-age']) {
      const box = await room.locator(part).boundingBox();
      check(box.y + box.height <= height,
        `${part} in view at ${width}x${height}: down to ${box.y + box.height}`);
    }
  }
  await h.look(room, 'room-move', { axe: false, fullPage: false });
});

await h.step('while a sweep runs or is computed no older result looks valid', async () => {
  await anna.goto(`${h.url}#/result`);
  await anna.locator('.verdict.move').waitFor();
  equal(await anna.locator('.is-old').count(), 0, 'fresh at first');
  h.tell('slow');
  h.tell('press');
  await inState('scanning');
  await anna.getByText('A NEW SCAN IS RUNNING').waitFor();
  equal(await anna.locator('.is-old').count(), 1, 'no longer valid');
  equal(await anna.getByRole('button', { name: /^Accept/ }).count(), 0, 'nothing to accept');
  // The progress bar is also visible in the high-contrast colours of the system.
  await clara.emulateMedia({ forcedColors: 'active' });
  await clara.goto(`${h.url}#/scan`);
  // At one per cent the bar is shorter than what is compared.
  await clara.locator('.bar-text', { hasText: /[1-9]\d+ %/ }).waitFor();
  const bar = await clara.locator('.bar progress').boundingBox();
  const [full, empty] = await Promise.all([4, bar.width - 8].map((x) =>
    clara.screenshot({ clip: { x: bar.x + x, y: bar.y + bar.height / 2, width: 2, height: 2 } })));
  check(!full.equals(empty), 'what is covered has a colour of its own');
  await clara.emulateMedia({ forcedColors: 'none' });
  await clara.goto(h.url);
  await h.look(anna, 'result-while-scanning', { axe: false });
  const old = await state();
  equal((await h.api(anna, `scans/${old.last_result.id}/accept-outside`, 'POST',
    { reason: 'because', password: h.password })).status, 409, 'nor through the interface');
  await bob.goto(`${h.url}result?scan=${old.last_result.id}`);
  await bob.getByText('A new scan is running.').waitFor();
  await bob.goto(h.url);
  h.tell('moved x 8 HFS');
  h.tell('fast');
  await anna.getByText('A NEW SCAN IS RUNNING').waitFor({ state: 'detached', ...kSlow });
  await anna.locator('.number', { hasText: 'Lateral' }).getByText('−8.0').waitFor();
  equal(await anna.locator('.is-old').count(), 0, 'the new one is valid');
  // What is within tolerance is applied with the rest, so it is not green either.
  await anna.locator('.verdict .why', { hasText: 'Apply all six numbers below together' })
    .waitFor();
  equal(await anna.locator('.number.neutral').count(), 5, 'neither in nor out of what to do');
});

await h.step('accepting outside tolerance takes a reason and the password', async () => {
  const last = (await state()).last_result.id;
  equal((await h.api(anna, `scans/${last}/accept`, 'POST')).status, 409, 'not in one tap');
  equal(await anna.getByRole('button', { name: 'Accept', exact: true }).count(), 0,
    'no such button');
  await anna.getByText('Accept outside tolerance…').click();
  await anna.getByLabel('Reason', { exact: true }).fill('swelling, known to the physician');
  await anna.getByLabel('Your password').fill('not this one, no');
  await anna.getByRole('button', { name: 'Accept outside tolerance' }).click();
  await anna.getByRole('alert').getByText('the password is wrong').waitFor();
  await anna.getByLabel('Your password').fill(h.password);
  await h.look(anna, 'accept-outside', { axe: false });
  await anna.getByRole('button', { name: 'Accept outside tolerance' }).click();
  await anna.getByText(/^▲ Accepted outside tolerance by anna, .*20.*: swelling/).waitFor();
  await room.locator('.room-accepted', { hasText: '▲ Accepted by anna' }).waitFor(kSlow);
  const { entries } = await ok(bob, 'audit?limit=20', 'GET');
  check(entries.some(({ action }) => action === 'scan.accept_outside'), 'it is in the log');
});

await h.step('in tolerance: one tap accepts, and nothing commands a move', async () => {
  h.tell('moved z 0 HFS');
  h.tell('tolerated');
  await press();
  await anna.locator('.verdict.in_tolerance').waitFor();
  await anna.getByText('Remaining difference: no move needed').waitFor();
  equal(await anna.locator('.number .arrow').count(), 0, 'no arrows');
  for (const word of await anna.locator('.number .word').allInnerTexts()) {
    equal(word, 'no move needed', 'the words');
  }
  await anna.getByRole('button', { name: 'Accept', exact: true }).click();
  await anna.getByText('Accepted by anna').waitFor();
  await room.locator('.room-accepted', { hasText: '✓ Accepted by anna' }).waitFor(kSlow);
  // An old result: the note is read from 3 m; nothing is green or ticked, and nothing says what to
  // do.
  await room.locator('.room-result:not(.is-old) .verdict.in_tolerance').waitFor();
  h.tell('old');
  await room.locator('.room-result.is-old .verdict', { hasText: 'WAS IN TOLERANCE' }).waitFor();
  for (const [part, name, expected] of [
    ['.verdict', 'filter', 'grayscale(1)'], ['.room-answer', 'filter', 'grayscale(1)'],
    ['.verdict .word', 'color', 'rgb(167, 182, 194)'], ['.verdict', 'borderTopStyle', 'dashed'],
    ['.verdict .icon', 'display', 'none'], ['.number .word', 'display', 'none'],
    ['.number .judged', 'display', 'none'], ['.room-posture', 'display', 'none']]) {
    equal(await styleOf(room, part, name), expected, `${name} of ${part}`);
  }
  check(await sizeOf(room, '.old-note') > 45, 'the note is large');
  check(await sizeOf(room, '.old-note') < await sizeOf(room, '.verdict .word') * 1.5,
    'and the verdict is not much larger');
  await h.look(room, 'room-old', { axe: false, fullPage: false });
});

await h.step('no answer: the room display shows three reasons, and no list to open', async () => {
  h.tell('stranger');
  await press();
  await room.locator('.verdict.no_answer').waitFor();
  equal(await room.locator('.room-reasons li').count(), 2, 'below the first');
  equal(await room.locator('details').count(), 0, 'nobody can open them there');
  for (const part of ['.room-reasons li', '.verdict .why']) {
    check(await sizeOf(room, part) > 40, `${part} is read from 3 m`);
  }
  const age = await room.locator('.room-age').boundingBox();
  check(age.y + age.height <= 1080, 'all in view');
  await h.look(room, 'room-no-answer', { axe: false, fullPage: false });
});

await h.step('three words: within, inconclusive, outside; no digits below the uncertainty',
  async () => {
  h.tell('unsure');
  await press();
  await anna.locator('.verdict.unsure').waitFor();
  await anna.locator('.verdict', { hasText: 'INCONCLUSIVE' }).waitFor();
  const card = anna.locator('.number', { hasText: 'Vertical' });
  equal(await card.locator('.judged').innerText(), '≈ inconclusive', 'the word');
  equal((await card.locator('.value').innerText()).replace(/\s/g, ''), '−3mm', '−2.8 ±1.2');
  check(/±1\.2 mm$/.test(await card.locator('.half').innerText()), 'a second digit after a 1');
  await card.getByText('tolerance ±3 mm').waitFor();
  const pitch = anna.locator('.number', { hasText: 'Pitch' });
  equal(await pitch.locator('.value').innerText(), '0.0°', '0.01 ±0.14');
  check(/±0\.14°$/.test(await pitch.locator('.half').innerText()), 'a second digit after a 1');
  for (const page of [anna, room]) {
    equal(await sizeOf(page, '.number:last-child .unit'),
      await sizeOf(page, '.number:last-child .value'), 'no small ° at the foot');
    check(await sizeOf(page, '.number .unit') < 0.6 * await sizeOf(page, '.number .value'),
      'mm is small');
  }
  const lowest = await anna.locator('.number').last().evaluate((element) => {
    window.scrollTo(0, 0);
    return element.getBoundingClientRect().bottom;
  });
  check(lowest <= 800, `six numbers in view, down to ${lowest}`);
  await h.look(anna, 'result-unsure', { axe: false });
  equal(await anna.getByRole('button', { name: 'Accept', exact: true }).count(), 0,
    'not in one tap');
  equal(await anna.getByText('Accept outside tolerance').count(), 0, 'no value is outside');
  await anna.getByText('Accept although inconclusive…').click();
  await anna.getByLabel('Reason', { exact: true }).fill('breathing');
  await anna.getByLabel('Your password').fill(h.password);
  await anna.getByRole('button', { name: 'Accept although inconclusive' }).click();
  await anna.getByText(/^≈ Accepted although inconclusive, by anna, .*: breathing$/)
    .waitFor();
});

await h.step('the room display says in large letters that the room is not calibrated', async () => {
  h.tell('moved z 8 HFS bare');
  await press();
  await room.locator('.room-answer section > .caution').waitFor();
  check(await sizeOf(room, '.room-answer section > .caution') > 36, 'read from 3 m');
  const lowest = await room.locator('.number')
    .last().evaluate((element) => element.getBoundingClientRect().bottom);
  check(lowest <= 1080, `six numbers in view, down to ${lowest}`);
});

await h.step('after 6 s of silence nobody knows whether a result holds, on page and room display',
  async () => {
  await press();
  await anna.goto(`${h.url}#/result`);
  const held = [anna.locator('.old-note', { hasText: 'NO CONNECTION' }),
    room.locator('.old-note', { hasText: 'NO CONNECTION' })];
  await room.locator('.room-result .verdict').waitFor();
  // The result of this sweep, not the one before it that the page may still be replacing.
  const { id } = (await state()).last_result;
  await anna.locator(`a[href^="/result?scan=${id}&"]`).first().waitFor({ state: 'attached' });
  await anna.locator('.old-note[data-shown=""]').waitFor({ state: 'attached' });
  for (const note of held) equal(await note.count(), 0, 'valid');
  h.server.kill('SIGSTOP');
  const begun = Date.now();
  try {
    for (const note of held) await note.waitFor({ timeout: 15000 });
    const seconds = (Date.now() - begun) / 1000;
    console.log(`    known after ${seconds.toFixed(1)} s`);
    check(seconds < 8, `known after ${seconds} s`);
    for (const page of [anna, room]) {
      equal(await page.locator('.number .arrow').count(), 0, 'no arrow to follow');
    }
    await h.look(room, 'room-silent', { axe: false, fullPage: false });
  } finally {
    h.server.kill('SIGCONT');
  }
  for (const note of held) await note.waitFor({ state: 'detached' });
});

await h.step('fraction numbers count sessions, not scans', async () => {
  const { scans } = await ok(anna, `patients/${patient}/scans`, 'GET');
  const fractions = scans.filter(({ purpose }) => purpose === 'fraction');
  check(fractions.length >= 4, 'several scans');
  equal(new Set(fractions.map(({ fraction }) => fraction)).size, 1, 'of one fraction');
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('button', { name: 'Close session' }).click();
  const asked = anna.getByRole('dialog', { name: 'Not accepted' });
  await asked.getByText('Nobody has accepted the newest result of P-0042, Fraction 1').waitFor();
  await h.look(anna, 'close-question', { fullPage: false });
  await asked.getByRole('button', { name: 'Keep it open' }).click();
  equal((await state()).session.fraction, 1, 'still open');
  await anna.getByRole('button', { name: 'Close session' }).click();
  await asked.getByRole('button', { name: 'Close without acceptance' }).click();
  await anna.getByText('No session open').first().waitFor();
  // What was closed can go on: the same fraction, not the next one.
  await anna.goto(`${h.url}#/patient/${patient}`);
  await anna.getByRole('button', { name: /^Resume fraction 1 \(closed \d+ \w+ ago\)$/ }).click();
  await anna.locator('.who-line', { hasText: 'Fraction 1' }).waitFor();
  equal((await state()).session.id, scans.find(({ purpose }) => purpose === 'fraction').session_id,
    'the same session');
  await anna.getByRole('button', { name: 'Close session' }).click();
  await asked.getByRole('button', { name: 'Close without acceptance' }).click();
  await anna.getByText('No session open').first().waitFor();
  // A check that was opened can be left: then the open session is in hand again, here and there.
  await openOnPage(anna, 'P-0042', 'Resume fraction 1');
  await anna.locator('.who-line', { hasText: 'Fraction 1' }).waitFor();
  await ok(anna, 'checks/open', 'POST');
  await anna.locator('.who-line', { hasText: 'Daily check' }).waitFor();
  await anna.getByText('After it: P-0042, Fraction 1').waitFor();
  await room.locator('.room-code', { hasText: 'Daily check' }).waitFor();
  equal(await room.getByText('Fraction 1').count(), 0, 'the check only');
  await anna.getByRole('button', { name: 'Leave the check' }).click();
  await anna.locator('.who-line', { hasText: 'Fraction 1' }).waitFor();
  await room.locator('.room-code', { hasText: 'P-0042' }).waitFor();
  equal(await room.getByText('Daily check', { exact: true }).count(), 0, 'the session only');
  await anna.getByRole('button', { name: 'Close session' }).click();
  await asked.getByRole('button', { name: 'Close without acceptance' }).click();
  await anna.getByText('No session open').first().waitFor();
  // One that passed says which marker it did not see.
  await ok(anna, 'checks/open', 'POST');
  h.tell('markerunseen');
  h.tell('press');
  await room.locator('.verdict.in_tolerance', { hasText: 'DAILY CHECK: PASSED' })
    .getByText('Marker 4 was not seen well').waitFor(kSlow);
  await h.look(room, 'room-check-unseen', { fullPage: false });
  await anna.getByText('Marker 4 was not seen well').first().waitFor(kSlow);
  // A failed daily check stays in the corner, and the display is ready for the next session.
  await ok(anna, 'checks/open', 'POST');
  h.tell('markermoved');
  h.tell('press');
  await room.locator('.verdict.move', { hasText: 'DAILY CHECK: FAILED' }).waitFor(kSlow);
  // Her page goes there by itself: only then can she leave it.
  await anna.getByText('Marker 7 moved').first().waitFor(kSlow);
  await openOnPage(anna, 'P-0042', 'Start a new fraction');
  await anna.locator('.who-line', { hasText: 'Fraction 2' }).waitFor();
  await room.locator('.room-word', { hasText: 'READY' }).waitFor();
  await room.locator('.room-marks .bad', { hasText: 'Daily check failed' }).waitFor();
  equal(await room.getByText('Daily check passed').count(), 0, 'not passed');
  h.tell('checked');  // a later check passes, so that a reference can be scanned
  // The next thing to press is the scan, not another session.
  await anna.goto(`${h.url}#/patient/${patient}`);
  await anna.locator('a.primary', { hasText: 'Go to scan' }).waitFor();
  equal(await anna.getByRole('button', { name: /^(Start|Resume)/ }).count(), 0,
    'what is open is not offered again');
  equal(await anna.getByText('Confirm: P-0042 is on the couch').isVisible(), false, 'nor asked');
  equal(await anna.getByRole('button', { name: 'Scan a new reference' }).count(), 1,
    'another purpose is');
  await anna.goto(`${h.url}#/scan`);
});

await h.step('a fraction number is corrected with a reason and the password', async () => {
  await anna.goto(`${h.url}#/patient/${patient}`);
  await anna.getByText('Correct a fraction number').click();
  const form = anna.locator('details', { hasText: 'Correct a fraction number' });
  await form.getByLabel('Session').selectOption({ index: 0 });
  await form.getByLabel('Right number').fill('3');
  await form.getByLabel('Reason for the correction').fill('two were given elsewhere');
  await form.getByLabel('Your password').fill('not this one at all');
  await form.getByRole('button', { name: 'Sign and correct' }).click();
  await anna.getByRole('alert').getByText('password').waitFor();
  await form.getByLabel('Your password').fill(h.password);
  await form.getByRole('button', { name: 'Sign and correct' }).click();
  await anna.getByRole('cell', { name: '3', exact: true }).first().waitFor();
  const { scans } = await ok(anna, `patients/${patient}/scans`, 'GET');
  equal(new Set(scans.map(({ fraction }) => fraction).filter(Boolean)).size, 1, 'one fraction');
  equal(scans.find(({ fraction }) => fraction).fraction, 3, 'the corrected one');
  await anna.goto(`${h.url}#/scan`);
});

await h.step('a version that is approved meanwhile is a question, and changes nothing by itself',
  async () => {
  const [first] = (await ok(bob, `patients/${patient}/references`, 'GET')).references;
  const { id } = await ok(bob, `references/${first.id}/plan`, 'PUT', {
    revision: first.revision, region_m: first.plan.region_m, isocentre_m: first.plan.isocentre_m,
    shift_tolerance_mm: 3, rotation_tolerance_deg: 1, posture: 'HFS', couch_markers: false,
  });
  const draft = await ok(clara, `references/${id}`, 'GET');
  await ok(clara, `references/${id}/approve`, 'POST',
    { revision: draft.revision, digest: draft.digest, password: h.password });
  const asked = anna.getByRole('dialog', { name: 'A newer reference is approved' });
  await asked.getByText(/version 2 \(±3 mm, ±1°/).waitFor();
  await room.locator('.room-newer', { hasText: 'Version 2 is approved by now' }).waitFor();
  await h.look(anna, 'reference-question', { fullPage: false });
  await h.look(room, 'room-newer-reference', { axe: false, fullPage: false });
  await asked.getByRole('button', { name: 'Keep version 1 for this session' }).click();
  await asked.waitFor({ state: 'detached' });
  equal((await state()).session.reference.version, 1, 'kept');
  await press();
  equal((await state()).last_result.reference_id, first.id, 'compared with the version of before');
  await anna.goto(`${h.url}#/scan`);
  await anna.locator('.who-line', { hasText: 'Reference version 1' }).waitFor();
  equal(await asked.count(), 0, 'asked once');
  await anna.locator('.who-line').getByRole('button', { name: 'Use version 2' }).click();
  await anna.locator('.who-line', { hasText: 'Reference version 2' }).waitFor();
  await room.locator('.room-newer').waitFor({ state: 'detached' });
  await press();
  equal((await state()).last_result.reference_id, id, 'compared with the one that was chosen');
  await anna.goto(`${h.url}#/scan`);
});

await h.step('that the patient is open in another unit is said on page and display', async () => {
  for (const [what, words] of [['open', 'This patient is open in plumb-b.clinic.example:8080, too'],
    ['silent', 'Whether this patient is open in plumb-b.clinic.example:8080, too, is not known']]) {
    h.tell(`peers ${what}`);
    await room.locator('.room-newer', { hasText: words }).waitFor();
    await anna.locator('.who-line .caution', { hasText: words }).waitFor();
    await h.look(room, `room-peers-${what}`, { axe: false, fullPage: false });
  }
  await h.look(anna, 'scan-peers', { fullPage: false });
  h.tell('peers nothing');
  await room.locator('.room-newer').waitFor({ state: 'detached' });
  await anna.locator('.who-line', { hasText: 'too, is not known' }).waitFor({ state: 'detached' });
});

await h.step('a change from elsewhere is an alert to acknowledge', async () => {
  // Where nothing is done with who is open, the screen stays usable beside it. A reload is no
  // acknowledgement.
  await anna.locator('.who-line').waitFor();
  await anna.goto(`${h.url}#/status`);
  await clara.goto(`${h.url}#/result/${(await state()).last_result.id}`);
  await clara.locator('.verdict').waitFor();
  const second = await addPatient('P-0050');
  await ok(bob, `patients/${second}/open`, 'POST',
    { purpose: 'reference', reason: '', replaces: (await state()).session.id });
  // The screen in the room says it for some seconds; nothing moves where that is not wanted.
  const swapped = room.locator('.room-code.swapped', { hasText: 'Another patient: P-0050' });
  await swapped.waitFor();
  equal(await swapped.evaluate((element) => getComputedStyle(element).animationName), 'none',
    'no animation');
  await h.look(room, 'room-swapped', { axe: false, fullPage: false });
  await h.setClockOn(room, 10);
  await swapped.waitFor({ state: 'detached' });
  await room.locator('.room-code', { hasText: 'P-0050' }).waitFor();
  const above = anna.getByRole('alert').getByText('Now: P-0050');
  await above.waitFor();
  await clara.getByRole('alert').getByText('Now: P-0050').waitFor();
  equal(await clara.evaluate(() => document.querySelector('dialog:modal') === null), true,
    'who reads a result of the history is not held up');
  await h.look(anna, 'session-changed', { fullPage: false });
  await anna.reload();
  await above.waitFor();
  await anna.goto(`${h.url}#/scan`);
  await anna.getByRole('dialog').getByText('Now: P-0050').waitFor();
  await anna.getByText('Check who is on the couch').waitFor();
  await h.look(anna, 'session-alert', { axe: false, fullPage: false });
  equal(await anna.evaluate(() => document.querySelector('dialog').matches(':modal')), true,
    'nothing else can be used before');
  await anna.getByRole('button', { name: 'I have seen it' }).click();
  equal(await anna.getByRole('dialog').count(), 0, 'acknowledged');
  await anna.reload();
  await anna.locator('.who-line', { hasText: 'P-0050' }).waitFor();
  equal(await anna.locator('.session-alert').count(), 0, 'once');
  await h.acknowledge(bob, clara);
  // Opening another patient names the one whose session ends.
  await openOnPage(anna, 'P-0042');
  await anna.getByText('The session of P-0050 is open.').first().waitFor();
  equal((await state()).session.patient_id, second, 'nothing was changed yet');
  equal((await h.api(anna, `patients/${patient}/open`, 'POST', { purpose: 'fraction', reason: '' }))
    .status, 409, 'nor through the interface');
  await anna.getByRole('button', { name: 'Close P-0050, open P-0042' }).click();
  await anna.locator('.who-line', { hasText: 'P-0042' }).waitFor();
  equal(await anna.getByRole('dialog').count(), 0, 'one’s own change is no alert');
});

await h.step('codes are unique without regard to case, and a wristband opens', async () => {
  await h.addPatient(anna, 'p-0042');
  await anna.getByRole('alert').getByText(/there is a patient/i).waitFor();
  await anna.goto(`${h.url}#/status`);
  await anna.locator('.tile').first().waitFor();
  await anna.goto(`${h.url}#/patients`);
  await anna.getByRole('link', { name: 'P-0050' }).waitFor();
  // The field has the focus: a scanner types at once.
  await anna.keyboard.type('P-005', { delay: 60 });  // a person
  await anna.keyboard.press('Enter');
  await anna.locator('.caution', { hasText: 'No patient with this code: P-005.' }).waitFor();
  await anna.getByRole('status')
    .getByText('No patient with this code: P-005.').waitFor({ state: 'attached' });
  check(/#\/patients$/.test(anna.url()), 'a part of a code opens nobody');
  await anna.keyboard.type('P-77');  // in place of what was typed before
  await anna.locator('.hint', { hasText: 'No patient with this code: P-77.' }).waitFor();
  await anna.getByLabel('Find a code').fill('p-0050');
  await anna.getByLabel('Find a code').press('Enter');
  await anna.getByRole('heading', { name: 'P-0050' }).waitFor();
});

/// What a scanner types on that page, at once; returns whether its Enter was swallowed.
const wristband = (page, code) => page.evaluate((text) => {
  const type = (key) => (document.activeElement ?? document.body).dispatchEvent(
    new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
  for (const key of text) type(key);
  return !type('Enter');
}, code);

await h.step('a wristband is answered on every screen, and its Enter presses no button',
  async () => {
  const { session } = await state();
  equal(session.patient_code, 'P-0042', 'who is open');
  await anna.goto(`${h.url}#/scan`);
  await anna.locator('.giant').focus();
  const asked = anna.getByRole('dialog', { name: 'This wristband is another patient’s' });
  check(await wristband(anna, 'p 0042'), 'swallowed on the large button');
  await anna.getByRole('status').getByText('✓ P-0042 is the open patient.').waitFor();
  check(await wristband(anna, 'P0050'), 'without its hyphen');
  await asked.getByText('Scanned: P-0050. The session of P-0042 is open.').waitFor();
  await h.look(anna, 'wristband-other', { fullPage: false });
  await asked.getByRole('button', { name: 'P-0042 is on the couch' }).click();
  await asked.waitFor({ state: 'detached' });
  check(await wristband(anna, 'P-9999'), 'swallowed');
  await anna.getByRole('alert').getByText('Scanned: P-9999. No patient has this code.').waitFor();
  check(await wristband(anna, 'P-0050'), 'swallowed');
  await asked.getByRole('button', { name: 'Go to P-0050' }).click();
  await anna.getByRole('heading', { name: 'P-0050' }).waitFor();
  const after = await state();
  equal(after.session.id, session.id, 'no session was opened or closed');
  check(!['scanning', 'working'].includes(after.state), 'no sweep was started');
  // Three characters are no burst, and people are slower: their Enter is theirs.
  check(!await wristband(anna, 'P-0'), 'not swallowed');
  // Codes that look alike are asked about.
  await h.addPatient(anna, 'P-OO50');
  await anna.getByRole('alert').getByText('P-OO50 looks like P-0050').waitFor();
  equal((await ok(anna, 'patients', 'GET')).patients.length, 2, 'not added');
  await h.addPatient(anna, 'P'.repeat(33));
  await anna.getByRole('alert').getByText('at most 32 characters; this one has 33').waitFor();
});

await h.step('where the settings ask for it, a code has a check character', async () => {
  await engineer.goto(`${h.url}#/settings`);
  const asks = engineer.getByLabel('Codes of new patients end with a check character');
  const save = async (isOn) => {
    await asks.setChecked(isOn);
    const kept = engineer.waitForResponse((answer) => answer.request().method() === 'PUT');
    await engineer.getByRole('button', { name: 'Save', exact: true }).click();
    equal((await kept).status(), 200, 'saved');
  };
  await save(true);
  const alert = anna.getByRole('alert');
  for (const wrong of ['P-0061', 'P-0061V', 'P-0016P']) {
    await h.addPatient(anna, wrong);
    await alert.getByText(`the last character of ${wrong} is not the check character`).waitFor();
  }
  equal((await ok(anna, 'patients', 'GET')).patients.length, 2, 'not added');
  check(await wristband(anna, 'P0061W'), 'swallowed');
  await alert.getByText('Scanned: P0061W. Its check character is wrong: scan it again.').waitFor();
  check(await wristband(anna, 'p0061p'), 'swallowed');
  await alert.getByText('Scanned: p0061p. No patient has this code.').waitFor();
  check(await wristband(anna, 'P0050'), 'of before');
  const asked = anna.getByRole('dialog', { name: 'This wristband is another patient’s' });
  await asked.getByRole('button', { name: 'P-0042 is on the couch' }).click();
  await h.addPatient(anna, 'P-0061P');
  await anna.getByRole('heading', { name: 'P-0061P' }).waitFor();
  await save(false);
  check(await wristband(anna, 'P0061W'), 'swallowed');
  await alert.getByText('Scanned: P0061W. No patient has this code.').waitFor();
});

await h.step('where the settings ask for it, no sweep begins before the wristband is scanned',
  async () => {
  await engineer.goto(`${h.url}#/settings`);
  await engineer.getByLabel('Ask for the wristband before each sweep').check();
  await engineer.getByRole('button', { name: 'Save', exact: true }).click();
  await engineer.getByRole('status').getByText('Saved.').waitFor({ state: 'attached' });
  // A new session: the room display shows no result, but what comes next.
  await ok(anna, 'treatment/close', 'POST', { session_id: (await state()).session.id });
  await h.acknowledge(anna, bob, clara);
  await openOnPage(anna, 'P-0042');
  await h.acknowledge(anna, bob, clara);
  const { session } = await state();
  await anna.goto(`${h.url}#/scan`);
  const start = anna.locator('.giant');
  const form = anna.locator('.wristband');
  await form.getByLabel('Wristband of P-0042').waitFor();
  equal(await start.getAttribute('aria-disabled'), 'true', 'the large button is off');
  await h.look(anna, 'wristband-asked', { fullPage: false });
  h.tell('press');  // by the button in the room
  const refused = await h.api(anna, 'scan/start', 'POST');
  equal(`${refused.status} ${refused.body.error_message.id}`, '409 scan.wristband_first',
    'a start');
  equal((await h.api(anna, 'press', 'POST')).status, 409, 'a press');
  check(!['scanning', 'working'].includes((await state()).state), 'nothing began');
  for (const [language, word, hint] of [
    ['es', 'LEER PULSERA', 'Antes de cada barrido: lea la pulsera de P-0042.'],
    ['de', 'ARMBAND LESEN', 'Vor jedem Schwenk: das Armband von P-0042 lesen.'],
    ['fr', 'LIRE LE BRACELET', 'Avant chaque balayage : lisez le bracelet de P-0042.'],
    ['en', 'SCAN WRISTBAND', 'Before each sweep: scan the wristband of P-0042.']]) {
    await room.goto(`${h.url}room?language=${language}`);
    const said = room.locator('.room-word', { hasText: word });
    await said.waitFor();
    await room.locator('.room-hint', { hasText: hint }).waitFor();
    const box = await said.boundingBox();
    check(box.x >= 0 && box.x + box.width <= 1920, `${word} fits`);
    await h.look(room, `room-wristband-${language}`, { axe: false, fullPage: false });
  }
  // Another patient's is asked about and lets nothing begin, typed or scanned.
  check(await wristband(anna, 'P-0050'), 'swallowed');
  const asked = anna.getByRole('dialog', { name: 'This wristband is another patient’s' });
  await asked.getByRole('button', { name: 'P-0042 is on the couch' }).click();
  await form.getByLabel('Wristband of P-0042').fill('P-0050');
  await form.getByRole('button', { name: 'Confirm' }).click();
  await anna.getByRole('alert')
    .getByText('this is not the wristband of P-0042, whose session is open').waitFor();
  equal((await h.api(anna, 'scan/start', 'POST')).status, 409, 'still not');
  // Its own, on another screen than that of the sweep.
  await bob.goto(`${h.url}#/status`);
  check(await wristband(bob, 'P0042'), 'swallowed');
  await bob.getByRole('status').getByText('✓ P-0042 confirmed for the next sweep.').waitFor();
  await form.waitFor({ state: 'hidden' });
  await room.locator('.room-word', { hasText: 'READY' }).waitFor();
  h.tell('moved z 8 HFS');
  await press();
  await room.locator('.room-hint', { hasText: 'scan the wristband of P-0042' }).waitFor();
  equal((await h.api(anna, 'scan/start', 'POST')).status, 409, 'asked for again');
  await ok(engineer, 'settings', 'PUT', { scan_wristband: false });
  equal((await state()).session.id, session.id, 'the same session');
  equal((await state()).wants_wristband, false, 'nobody asks any more');
});

await h.step('without a session the button makes an unassigned scan that says so', async () => {
  const { session } = await state();
  await ok(anna, 'treatment/close', 'POST', { session_id: session.id });
  await h.acknowledge(anna, bob, clara);
  await room.locator('.room-word', { hasText: 'NO SESSION' }).waitFor();
  equal(await room.locator('.room').getByText('NO SESSION').count(), 1, 'it is said once');
  await h.look(room, 'room-no-session', { axe: false, fullPage: false });
  await anna.goto(`${h.url}#/scan`);
  await press();
  await room.locator('.verdict', { hasText: 'UNASSIGNED SCAN' }).waitFor();
  await anna.locator('.verdict', { hasText: 'UNASSIGNED SCAN' }).waitFor();
  await h.look(anna, 'result-unassigned');
});

await h.step('three sweeps of a phantom judge the sensor, and a reset of its profile asks again',
  async () => {
  await engineer.goto(`${h.url}#/repeats`);
  await engineer.getByText('This sensor has not been judged yet').waitFor();
  const made = engineer.locator('.sweeps li');
  const judge = engineer.getByRole('button', { name: 'Judge the three sweeps' });
  for (let n = await made.count(); n < 3; ++n) {
    equal(await judge.isVisible(), false, `${n} sweeps`);
    await engineer.getByRole('button', { name: `Start sweep ${n + 1} of 3` }).click();
    await made.nth(n).waitFor(kSlow);
  }
  await judge.click();
  await engineer.locator('.verdict.in_tolerance', { hasText: 'FIT' }).waitFor();
  await engineer.getByText('18 of 18 intervals of 95 % contain the truth').waitFor();
  await engineer.getByRole('row', { name: 'Longitudinal' }).getByText('0.34 mm').waitFor();
  await h.look(engineer, 'repeats-judged', { axe: false });
  const { serial, due } = await ok(engineer, 'sensor-repeats', 'GET');
  equal(due, false, 'nothing is asked for');
  for (const [what, id] of [[serial, 'store.repeats_too_few'], ['X', 'scan.other_sensor']]) {
    const { status, body } = await h.api(engineer, 'sensor-repeats', 'POST', { serial: what });
    equal(`${status} ${body.error_message.id}`, `409 ${id}`, what);
  }
  await ok(engineer, 'sensor-profile/reset', 'POST', { serial, password: h.password });
  await engineer.getByText('The profile was reset since').waitFor();
});

await h.step('eight tabs of one browser and three browsers: every one live, one stream a browser',
  async () => {
  const { session } = await state();
  check(session === null, 'none is open');
  const context = clara.context();
  const tabs = [clara];
  let streams = 0;
  const watch = (page) => {
    page.on('request', (one) => { if (one.url().endsWith('/events')) ++streams; });
    page.on('requestfinished', (one) => { if (one.url().endsWith('/events')) --streams; });
    page.on('requestfailed', (one) => { if (one.url().endsWith('/events')) --streams; });
  };
  for (let i = 1; i < 8; ++i) {
    const tab = await context.newPage();
    tab.setDefaultTimeout(20000);
    watch(tab);
    await tab.goto(`${h.url}#/scan`);
    await tab.getByRole('button', { name: /Start sweep|Scan again/ }).waitFor();
    tabs.push(tab);
  }
  await clara.goto(`${h.url}#/scan`);
  await bob.goto(`${h.url}#/scan`);
  await anna.goto(`${h.url}#/scan`);
  check(streams <= 1, `streams of the tabs: ${streams}`);
  h.tell('slow');
  h.tell('press');
  for (const page of [...tabs, bob, anna]) {
    await page.getByRole('button', { name: 'End sweep' }).waitFor(kSlow);
  }
  // The tab that has the stream goes: another one takes its place.
  await tabs.pop().close();
  await clara.getByRole('button', { name: 'Discard scan' }).click();
  for (const page of [...tabs, bob, anna]) {
    await page.locator('.headline', { hasText: 'Ready' }).waitFor(kSlow);
  }
  h.tell('fast');
  for (const page of tabs.slice(1)) await page.close();
});

await h.step('disconnected: states and buttons are off, and say how old they are', async () => {
  // Lists that never come hold up neither the state nor its age.
  const lists = /\/api\/v1\/(patients|scans)/;
  await bob.route(lists, () => {});
  await bob.goto(`${h.url}#/status`);
  await bob.locator('.hero .headline', { hasText: 'Ready' }).waitFor();
  await anna.getByRole('button', { name: 'Start sweep' }).waitFor();
  await clara.goto(`${h.url}#/patient/${patient}`);
  const open = clara.getByRole('button', { name: /^Start (treatment session|a new fraction)$/ });
  await open.waitFor();
  equal(await open.getAttribute('aria-disabled'), null, 'a session can be opened');
  h.server.kill('SIGSTOP');
  try {
    await Promise.all([anna, bob, clara].map(async (page) => {
      for (let i = 0; i < 8 && !(await page.locator('.disconnected').count()); ++i) {
        await h.setClockOn(page, 30);
        await page.locator('.disconnected').waitFor({ timeout: 2500 }).catch(() => {});
      }
    }));
    equal(await open.getAttribute('aria-disabled'), 'true', 'nor is a session opened');
    equal(await clara.getByRole('button', { name: 'Scan a new reference' })
      .getAttribute('aria-disabled'), 'true', 'nor one for a reference');
    await bob.locator('.hero').getByText(/^Last known: Ready, \d+ s ago$/).waitFor();
    equal(
      await bob.locator('.tile').first().evaluate((tile) => getComputedStyle(tile).borderTopStyle),
      'dashed', 'no tile looks current');
    await h.look(bob, 'status-disconnected');
    await anna.locator('main').getByText(/^Last known: Ready, \d+ s ago$/).waitFor();
    equal(await anna.locator('main [role=status]', { hasText: 'Last known' }).innerText(),
      'Last known: Ready', 'what is announced does not tick');
    const start = anna.getByRole('button', { name: 'Start sweep' });
    equal(await start.getAttribute('aria-disabled'), 'true', 'the button is off');
    await h.look(anna, 'scan-disconnected', { axe: false });
  } finally {
    h.server.kill('SIGCONT');
    await bob.unroute(lists);
  }
  for (const page of [anna, bob, clara]) {
    await page.locator('.disconnected').waitFor({ state: 'detached', ...kSlow });
  }
  // Nor do lists that fail.
  await bob.route(lists, (route) => route.abort());
  await bob.reload();
  await bob.locator('main').getByText('The appliance is not responding.').waitFor();
  await bob.locator('.hero .headline', { hasText: 'Ready' }).waitFor();
  await bob.unroute(lists);
  equal(await open.getAttribute('aria-disabled'), null, 'a session can be opened again');
});

await h.step('language and theme are on every screen; the room speaks as its session', async () => {
  const visitor = await h.person('visitor');
  await visitor.goto(h.url);
  await visitor.locator('.looks summary').click();
  const language = visitor.getByLabel('Language', { exact: true });
  await language.waitFor();
  await h.look(visitor, 'login-language');
  await language.selectOption('de');
  await visitor.getByRole('heading', { name: 'Anmelden' }).waitFor();
  await visitor.locator('.looks summary').click();
  await visitor.getByLabel('Darstellung', { exact: true }).selectOption('light');
  equal(await visitor.locator('html').getAttribute('data-theme'), 'light', 'at once');
  await visitor.reload();
  await visitor.getByRole('heading', { name: 'Anmelden' }).waitFor();
  equal(await visitor.locator('html').getAttribute('data-theme'), 'light', 'it stays');
  await visitor.context().close();

  await openOnPage(anna, 'P-0042', /^(Start treatment session|Start a new fraction)$/);
  await room.locator('.room-fraction').getByText('Fraction').waitFor();
  await anna.goto(`${h.url}#/scan`);
  await anna.locator('.looks summary').click();
  const kept = anna.waitForResponse((answer) => answer.url().endsWith('/session/preferences'));
  await anna.getByLabel('Language', { exact: true }).selectOption('es');
  await kept;
  await anna.getByRole('button', { name: 'Empezar el barrido' }).waitFor();
  equal(new URL(anna.url()).hash, '#/scan', 'the screen stays');
  await h.look(anna, 'scan-language');
  await room.locator('.room-fraction').getByText('Fracción').waitFor();
  await anna.locator('.looks summary').click();
  await anna.getByLabel('Idioma', { exact: true }).selectOption('en');
  await anna.getByRole('button', { name: 'Start sweep' }).waitFor();
  await anna.getByRole('button', { name: 'Close session' }).click();
  await room.locator('.room-word', { hasText: 'NO SESSION' }).waitFor();
});

await h.step('Spanish and light: complete, and kept for the account and for the room', async () => {
  await bob.goto(`${h.url}#/users`);
  await bob.getByLabel('Language').selectOption('es');
  await bob.getByRole('heading', { name: 'Cuentas' }).waitFor();
  const kept = bob.waitForResponse((answer) => answer.url().endsWith('/session/preferences'));
  await bob.getByLabel('Tema').selectOption('light');
  await kept;
  const elsewhere = await h.person('bob in another browser');
  await h.logIn(elsewhere, 'bob');
  await elsewhere.getByRole('link', { name: 'Estado', exact: true }).waitFor();
  equal(await elsewhere.evaluate(() => document.documentElement.dataset.theme), 'light',
    'his theme in another browser');
  await elsewhere.context().close();
  await bob.goto(`${h.url}#/result`);
  await bob.locator('.verdict').waitFor();
  await h.look(bob, 'result-spanish-light', { axe: false });
  await bob.goto(`${h.url}#/status`);
  await bob.locator('.tile').first().waitFor();
  await h.look(bob, 'status-spanish-light', { axe: false });
  await bob.reload();
  await bob.getByRole('link', { name: 'Estado', exact: true }).waitFor();
  await room.goto(`${h.url}room?language=es`);
  await room.locator('.room-word', { hasText: 'SIN SESIÓN' }).waitFor();
  await h.look(room, 'room-spanish', { axe: false, fullPage: false });
  // The room is dark, but its screen may be light; the choice stays.
  const theme = () => room.locator('html').getAttribute('data-theme');
  equal(await theme(), 'dark', 'as the room is');
  await room.goto(`${h.url}room?theme=light`);
  await room.locator('.room-word', { hasText: 'SIN SESIÓN' }).waitFor();
  equal(await theme(), 'light', 'as it was asked for');
  await room.goto(`${h.url}room`);
  await room.locator('.room-word', { hasText: 'SIN SESIÓN' }).waitFor();
  equal(await theme(), 'light', 'and as it stays');
  await room.emulateMedia({ colorScheme: 'light' });
  await room.goto(`${h.url}room?theme=auto`);
  await room.locator('.room-word', { hasText: 'SIN SESIÓN' }).waitFor();
  equal(await theme(), 'light', 'as the system is');
  await room.emulateMedia({ colorScheme: 'dark' });
  await room.locator('html[data-theme=dark]').waitFor();
  await room.emulateMedia({ colorScheme: null });
  await room.goto(`${h.url}room?theme=dark`);
  await room.locator('.room-word', { hasText: 'SIN SESIÓN' }).waitFor();
  // What the appliance says of its backups, too.
  h.tell('nobackup');
  await engineer.goto(`${h.url}#/users`);
  await engineer.getByLabel('Language').selectOption('es');
  await engineer.goto(`${h.url}#/settings`);
  await engineer.locator('.last-backup').getByText(
    'La última copia de seguridad falló: no hay carpeta de copias configurada').waitFor();
  await engineer.goto(`${h.url}#/users`);
  await engineer.getByLabel('Idioma').selectOption('en');
});

await h.step('the numbers of a patient as CSV, JSON and PDF', async () => {
  const get = (path) => anna.evaluate(async (where) => {
    const response = await fetch(`/api/v1/${where}`);
    return { status: response.status, text: await response.text() };
  }, path);
  const csv = await get(`patients/${patient}/numbers.csv`);
  equal(csv.status, 200, 'CSV');
  const [head, ...rows] = csv.text.trim().split('\r\n');
  check(head.startsWith('patient,scan,fraction'), head);
  check(rows.length >= 5, `${rows.length} rows`);
  equal((await get(`patients/${patient}/numbers.json`)).status, 200, 'JSON');
  check((await get(`patients/${patient}/report.pdf`)).text.startsWith('%PDF'), 'PDF');
});

await h.step('an unpaired display is out at once', async () => {
  await engineer.goto(`${h.url}#/users`);
  await removeScreen('couch side');
  await engineer.getByText('No screen is paired.').waitFor();
  await room.locator('.pair-code').waitFor(kSlow);
});

await h.finish();
