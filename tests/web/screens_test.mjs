// SPDX-License-Identifier: Apache-2.0
// Every screen in every size, theme and language: screens_test.mjs NODE_MODULES SERVER OUT_FOLDER
// CHROMIUM
// A screen is loaded once and switched in place, by what a person would use: the window, the theme
// and the language. Layout, words and touch are measured in every size and language (colours change
// neither); axe runs on a phone and at 1280 px, at each in both languages and both themes. The
// languages are English and PLUMB_OTHER_LANGUAGE: German by default, whose words are the longest.
// With PLUMB_PICTURES=1 one picture of each screen in each size is kept, in themes and languages
// that take turns; without it, the pages are painted at a tenth of their size, which changes no
// layout.
import { readFileSync } from 'node:fs';
import { Harness, keepsPictures } from './harness.mjs';
import { englishTexts, faultsOfLayout } from './layout_checks.mjs';
import { kJargon, readCatalogues, wordsBeside, wordsIn } from './page_words.mjs';

// The fifth shows only the screens whose names it matches.
const [modules, server, folder, chromium, only] = process.argv.slice(2);
const h = await Harness.start({ modules, command: [server, 'FOLDER'], folder, chromium });
const { check, equal } = h;
const kTags = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'];
/// `full`: where axe runs with all of its rules, `contrast`: with the one of colours, which are the
/// same in both languages, as all else is in both themes. `open`: whether all that unfolds is
/// unfolded. `wall`: the screen on the room's wall.
const other = process.env.PLUMB_OTHER_LANGUAGE || 'de';
const kSizes = [
  { width: 360, height: 740, full: `${other} light`, contrast: 'en dark', open: true, touched: true,
    picture: `${other} light` },
  { width: 390, height: 844, touched: true, picture: 'en dark' },
  { width: 1280, height: 800, full: 'en dark', contrast: `${other} light`, open: true,
    tapped: true, picture: 'en light' },
  { width: 1920, height: 1080, wall: true, picture: `${other} dark` },
  { width: 3840, height: 2160, wall: true, open: true, picture: `${other} light` },
];
const kThemes = ['dark', 'light'];
const spent = {};
async function timed(what, work) {
  const begun = Date.now();
  const answer = await work();
  spent[what] = (spent[what] ?? 0) + Date.now() - begun;
  return answer;
}
const catalogues = readCatalogues(wordsBeside(modules));
const english = englishTexts(catalogues.en, catalogues[other]);
const [en, others] = await Promise.all(['en', other].map(
  async (code) => (await wordsIn(code, catalogues[code])).S));
check(english.whole.length > 300 && english.parts.length > 200, 'texts to look for');

// --- one screen

/// Requests that a page waits for; the stream and the camera never end.
const waiting = new WeakMap();
const debuggers = new WeakMap();
async function watch(page) {
  debuggers.set(page, await page.context().newCDPSession(page));
  const open = new Set();
  waiting.set(page, { open, last: Date.now() });
  const ends = (one) => { open.delete(one); waiting.get(page).last = Date.now(); };
  page.on('request',
    (one) => { if (!/\/events$|\/preview|\/surface$|\/claim$/.test(one.url())) open.add(one); });
  // A request of the document before is not always reported as ended when another one takes its
  // place. Changes of the address within a document have no request of their own.
  let document = null;
  page.on('request', (one) => {
    if (one.isNavigationRequest() && one.frame() === page.mainFrame()) document = one;
  });
  page.on('framenavigated', (frame) => {
    if (frame !== page.mainFrame() || !document) return;
    for (const one of open) if (one !== document) open.delete(one);
    document = null;
  });
  page.on('requestfinished', ends);
  page.on('requestfailed', ends);
  page.on('dialog', (dialog) => dialog.accept());
  return page;
}
async function settle(page) {
  const { open } = waiting.get(page);
  for (const begun = Date.now(); open.size > 0 || Date.now() - waiting.get(page).last < 60;) {
    check(Date.now() - begun < 30000, `answers: ${[...open].map((one) => one.url()).join(' ')}`);
    await new Promise((ready) => { setTimeout(ready, 20); });
  }
  await page.waitForFunction(
    ([a, b]) => ![a, b].some((text) => document.querySelector('main')?.innerText.includes(text)),
    [en.loading, others.loading]);
  await drawn(page);
}
/// Until the page is in its person's language again: a page that begins is in that of the browser.
async function reload(page, ready) {
  await page.reload();
  await page.locator(ready).first().waitFor({ timeout: 60000 });
  await settle(page);
}
/// Sets the size of the window. Unless pictures are kept, the page is painted at a tenth of it,
/// which is faster and changes no layout.
async function resize(page, { width, height }) {
  if (keepsPictures) {
    await page.setViewportSize({ width, height });
  } else {
    await debuggers.get(page).send('Emulation.setDeviceMetricsOverride',
      { width, height, deviceScaleFactor: 1, mobile: false, scale: 0.1 });
  }
}
/// Back to a desktop window, painted at full size, so that its controls can be clicked.
const restore = async (page) => {
  await debuggers.get(page).send('Emulation.clearDeviceMetricsOverride');
  await page.setViewportSize(kSizes[2]);
};
const drawn = (page) => page.evaluate(() => new Promise((ready) => {
  requestAnimationFrame(() => requestAnimationFrame(ready));
}));

