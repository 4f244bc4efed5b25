// SPDX-License-Identifier: Apache-2.0
// The planning CT as reference on the page: planning_test.mjs NODE_MODULES SERVER OUT_FOLDER
// CHROMIUM
import { readdirSync } from 'node:fs';

import { Harness } from './harness.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;

const engineer = await h.person('engineer');
const planner = await h.person('planner', { width: 1280, height: 900 });
const second = await h.person('second', { width: 390, height: 844 });
let patient;
let plan;

/// Fills the form below the references and sends it.
async function send(page, names) {
  await page.locator('.planning-upload input[type=file]').nth(0)
    .setInputFiles(h.file(`data/${names}structures.dcm`));
  await page.locator('.planning-upload input[type=file]').nth(1)
    .setInputFiles(h.file(`data/${names}plan.dcm`));
  await page.getByRole('button', { name: 'Import' }).click();
}

await h.step('accounts and a patient', async () => {
  h.tell('checked');
  await h.firstStart(engineer);
  await h.addAccountByApi(engineer, 'planner', 'physicist');
  await h.addAccountByApi(engineer, 'second', 'physicist');
  await h.logIn(planner, 'planner');
  await h.logIn(second, 'second');
  patient = (await h.api(planner, 'patients', 'POST', { code: 'CT-1', site: 'thorax' })).body.id;
});

await h.step('a file that leaves the skin open is refused with the names', async () => {
  await planner.goto(`${h.url}#/patient/${patient}`);
  await planner.getByText('Reference from the planning CT').click();
  await send(planner, 'several-');
  await planner.getByText('several contours are marked as the external one').first().waitFor();
  await h.look(planner, 'planning-upload');
});

