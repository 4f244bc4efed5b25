// SPDX-License-Identifier: Apache-2.0
// The planning CT as reference on the page: planning_test.mjs NODE_MODULES SERVER OUT_FOLDER
// CHROMIUM
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

await h.step('another physicist signs it', async () => {
  await planner.getByRole('button', { name: 'Save plan' }).click();
  await second.goto(plan);
  await second.locator('.planning-facts').waitFor();
  await second.getByRole('button', { name: 'Review and approve' }).click();
  await second.locator('.summary .planning-facts', { hasText: 'BODY' }).waitFor();
  equal(await second.getByText('below the couch').count(), 0, 'a CT shows no couch');
  await h.look(second, 'planning-summary-phone');
});

await h.finish();
