// SPDX-License-Identifier: Apache-2.0
// What people who share a unit could get wrong at its forms, accounts and sessions, each as a test:
// shared_use_test.mjs NODE_MODULES SERVER OUT_FOLDER CHROMIUM
import { Harness } from './harness.mjs';
import { beginShift } from './shift.mjs';

const [modules, server, folder, chromium] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;
const { engineer, anna, bob, clara, addPatient, scan } = await beginShift(h);
h.tell('swift');
await scan();  // a fraction, without a motion

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