await h.step('structure set and plan become a draft whose isocentre is read-only', async () => {
  await planner.getByLabel('Contour of the skin').fill('BODY');
  await planner.locator('.planning-upload').getByLabel('Reason for the new reference')
    .fill('größer & neu');
  await send(planner, '');
  await planner.waitForURL(/#\/plan\//);
  await planner.locator('.planning-facts', { hasText: 'BODY' }).waitFor();
  equal(await planner.getByText('CT images, from z').count(), 0, 'a contour says where it ends');
  plan = planner.url();
  const axes = planner.locator('.triple input');
  for (let i = 0; i < 3; ++i) {
    equal(await axes.nth(i).inputValue(), '0', 'the frame has its origin there');
    check(await axes.nth(i).isDisabled(), 'it is the plan that states it');
  }
  check(await planner.getByText('Posture').locator('select').or(planner.locator('select'))
    .first().isDisabled(), 'the posture, too');
  equal(await planner.getByRole('button', { name: 'Pick' }).count(), 0, 'nothing to pick');
  await h.look(planner, 'planning-plan');
});

await h.step('the cuts move, and come back to the isocentre', async () => {
  for (const [name, label, axis, off] of [
    ['Axial cut, across the couch', 'Place of the axial cut along the couch (mm)', 'y', 60],
    ['Sagittal cut, along the couch', 'Place of the sagittal cut across the couch (mm)', 'x', -40],
  ]) {
    const place = planner.getByLabel(label);
    const figure = planner.locator('.side-view', { has: place });
    const skin = () => figure.locator('.skin-line').getAttribute('d');
    const cross = figure.locator('.isocentre-cross');
    const through = `${axis} 0 mm, through the isocentre`;
    await figure.getByText(`${name}: ${through}`).waitFor();
    equal(await figure.getByRole('img').getAttribute('aria-label'), `${name}: ${through}`, 'drawn');
    equal(await place.getAttribute('aria-valuetext'), through, 'what a screen reader says');
    equal(await cross.count(), 1, 'it begins at the isocentre');
    const first = await skin();
    check(first.length > 200, 'there is skin');
    await place.press('ArrowRight');
    await figure.getByText(`${name}: ${axis} 1 mm`, { exact: true }).waitFor();
    equal(await cross.count(), 0, 'no isocentre 1 mm beside it');
    await place.fill(`${off}`);
    const said = `${axis} ${off} mm`;
    await figure.getByText(`${name}: ${said}`, { exact: true }).waitFor();
    check(await skin() !== first, 'another cut shows other skin');
    await h.look(planner, `planning-cut-${axis}`);
    const back = figure.getByRole('button', { name: 'To the isocentre' });
    for (const target of [place, back]) {
      const { height } = await target.boundingBox();
      check(height >= 60, `for a hand in a glove: ${height} px`);
    }
    await back.press('Enter');
    await figure.getByText(`${name}: ${through}`).waitFor();
    equal(await skin(), first, 'the same cut again');
    // To both ends, where the map may be empty.
    for (const key of ['Home', 'End']) {
      await place.press(key);
      equal(await cross.count(), 0, key);
    }
    await back.click();
  }
  check(await planner.getByText('There are unsaved changes').count() === 0,
    'looking changes nothing');
});

await h.step('the surface of a planning CT is shown in three dimensions', async () => {
  const loaded = () => planner.evaluate(() => performance.getEntriesByType('resource')
    .filter(({ name }) => /\/assets\/mesh\./.test(name)).length);
  equal(await loaded(), 0, 'nobody has asked for it');
  await planner.getByRole('button', { name: 'Open the 3-D view' }).click();
  const mesh = planner.locator('canvas.mesh[data-ready=yes]');
  await mesh.waitFor({ timeout: 60000 });
  equal(await loaded(), 1, 'loaded only now');
  const drawn = () => mesh.evaluate(async (canvas) => {
    const { data } = await window.pixelsOf(canvas);
    let bright = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i] + data[i + 1] + data[i + 2] > 90) ++bright;
    return { bytes: canvas.toDataURL('image/png'), share: bright / (data.length / 4) };
  });
  const { bytes, share } = await drawn();
  check(share > 0.05, `a body is drawn: ${share}`);
  await planner.locator('.mesh-place').getByRole('button', { name: 'Top', exact: true })
    .press('Enter');
  check((await drawn()).bytes !== bytes, 'from above it looks another way');
  await mesh.scrollIntoViewIfNeeded();
  await h.look(planner, 'planning-mesh', { fullPage: false });
});

await h.step('clothing and the breath of the CT are stated, and signed', async () => {
  const clothing = planner.getByLabel('Clothing or covers (mm)');
  const breath = planner.getByLabel('Breath of the CT (mm)');
  equal(await clothing.inputValue(), '0', 'bare, unless somebody says otherwise');
  equal(await breath.inputValue(), '0', 'in the same breath');
  const save = planner.getByRole('button', { name: 'Save plan' });
  const put = [];
  planner.on('request', (request) => { if (request.method() === 'PUT') put.push(request.url()); });
  for (const wrong of ['-0.1', '30.1', '']) {
    await clothing.fill(wrong);
    await save.click();
    equal(await clothing.getAttribute('aria-invalid'), 'true', `"${wrong}" is refused`);
  }
  equal(put.length, 0, 'nothing was sent');
  await clothing.fill('4.5');
  await breath.fill('6');
  await h.look(planner, 'planning-stated');
  await save.click();
  await planner.getByText('Plan saved.').first().waitFor();
  equal(await clothing.inputValue(), '4.5', 'stored');
  const { body } = await h.api(planner, `references/${plan.split('/').pop()}`);
  equal([body.plan.clothing_mm, body.plan.ct_breathing_mm].join(), '4.5,6', 'as it was stated');
});