async function axe(page, where, rules) {
  if (!await page.evaluate(() => 'axe' in window)) await page.evaluate(h.axe);
  const violations = await page.evaluate(async (runOnly) => {
    window.scrollTo(0, 0);
    const answer = await window.axe.run({ runOnly, resultTypes: ['violations'] });
    return answer.violations.map(({ id, help, nodes }) => `${id}: ${help}: `
      + nodes.slice(0, 3).map((node) =>
        `${node.target.join(' ')} (${node.failureSummary?.split('\n')[1]?.trim()})`).join('; '));
  }, rules);
  for (const violation of violations) h.failures.push(`axe, ${where}: ${violation}`);
}

async function measure(page, name, language, { touched = false, tapped = touched,
  wall = false, width }) {
  const faults = await page.evaluate(faultsOfLayout,
    { touched, tapped, wall, english: language === other ? english : null });
  for (const fault of faults) h.failures.push(`${name}, ${width} px, ${language}: ${fault}`);
}

async function lookAt(page, one, language) {
  for (const size of kSizes) {
    if (one.heavy && !size.full) continue;  // an emulated graphics card draws it
    const { width } = size;
    await resize(page, size);
    await page.evaluate((open) => {
      for (const folded of document.querySelectorAll('main details')) folded.open = open;
    }, size.open ?? false);
    await timed(`size ${width}`, () => (size.open ? settle(page) : drawn(page)));
    await timed('layout', () => measure(page, one.name, language, size));
    for (const theme of kThemes) {
      const now = `${language} ${theme}`;
      const isFull = size.full === now;
      const isKept = keepsPictures && size.picture === now && (!one.state || size.full);
      if (!isFull && !isKept && size.contrast !== now) continue;
      await setTheme(page, theme, one.printed);
      const where = `${one.name}, ${width} px, ${language}, ${theme}`;
      if (isFull || size.contrast === now) {
        await timed(isFull ? 'axe' : 'contrast',
          () => axe(page, where, isFull ? kTags : { type: 'rule', values: ['color-contrast'] }));
      }
      if (isKept) {
        await timed(`picture ${width}`,
          () => page.screenshot({ path: h.file(`${one.name}-${width}.jpg`), type: 'jpeg',
            quality: 80, fullPage: width < 1900, timeout: 90000 }));
      }
    }
  }
}

/// What is made for paper has one theme only and is looked at in print in place of the other.
async function setTheme(page, theme, printed) {
  await page.emulateMedia(
    { colorScheme: theme, media: printed && theme === 'light' ? 'print' : null });
  if (printed) return;
  await page.evaluate((name) => { document.documentElement.dataset.theme = name; }, theme);
}

