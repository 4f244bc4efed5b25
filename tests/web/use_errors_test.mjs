// SPDX-License-Identifier: Apache-2.0
// What a person could get wrong with a result, each as a test: use_errors_test.mjs NODE_MODULES
// SERVER OUT_FOLDER CHROMIUM
import { Harness } from './harness.mjs';
import { beginShift } from './shift.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;
const { engineer, anna, bob, clara, scan } = await beginShift(h);

h.tell('swift');

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

await h.step('who goes to another screen before the words of the page have come gets there',
  async () => {
  let come;
  const coming = new Promise((ready) => { come = ready; });
  await anna.route(/words/, async (route) => {
    await coming;
    await route.continue();
  });
  await Promise.all([anna.waitForResponse(/\/api\/v1\/session$/),
    anna.reload({ waitUntil: 'commit' })]);
  await h.api(anna, 'session');  // by then the page has taken its own answer
  await anna.evaluate(() => { location.hash = '#/patients'; });
  await h.api(anna, 'session');
  come();
  await anna.getByRole('link', { name: 'PX-0001' }).waitFor();
  await anna.unroute(/words/);
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

await h.finish();