await h.step('another physicist signs it', async () => {
  await second.goto(plan);
  await second.locator('.planning-facts').waitFor();
  await second.getByRole('button', { name: 'Review and approve' }).click();
  await second.locator('.summary .planning-facts', { hasText: 'BODY' }).waitFor();
  equal(await second.getByText('below the couch').count(), 0, 'a CT shows no couch');
  for (const stated of ['±4.5 mm', '±6 mm']) {
    await second.locator('.summary dd', { hasText: stated }).first().waitFor();
  }
  equal(await second.locator('.summary input[type=range]').count(), 2, 'the cuts move here, too');
  await second.getByRole('button', { name: 'Open the 3-D view' }).click();
  await second.locator('canvas.mesh[data-ready=yes]').waitFor({ timeout: 60000 });
  await h.look(second, 'planning-summary-phone');
  await h.sign(second);
  await second.getByText('approved by second').first().waitFor();
});

await h.step('the review in German', async () => {
  await second.evaluate(() => {
    for (const who of ['login', 'second']) localStorage.setItem(`plumb-language-${who}`, 'de');
  });
  await second.reload();
  await second.getByText('Axialer Schnitt, quer zum Tisch: y 0 mm, durch das Isozentrum')
    .first().waitFor();
  await second.getByText('Atem des CT (mm)').first().waitFor();
  await h.look(second, 'planning-plan-german-phone');
  await second.evaluate(() => {
    for (const who of ['login', 'second']) localStorage.removeItem(`plumb-language-${who}`);
  });
  await second.reload();
  await second.getByText('Axial cut, across the couch').first().waitFor();
});

/// Sweeps once in the session that is open, and returns the scan.
async function sweep(page) {
  h.tell('moved z 8 HFS');
  await page.goto(`${h.url}#/scan`);
  await page.getByRole('button', { name: /Start sweep|Scan again/ }).click();
  await page.locator('.verdict').waitFor({ timeout: 60000 });
  return (await h.api(page, 'scans?limit=1')).body.scans[0];
}
const begin = (page) => page.getByRole('button',
  { name: /^Start (treatment session|a new fraction)/ });