let who = {};
/// Opens a screen in the given language. A screen whose address names the language (`url`) is
/// loaded from there; on every other screen the person's language setting is changed.
async function show(page, one, language) {
  if (page.url() === 'about:blank') await page.goto(h.url);
  await page.evaluate(([name, wanted]) => localStorage.setItem(`plumb-language-${name}`, wanted),
    [one.account ?? one.who, language]);
  if (one.url) {
    await page.goto(`${h.url}${one.url(language)}`);
  } else {
    const isOther = await page.evaluate(([hash, wanted]) => {
      const differs = document.documentElement.lang !== wanted;
      if (location.hash !== hash || !differs) location.hash = hash;
      return differs;
    }, [`#/${one.hash}`, language]);
    if (isOther) await page.evaluate(() => window.dispatchEvent(new Event('plumb-language')));
  }
  await page.locator(one.ready).first().waitFor({ timeout: 60000 });
  await settle(page);
  await one.prepare?.(page, language === other ? others : en);
  await settle(page);
  equal(await page.evaluate(() => document.documentElement.lang), language,
    `${one.name}: language`);
  equal(await page.locator(one.ready).first().isVisible(), true, `${one.name}: ${one.ready}`);
}

const kTreating = ['anna', 'reader', 'room'];
const shown = new Set();
async function look(one) {
  if (only && !new RegExp(only).test(one.name)) { shown.add(one.route); return; }
  const begun = Date.now();
  const page = who[one.who];
  // The language that it is in comes first: one switch for each screen.
  const now = await page.evaluate(() => document.documentElement.lang);
  await restore(page);
  await one.before?.(page);
  for (const language of now === other ? [other, 'en'] : ['en', other]) {
    if (language !== now) await one.between?.(page);
    await timed('show', () => show(page, one, language));
    if (kTreating.includes(one.who)) {
      const word = kJargon.exec(await page.locator('main').textContent())?.[0];
      if (word) h.failures.push(`${one.name}, ${language}: a technician reads “${word}”`);
    }
    await lookAt(page, one, language);
    await restore(page);
    await one.also?.(page, language, language === other ? others : en);
  }
  await one.leave?.(page);
  shown.add(one.route);
  console.log(`        ${one.name} (${Date.now() - begun} ms)`);
}

/// Screens of several people at once, those of one person one after the other.
async function lookAll(...screens) {
  await Promise.all([...new Set(screens.map((one) => one.who))].map(async (person) => {
    for (const one of screens.filter((each) => each.who === person)) await look(one);
  }));
}

// --- what there is to show

const engineer = await watch(await h.person('engineer', kSizes[2]));
const anna = await watch(await h.person('anna', kSizes[2]));
const bob = await watch(await h.person('bob', kSizes[2]));
const clara = await watch(await h.person('clara', kSizes[2]));
const visitor = await watch(await h.person('visitor', kSizes[2]));
const room = await watch(await h.person('room', kSizes[2]));
const reader = await watch(await h.person('reader', kSizes[2]));
who = { engineer, anna, bob, clara, visitor, room, reader };

const ok = (...asked) => h.ok(...asked);
const state = async () => (await h.api(bob, 'status')).body;
const inState = (name) => h.until(bob, `state ${name}`, (status) => status.state === name);
const sweep = (...commands) => h.sweepByApi(bob, ...commands);
async function sweepOfCheck(...commands) {
  const { checks } = await ok(bob, 'checks', 'GET');
  await ok(anna, 'checks/open', 'POST');
  for (const command of commands) h.tell(command);
  h.tell('press');
  for (const begun = Date.now();
    (await ok(bob, 'checks', 'GET')).checks.length === checks.length;) {
    check(Date.now() - begun < 30000, 'a check');
  }
}
const acknowledgeAll = () => h.acknowledge(engineer, anna, bob, clara);
async function openPatient(id, purpose) {
  await ok(anna, `patients/${id}/open`, 'POST',
    { purpose, reason: '', replaces: (await state()).session?.id ?? '' });
  await acknowledgeAll();
}
const kPlan = { region_m: [[0.5, 0.36], [0.72, 0.36], [0.72, 0.54], [0.5, 0.54]],
  isocentre_m: [0.6, 0.45, 0.08], posture: 'HFS', couch_markers: false, shift_tolerance_mm: 3,
  rotation_tolerance_deg: 1 };