await h.step('a position that was compared with it is captured as reference', async () => {
  await planner.goto(`${h.url}#/patient/${patient}`);
  await planner.getByRole('cell', { name: 'Planning CT' }).waitFor();
  equal(await planner.getByLabel('Compare with').count(), 0, 'nothing to choose from yet');
  await begin(planner).click();
  await planner.getByText('Compared with planning CT, version 1').waitFor();
  const scan = await sweep(planner);
  await planner.goto(`${h.url}#/result/${scan.id}`);
  await planner.getByText('this position becomes the new zero').waitFor();
  await planner.getByText('planning CT, version 1, ').waitFor();
  await planner.getByLabel('Reason for the new reference').fill('verified by imaging');
  await h.look(planner, 'capture');
  await planner.getByRole('button', { name: 'Capture as reference' }).click();
  await planner.waitForURL(/#\/plan\//);
  await planner.getByRole('heading', { name: 'Surface against planning CT' }).waitFor();
  equal(await planner.locator('dl.captured dd').count(), 6, 'the correction between both');
  await h.look(planner, 'captured-plan');
  await planner.getByRole('button', { name: 'Save plan' }).click();
  await second.goto(planner.url());
  await second.getByRole('button', { name: 'Review and approve' }).click();
  await second.locator('.summary dl.captured').waitFor();
  await h.look(second, 'captured-summary-phone');
  await h.sign(second);
  await second.getByText('approved by second').first().waitFor();
});

await h.step('a session compares with what was chosen for it', async () => {
  await h.api(planner, 'treatment/close', 'POST', { session_id: '' });
  await h.acknowledge(planner);
  await planner.goto(`${h.url}#/patient/${patient}`);
  const choice = planner.getByLabel('Compare with');
  equal(await choice.locator('option:checked').innerText(), 'captured surface, version 2',
    'the newest one, unless somebody says otherwise');
  await choice.selectOption({ label: 'planning CT, version 1' });
  await h.look(planner, 'choose-reference');
  await begin(planner).click();
  await planner.getByText('Compared with planning CT, version 1').waitFor();
  const [ct, surface] = (await h.api(planner, `patients/${patient}/references`)).body.references
    .sort((a, b) => a.version - b.version);
  equal((await sweep(planner)).reference_id, ct.id, 'what the scan was compared with');
  await planner.goto(`${h.url}#/scan`);
  equal(await planner.getByRole('dialog').count(), 0, 'no question about what was passed over');
  await h.look(planner, 'chosen-session');
  await planner.getByRole('button', { name: 'Compare with captured surface, version 2' }).click();
  await planner.getByText('Compared with captured surface, version 2').waitFor();
  const scan = await sweep(planner);
  equal(scan.reference_id, surface.id, 'what the next one was compared with');
  await planner.goto(`${h.url}#/result/${scan.id}`);
  await planner.getByRole('heading', { name: 'Surface against planning CT' }).waitFor();
  await h.look(planner, 'captured-result');
});

await h.step('without a contour the skin of CT images counts, at a stated threshold', async () => {
  const other = (await h.api(planner, 'patients', 'POST', { code: 'CT-IMAGES', site: '' })).body.id;
  await planner.goto(`${h.url}#/patient/${other}`);
  await planner.getByText('Reference from the planning CT').click();
  const threshold = planner.getByLabel('Threshold of the skin (HU)');
  equal(await threshold.isVisible(), false, 'shown only once images are chosen');
  const importAll = planner.getByRole('button', { name: 'Import', exact: true });
  const structures = planner.getByLabel('Structure set', { exact: true });
  await importAll.click();
  equal(await structures.getAttribute('aria-invalid'), 'true', 'it is missing');
  await planner.getByLabel('Take the skin from the CT images').check();
  equal(await structures.getAttribute('aria-invalid'), null, 'nobody asks for it any more');
  equal(await planner.locator('.field', { has: structures }).locator('.field-error').count(), 0,
    'nor is it called empty');
  equal(await threshold.inputValue(), '-300', 'where planning systems draw it');
  await planner.getByLabel('Plan', { exact: true }).setInputFiles(h.file('data/plan.dcm'));
  const images = readdirSync(h.file('data/images')).map((name) => h.file(`data/images/${name}`));
  const files = planner.getByLabel('CT images', { exact: true });
  await files.setInputFiles(images.toSpliced(images.length / 2, 1));
  await threshold.fill('1');
  await importAll.click();
  check(await threshold.evaluate((input) => !input.validity.valid), 'brighter than any skin');
  await threshold.fill('-350');
  await importAll.click();
  await planner.getByText('at least one is missing').first().waitFor();
  await files.setInputFiles(images);
  await h.look(planner, 'planning-images-upload');
  await importAll.click();
  await planner.waitForURL(/#\/plan\//);
  const facts = planner.locator('.planning-facts');
  await facts.getByText('CT images at -350 HU, ±').waitFor();
  await facts.getByText('only the frame of reference shows').waitFor();
  const ends = await facts.getByText(`${images.length} CT images, from z = `).innerText();
  const [first, last] = ends.match(/-?\d+\.\d(?= mm)/g).map(Number);
  check(last - first > 0, `both ends: ${ends}`);
  await facts.getByText('are added to the uncertainty along its normal').waitFor();
  await h.look(planner, 'planning-images-plan');
  await planner.getByRole('button', { name: 'Save plan' }).click();
  await second.goto(planner.url());
  await second.locator('.planning-facts').waitFor();
  await second.getByRole('button', { name: 'Review and approve' }).click();
  const summary = second.locator('.summary');
  await summary.getByText('the surface is the skin of the CT images at -350 HU').waitFor();
  const looked = summary.getByLabel('I have looked at the surface');
  check(await looked.evaluate((box) => box.required && !box.checked), 'a person has to say it');
  await looked.check();
  await h.look(second, 'planning-images-summary-phone');
  await h.sign(second);
  await second.getByText('approved by second').first().waitFor();
});

await h.step('another patient’s files are refused until a person has looked', async () => {
  h.tell('foreignfiles');
  await planner.goto(`${h.url}#/patient/${patient}`);
  await planner.getByText('Reference from the planning CT').click();
  const box = planner.getByLabel('The files are of this patient');
  equal(await box.isVisible(), false, 'nothing to confirm yet');
  await send(planner, '');
  await planner.getByRole('heading', { name: 'Another patient’s files?' }).waitFor();
  await planner.locator('.planning-upload .caution', { hasText: 'another Patient ID' }).waitFor();
  await h.look(planner, 'planning-other-patient');
  await box.check();
  await planner.getByRole('button', { name: 'Import' }).click();
  await planner.getByText('state the reason why').first().waitFor();
  await planner.locator('.planning-upload').getByLabel('Reason for the new reference')
    .fill('the clinic changed its numbers');
  await planner.getByRole('button', { name: 'Import' }).click();
  await planner.waitForURL(/#\/plan\//);
});

/// By another screen, so that nothing of the one before is taken for this one.
const openImport = async () => {
  await planner.goto(`${h.url}#/patients`);
  await planner.getByRole('heading', { name: 'Patients', exact: true }).waitFor();
  await planner.goto(`${h.url}#/patient/${patient}`);
  await planner.getByText('Reference from the planning CT').click();
};

await h.step('an import that ends when another screen is shown leaves that screen', async () => {
  h.tell('received');
  const sent = /patients\/.*\/planning\/received/;
  for (const [answer, said] of [
    [{ status: 201, json: { id: 'r1' } }, 'The planning CT of CT-1 has been imported'],
    [{ status: 409, json: { error: 'no room' } },
      'The planning CT of CT-1 has not been imported: no room']]) {
    let end;
    const ended = new Promise((resolve) => { end = resolve; });
    const asked = new Promise((resolve) => {
      planner.route(sent, async (route) => {
        resolve();
        await ended;
        await route.fulfill(answer);
      });
    });
    // Also where a question for the list has no answer.
    await planner.route('**/api/v1/planning/received', (route) => route.abort(), { times: 1 });
    await openImport();
    await planner.getByRole('row', { name: 'Plan THORAX' }).getByRole('button', { name: 'Import' })
      .click();
    await asked;
    await planner.goto(`${h.url}#/patients`);
    end();
    await planner.getByText(said).first().waitFor();
    equal(new URL(planner.url()).hash, '#/patients', 'what is shown stays');
    await planner.unroute(sent);
  }
});

await h.step('what the planning system sent is listed and imported from there', async () => {
  h.tell('received');
  await openImport();
  const received = planner.getByRole('table', { name: 'From the planning system' });
  await received.getByText('Plan THORAX').waitFor();
  const rowOf = (text) => received.locator('tbody tr', { hasText: text });
  equal(await rowOf('Plan THORAX').getByText('PLANNING, 192.168.1.20').count(), 1, 'from whom');
  equal(await rowOf('PELVIS').getByRole('button').count(), 0, 'another patient’s');
  equal(await rowOf('BREAST').getByText('its structure set was not received').count(), 1, 'alone');
  equal(await received.getByText('It cannot be read.').count(), 1, 'damaged');
  await planner.getByText('98 CT images were received.').waitFor();
  await h.look(planner, 'planning-received');
  await second.goto(`${h.url}#/patient/${patient}`);
  await second.getByText('Reference from the planning CT').click();
  await second.getByText('Plan THORAX').waitFor();
  await h.look(second, 'planning-received-phone');
  await planner.locator('.planning-upload').getByLabel('Reason for the new reference')
    .fill('a new plan');
  await rowOf('Plan THORAX').getByRole('button', { name: 'Import' }).click();
  await planner.getByRole('heading', { name: 'Another patient’s files?' }).waitFor();
  await planner.getByLabel('The files are of this patient').check();
  await rowOf('Plan THORAX').getByRole('button', { name: 'Import' }).click();
  await planner.waitForURL(/#\/plan\//);
  await openImport();
  await rowOf('Plan THORAX').getByRole('link', { name: 'a reference' }).waitFor();
});

await h.step('received images are offered where a plan has no contour', async () => {
  await openImport();
  const received = planner.getByRole('table', { name: 'From the planning system' });
  const breast = received.locator('tbody tr', { hasText: 'BREAST' });
  await breast.getByText('its CT images are here').waitFor();
  equal(await breast.getByRole('button').count(), 0, 'not without asking for them');
  await planner.getByLabel('Take the skin from the CT images').check();
  const take = breast.getByRole('button', { name: 'Import with 61 CT images' });
  await take.waitFor();
  equal(await received.getByRole('button', { name: 'with 61 CT images' }).count(), 1,
    'not for the plan that has a contour');
  await h.look(planner, 'planning-received-images');
  await planner.locator('.planning-upload').getByLabel('Reason for the new reference')
    .fill('no contour');
  await take.click();
  await planner.getByLabel('The files are of this patient').check();
  await take.click();
  await planner.waitForURL(/#\/plan\//);
  await planner.locator('.planning-facts').getByText('CT images at -300 HU, ±').waitFor();
});

await h.step('the worklist of today opens a session by a tap, and never changes one', async () => {
  const session = async () => (await h.api(planner, 'status')).body.session;
  const other = { code: 'OTHER-9', site: '' };
  const stranger = (await h.api(planner, 'patients', 'POST', other)).body.id;
  h.tell(`worklist ${patient}`);
  await planner.goto(`${h.url}#/patients`);
  const today = planner.getByRole('table', { name: 'Today' });
  await today.getByText('09:30').waitFor();
  await planner.getByText('2 appointments are of patients who are not known here').waitFor();
  const start = today.getByRole('button', { name: 'Start treatment session, CT-1' });
  // Whoever is open stays open: the list only says so.
  if (await session()) {
    await h.api(planner, 'treatment/close', 'POST', { session_id: (await session()).id });
  }
  await start.waitFor();
  await h.look(planner, 'worklist');
  await second.goto(`${h.url}#/patients`);
  await second.getByRole('table', { name: 'Today' }).waitFor();
  await h.look(second, 'worklist-phone');
  await h.api(planner, `patients/${stranger}/open`, 'POST', { purpose: 'reference', reason: '' });
  await today.getByText('The session of OTHER-9 is open: close it first.').waitFor();
  equal(await start.count(), 0, 'no way to change it');
  await h.look(planner, 'worklist-other');
  const others = await session();
  await today.getByRole('link', { name: 'CT-1' }).click();
  await planner.waitForURL(new RegExp(`#/patient/${patient}`));
  equal((await session()).id, others.id, 'no session was changed');
  await h.api(planner, 'treatment/close', 'POST', { session_id: others.id });
  await planner.goto(`${h.url}#/patients`);
  await planner.getByRole('button', { name: 'Add a patient' }).first().click();
  equal(await planner.evaluate(() => document.activeElement.dataset.code), '', 'its code is next');
  // A fraction of just now may go on: that is asked on the patient's page, and nothing is opened.
  await start.click();
  await planner.waitForURL(new RegExp(`#/patient/${patient}`));
  equal(await session(), null, 'nothing is open yet');
  const fraction = { purpose: 'fraction', reason: '' };
  await h.api(planner, `patients/${patient}/open`, 'POST', fraction);
  await h.api(planner, 'treatment/close', 'POST', { session_id: (await session()).id });
  await planner.goto(`${h.url}#/patients`);
  await start.click();
  await planner.waitForURL(/#\/scan/);
  const opened = await session();
  equal([opened.patient_id, opened.purpose].join(), `${patient},fraction`, 'whose session');
  await planner.goto(`${h.url}#/patients`);
  await today.getByText('session open').waitFor();
  equal(await start.count(), 0, 'it is open already');
});

await h.finish();