/// A patient with a draft of a reference, planned by bob: { id, draft, scan }.
async function plannedPatient(code, site) {
  const { id } = await ok(anna, 'patients', 'POST', { code, site });
  await openPatient(id, 'reference');
  const scan = await sweep();
  const { draft_reference_id: draft } = await ok(anna, `patients/${id}`, 'GET');
  const { revision } = await ok(bob, `references/${draft}`, 'GET');
  await ok(bob, `references/${draft}/plan`, 'PUT', { ...kPlan, revision });
  return { id, draft, scan };
}

const app = readFileSync(new URL('../../web/page/screens/all_screens.js', import.meta.url), 'utf8');
const routes = [...app.matchAll(/^ {2}(\w+): \{ show: /gm)].map(([, name]) => name);
check(routes.length >= 11, `routes of all_screens.js: ${routes}`);

h.tell('swift');
await h.step('before anybody has an account', async () => {
  const url = () => '';
  await lookAll(
    { name: 'first-start', who: 'visitor', account: 'login', url, ready: 'input.code' });
  await h.firstStart(engineer);
  h.tell('checked');  // today, so that nothing is doubtful about a reference
  for (const [name, role] of [['anna', 'technician'], ['bob', 'physicist'], ['clara', 'physicist'],
    ['dora', 'technician']]) {
    await h.addAccountByApi(engineer, name, role);
  }
  for (const [page, name] of [[anna, 'anna'], [bob, 'bob'], [clara, 'clara'], [reader, 'anna']]) {
    await h.logIn(page, name);
  }
});

const kFault = {
  fault: 'the database /state/plumb.db is damaged (malformed): put a backup in its place, or '
    + 'move it and the folder scans away to start over',
  fault_message: {
    id: 'store.database_damaged', arguments: { file: '/state/plumb.db', why: 'malformed' } },
};
await h.step('while nothing was scanned, and for who has not come in', async () => {
  const url = () => '';
  const session = '**/api/v1/session';
  h.tell('overdue');
  h.tell('recorded 000007');
  await lookAll(
    {
      name: 'monitoring-record', route: 'monitoring', who: 'anna', hash: 'monitoring/000007-1',
      ready: 'dd',
    },
    { name: 'status-empty', route: 'status', who: 'anna', hash: 'status', ready: '.tile' },
    { name: 'patients-empty', route: 'patients', who: 'anna', hash: 'patients', ready: 'form' },
    { name: 'result-none', route: 'result', who: 'anna', hash: 'result', ready: '.result h1' },
    { name: 'check-none', route: 'check', who: 'anna', hash: 'check', ready: '.verdict.none' },
    { name: 'monitor-off', route: 'monitor', who: 'anna', hash: 'monitor', ready: '.live-advice' },
    { name: 'scan-no-session', route: 'scan', who: 'anna', hash: 'scan', ready: '.giant' },
    { name: 'users-own', route: 'users', who: 'anna', hash: 'users', ready: 'form' },
    { name: 'not-allowed', route: 'audit', who: 'anna', hash: 'audit', ready: '.screen > .card' },
    { name: 'login', who: 'visitor', account: 'login', url, ready: 'input[type=password]' },
    {
      name: 'login-refused', who: 'visitor', account: 'login', url, ready: 'input[type=password]',
      prepare: async (page) => {
        await page.locator('[name=name]').fill('anna');
        await page.locator('[name=password]').fill('another password');
        await page.locator('button.primary').click();
        await page.locator('#alert .alert').waitFor();
      },
    },
  );
  await visitor.route(session, (route) => route.fulfill({ status: 401,
    json: { error: 'log in first', setup_required: false, ...kFault, certificate: '' } }));
  await lookAll({ name: 'out-of-order', who: 'visitor', account: 'login', url, ready: '.caution' });
  await visitor.unroute(session);
  await visitor.route(session, (route) => route.abort());
  await lookAll(
    { name: 'no-connection', who: 'visitor', account: 'login', url, ready: 'main > .card' });
  await visitor.unroute(session);
  await visitor.goto(h.url);
  await visitor.locator('[name=name]').fill('dora');
  await visitor.locator('[name=password]').fill('first horse of the day');
  await visitor.locator('button.primary').click();
  await visitor.locator('input[readonly]').waitFor();
  await lookAll(
    { name: 'first-password', who: 'visitor', account: 'dora', url, ready: 'input[readonly]' });
});

let first, second, moved, refused;
await h.step('two patients: one with an approved reference and fractions, one with a draft',
  async () => {
  h.tell('checked');
  first = await plannedPatient('P-0042', 'tórax');
  const { digest, revision } = await ok(clara, `references/${first.draft}`, 'GET');
  await ok(clara, `references/${first.draft}/approve`, 'POST',
    { revision, digest, password: h.password });
  second = await plannedPatient('P-0050', 'pelvis');
  await openPatient(first.id, 'fraction');
  moved = await sweep('shoulder');
  await ok(anna, `scans/${moved}/accept-outside`, 'POST',
    { reason: 'hinchazón conocida', password: h.password }).catch(() => {});
  await sweep('moved x 8 HFS');
  refused = await sweep('stranger');
  h.tell('overdue');
  await sweep('cold', 'hurried');
  h.tell('warm');
  h.tell('checked');
});

await h.step('results', async () => {
  const last = await sweep('moved z 8 HFS');
  check(last !== moved, 'a result');
  await lookAll(
    { name: 'result-move', route: 'result', who: 'anna', hash: 'result',
      ready: '.screen:not(.is-old) .verdict.move' },
  );
  await sweep('unsure');
  await lookAll({ name: 'result-unsure', route: 'result', who: 'anna', hash: 'result',
    ready: '.screen:not(.is-old) .verdict.unsure' });
  await sweep('tolerated');
  await lookAll({ name: 'result-in-tolerance', route: 'result', who: 'anna', hash: 'result',
    ready: '.screen:not(.is-old) .verdict.in_tolerance' });
  await sweep('hole');
  await lookAll(
    { name: 'result-no-answer', route: 'result', who: 'anna', hash: 'result',
      ready: '.verdict.no_answer' },
    { name: 'result-review', route: 'result', who: 'bob', hash: `result/${moved}`,
      ready: '.is-old .old-note strong' },
    { name: 'result-3d', heavy: true, route: 'result', who: 'clara', hash: `result/${moved}`,
      ready: '.is-old .verdict', prepare: async (page) => {
        await page.locator('.mesh-place button').first().click();
        await page.locator('canvas.mesh[data-ready=yes]').waitFor({ timeout: 60000 });
      } },
    { name: 'result-reference', route: 'result', who: 'clara', hash: `result/${first.scan}`,
      ready: '.verdict.none' },
    { name: 'print', printed: true, who: 'reader', account: 'anna',
      url: (language) => `result?scan=${moved}&language=${language}`, ready: 'table' },
    { name: 'print-no-answer', printed: true, who: 'reader', account: 'anna',
      url: (language) => `result?scan=${refused}&language=${language}`, ready: '.verdict' },
  );
});

await h.step('patients, plans, the check, and what engineers see', async () => {
  await lookAll(
    { name: 'status', route: 'status', who: 'bob', hash: 'status', ready: 'tbody tr' },
    { name: 'patients', route: 'patients', who: 'bob', hash: 'patients', ready: 'tbody tr' },
    { name: 'statistics', route: 'statistics', who: 'bob', hash: 'statistics', ready: 'tbody tr' },
    { name: 'patient', route: 'patient', who: 'bob', hash: `patient/${first.id}`,
      ready: '.digits' },
    { name: 'plan', route: 'plan', who: 'bob', hash: `plan/${second.draft}`,
      ready: '.plan-grid .ways', leave: (page) => reload(page, '.plan-grid .ways') },
    { name: 'audit', route: 'audit', who: 'bob', hash: 'audit', ready: 'tbody tr' },
    { name: 'settings-read', route: 'settings', who: 'bob', hash: 'settings',
      ready: '.sensor-profile tbody tr' },
    {
      name: 'plan-approval', route: 'plan', who: 'clara', hash: `plan/${second.draft}`,
      ready: '.plan-grid .ways',
      prepare: async (page, text) => {
        await page.getByRole('button', { name: text.plan.summaryReview }).click();
        await page.locator('.summary').waitFor();
      },
    },
    { name: 'plan-approved', route: 'plan', who: 'anna', hash: `plan/${first.draft}`,
      ready: '.plan-grid .ways' },
    { name: 'users', route: 'users', who: 'engineer', hash: 'users', ready: 'tbody tr' },
    { name: 'settings', route: 'settings', who: 'engineer', hash: 'settings',
      ready: '.certificate' },
    { name: 'repeats-due', route: 'repeats', who: 'engineer', hash: 'repeats',
      ready: '.caution' },
    { name: 'update', route: 'update', who: 'engineer', hash: 'update', ready: '.bundle' },
  );
});

const roomUrl = (language) => `room?language=${language}`;
/// What the sweep advises, in the largest letters that there are.
async function everyAdvice(page, language, text) {
  const { words } = text.room;
  for (const [advice, word] of [['slower', words.slower], ['closer', words.closer],
    ['farther', words.farther], ['lost', words.tracking_lost], ['good', words.none],
    ['too_slow', words.computer_too_slow], ['enough', words.enough]]) {
    h.tell(`guide ${advice}`);
    await page.locator('.room-word', { hasText: word }).waitFor();
    await drawn(page);
    await measure(page, `room-sweep, ${advice}`, language, kSizes[2]);
  }
}
const inRoom = (name, ready) =>
  ({ name: `room-${name}`, state: true, who: 'room', account: 'room', url: roomUrl, ready });
const atScan = (name, ready, more) =>
  ({ name: `scan-${name}`, state: true, route: 'scan', who: 'anna', hash: 'scan', ready, ...more });
await h.step('the room’s display, and the scan from the start to the result and to every fault',
  async () => {
  await room.goto(`${h.url}room`);
  await look({ ...inRoom('pairing', '.pair-code'), state: false });
  await ok(engineer, 'displays', 'POST',
    { code: await room.locator('.pair-code').innerText(), name: 'camilla', password: h.password });
  await room.locator('.room-code').waitFor();
  await openPatient(first.id, 'fraction');
  await sweep('moved z 8 HFS');
  await look({ ...inRoom('move', '.verdict.move'), state: false });
  // The page of the sweep goes to the result by itself; only then is it asked for another screen.
  await anna.evaluate(() => { location.hash = '/scan'; });
  await anna.locator('.scan-grid .headline').waitFor();
  await sweep('hole');
  await anna.waitForURL(/#\/result$/);
  await lookAll(inRoom('no-answer', '.verdict.no_answer'),
    atScan('again', '.headline[data-state=result]'));
  h.tell('slow');
  h.tell('guide too_slow');
  h.tell('press');
  await inState('scanning');
  await lookAll({ ...inRoom('sweep', '.room-sweep'), also: everyAdvice },
    atScan('sweep', '.forming .live-number'));
  h.tell('guide');
  await ok(anna, 'cancel', 'POST');
  await inState('ready');
  await lookAll(inRoom('ready', '.room-word'),
    atScan('ready', '.headline[data-state=ready]', { state: false }));
  h.tell('swift');
  h.tell('toil');
  h.tell('press');
  await inState('working');
  await lookAll(inRoom('computing', '.room-word.info'),
    atScan('computing', '.headline[data-state=working]'));
  await ok(anna, 'cancel', 'POST');
  h.tell('swift');
  h.tell('unplug');
  await inState('no_sensor');
  await lookAll(inRoom('no-sensor', '.room-word.bad'),
    atScan('no-sensor', '.headline[data-state=no_sensor]'));
  h.tell('plug');
  h.tell('full');
  await inState('fault');
  await lookAll(inRoom('fault', '.room-word.bad'), atScan('fault', '.headline[data-state=fault]'));
  h.tell('emptied');
  await inState('ready');
  await lookAll(
    atScan('patient-changed', '.giant', {
      prepare: async (page, text) => {
        const acknowledge = page.locator('dialog button');
        const { session } = await state();
        const next = session.patient_id === first.id ? second.id : first.id;
        await ok(bob, `patients/${next}/open`, 'POST', {
          purpose: next === first.id ? 'fraction' : 'reference', reason: '', replaces: session.id,
        });
        await acknowledge.waitFor();
        // It was drawn in the other language if it was there already.
        await page.getByText(text.session.acknowledge).waitFor();
      },
      leave: (page) => page.locator('dialog button').click(),
      between: (page) => page.locator('dialog button').click(),
    }),
  );
  await look({ name: 'status-patient-changed', state: true, route: 'status', who: 'clara',
    hash: 'status', ready: '#session-changed .session-alert' });
  const { session } = await state();
  await ok(anna, 'treatment/close', 'POST', { session_id: session.id });
  await acknowledgeAll();
  await look(inRoom('no-session', '.room-word.bad'));
});

await h.step(
  'what cannot be acted on: another session, an overdue check, no connection, soon logged out',
  async () => {
  await openPatient(first.id, 'fraction');
  h.tell('overdue');
  await sweep('moved z 8 HFS');
  const { session } = await state();
  await ok(anna, 'treatment/close', 'POST', { session_id: session.id });
  await acknowledgeAll();
  const offline = async (page) => {
    await h.sleep(page, 0);
    for (let i = 0; i < 8 && !(await page.locator('body.disconnected').count()); ++i) {
      await h.setClockOn(page, 30);
      await page.locator('body.disconnected').waitFor({ timeout: 2500 }).catch(() => {});
    }
  };
  await lookAll(
    { name: 'result-closed-overdue', route: 'result', who: 'anna', hash: 'result',
      ready: '.is-old .flags li' },
    { name: 'patient-blocked', state: true, route: 'patient', who: 'bob',
      hash: `patient/${first.id}`, ready: '.reference-block' },
    { name: 'status-overdue', state: true, route: 'status', who: 'bob', hash: 'status',
      ready: '.tile.bad' },
    { name: 'menu', state: true, route: 'status', who: 'bob', hash: 'status', ready: '.tile',
      prepare: (page) => page.evaluate(
        () => document.getElementById('top').classList.add('menu-open')) },
    { name: 'idle-warning', state: true, route: 'status', who: 'clara', hash: 'status',
      ready: '.tile', prepare: async (page) => {
        await page.reload();
        await page.locator('.tile').first().waitFor();
        await h.setClockOn(page, 13.2 * 60);
        await page.locator('#idle button').waitFor();
      }, leave: (page) => reload(page, '.tile') },
    { ...atScan('disconnected', '.headline'), before: offline, leave: (page) => h.wake(page) },
  );
  h.tell('checked');
});

await h.step('the daily check and the room’s calibration, passed and failed; updates; settings '
  + 'that cannot be read', async () => {
  await sweepOfCheck();
  const { checks } = await ok(bob, 'checks', 'GET');
  await ok(bob, `checks/${checks[0].id}/baseline`, 'POST',
    { reason: 'first of this room', password: h.password });
  await sweepOfCheck();
  h.tell('board');
  for (let i = 0; i < 3; ++i) await sweepOfCheck();
  const atCheck = (name, ready, more) =>
    ({ name: `check-${name}`, route: 'check', who: 'bob', hash: 'check', ready, ...more });
  h.tell('installed');
  const why = 'what is stored cannot be read: the stored settings cannot be read: expected a JSON '
    + 'object, found none; it was changed from outside, or its disk failed. Put a backup of the '
    + 'database in its place, or save it again';
  const settings = '**/api/v1/settings', users = '**/api/v1/users';
  await lookAll(
    atCheck('passed', '.verdict.in_tolerance'),
    { name: 'update-restart', state: true, route: 'update', who: 'engineer', hash: 'update',
      ready: '.restart',
      prepare: (page) => page.locator('form select').last().selectOption('wipe') },
    {
      name: 'settings-unreadable', state: true, route: 'settings', who: 'engineer',
      hash: 'settings', ready: '.certificate',
      before: (page) => page.route(settings, (route) => (route.request().method() === 'GET'
        ? route.fulfill({ status: 500, json: { error: why } }) : route.continue())),
      leave: (page) => page.unroute(settings),
    },
    {
      name: 'users-without-directory', state: true, route: 'users', who: 'engineer',
      hash: 'users', ready: 'tbody tr',
      before: (page) => page.route(users, (route) => route.fulfill({ json: { directory: false,
        users: [{ name: 'anna', role: 'technician', disabled: false, second_factor: false,
          in_directory: true, created_at: '2026-01-05T08:00:00Z' }] } })),
      prepare: async (page, text) => {
        const user = page.getByRole('row', { name: 'anna' });  // the displays have rows, too
        await user.locator('summary').click();
        await user.getByLabel(text.users.newPassword).waitFor();
      },
      leave: (page) => page.unroute(users),
    },
  );
  h.tell('rolledback');
  await sweepOfCheck('markermoved');
  h.tell('roomdue');
  await lookAll(
    atCheck('failed', '.verdict.move'),
    { name: 'update-rolled-back', state: true, route: 'update', who: 'engineer', hash: 'update',
      ready: '.rolled-back' },
  );
});

await h.step('each check finds what it is for', async () => {
  const page = bob;
  await resize(page, kSizes[0]);
  await page.evaluate(([name, code]) => localStorage.setItem(`plumb-language-${name}`, code),
    ['bob', other]);
  await page.goto(`${h.url}#/status`);
  await page.reload();
  await page.locator('.tile').first().waitFor();
  await settle(page);
  const faults = () => page.evaluate(faultsOfLayout, { touched: true, english });
  equal((await faults()).join('; '), '', 'nothing at first');
  const [padding, notice] = await page.evaluate(() =>
    [parseFloat(getComputedStyle(document.documentElement).scrollPaddingTop),
      document.querySelector('.notice').offsetHeight]);
  check(padding > notice,
    `what has the focus is scrolled to below the notice: ${padding} of ${notice} px`);
  for (const [kind, tag, style, text] of [
    ['sideways', 'p', 'width: 400px', 'ancho'],
    ['out of view', 'p', 'position: fixed; left: 350px; white-space: nowrap',
      'fuera de la ventana'],
    ['cut off', 'p', 'width: 60px; overflow: hidden; white-space: nowrap',
      'demasiado largo para esto'],
    ['sticks out', 'p', 'width: 40px; border: 1px solid; white-space: nowrap', 'demasiado largo'],
    ['overlap', 'p', 'position: absolute; top: 120px; left: 20px',
      'encima de lo que hay debajo, en toda su anchura'],
    ['small', 'button', 'padding: 0; min-height: 0; width: 20px; height: 20px', 'x'],
    ['raw', 'p', '', 'no_answer'], ['raw', 'p', '', 'hace undefined s'],
    ['raw', 'p', '', 'más de {limit} mm'], ['English', 'p', '', en.scan.start],
    ['English', 'p', '', `${en.session.openedBy('anna')}`], ['English', 'p', '', 'what it is'],
  ]) {
    await page.evaluate(([name, css, words]) => {
      const element = document.createElement(name);
      element.id = 'fault';
      element.style.cssText = css;
      element.textContent = words;
      document.querySelector('main').append(element);
    }, [tag, style, text]);
    const found = await faults();
    check(found.some((fault) => fault.startsWith(`${kind}:`)),
      `${kind} of “${text}”, found ${found.join('; ')}`);
    await page.evaluate(() => document.getElementById('fault').remove());
  }
  equal((await faults()).join('; '), '', 'nothing at the end');
  const before = h.failures.length;
  await page.evaluate(() => {
    document.querySelector('.tile h2').style.color = '#555';
    document.documentElement.dataset.theme = 'dark';
  });
  await axe(page, 'a faint title', { type: 'rule', values: ['color-contrast'] });
  await page.evaluate(() => document.querySelector('main')
    .append(Object.assign(document.createElement('input'), { type: 'text' })));
  await axe(page, 'a field without a name', kTags);
  const found = h.failures.splice(before);
  check(found.some((one) => /faint title: color-contrast/.test(one))
    && found.some((one) => /without a name: label/.test(one)), `axe: ${found.join('; ')}`);
});

await h.step('every screen of the page has been seen', async () => {
  equal(routes.filter((name) => !shown.has(name)).join(), '', 'routes without a case');
});

console.log(JSON.stringify(spent));
await h.finish();
