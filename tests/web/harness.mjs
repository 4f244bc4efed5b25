// SPDX-License-Identifier: Apache-2.0
// Server, browser, screenshots, accessibility, and the list of what went wrong.
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { createInterface } from 'node:readline';

const kSkip = 77;
const kPassword = 'correct horse battery';
const kFirstPassword = 'first horse of the day';  // that an engineer gives a new account
const kPatience_ms = 30000;
/// Screenshots are only for people to look at; without them, WebScreens takes 360 instead of 479 s
/// of processor time.
export const keepsPictures = process.env.PLUMB_PICTURES === '1';
const kDelay_ms = Number(process.env.PLUMB_ANSWER_DELAY_MS ?? 0);
// Every size is in screens_test.mjs; painting a larger window would only take the others longer.
const kSize = { width: 1280, height: 800 };

/// In the page: the pixels of a canvas after its next frame.
function definePixelsOf() {
  window.pixelsOf = async (canvas) => {
    for (let i = 0; i < 3; ++i) await new Promise((ready) => { requestAnimationFrame(ready); });
    const copy = document.createElement('canvas');
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    return context.getImageData(0, 0, copy.width, copy.height);
  };
}

/// Runs in the page: switches off antialiasing in 3-D, for which the software renderer draws four
/// samples per pixel.
function switchOffAntialiasing() {
  const { prototype } = HTMLCanvasElement;
  const { getContext } = prototype;
  prototype.getContext = function get(kind, attributes) {
    return getContext.call(this, kind,
      kind.startsWith('webgl') ? { ...attributes, antialias: false } : attributes);
  };
}

/// Runs in the page: every answer comes that much later, as on a busy machine. What a test does not
/// wait for, it then misses each time.
function delayAnswers(delay_ms) {
  const { fetch } = window;
  window.fetch = async (...request) => {
    const answer = await fetch(...request);
    await new Promise((ready) => { setTimeout(ready, delay_ms); });
    return answer;
  };
}

/// Runs in the page: counts how often each of its clocks has ticked.
function countTicks() {
  const ticks = new Map();
  const [begin, end] = [window.setInterval, window.clearInterval];
  window.setInterval = (work, every_ms, ...rest) => {
    const id = begin.call(window, () => {
      work(...rest);
      ticks.set(id, ticks.get(id) + 1);
    }, every_ms);
    if (every_ms <= 1000) ticks.set(id, 0);
    return id;
  };
  window.clearInterval = (id) => {
    ticks.delete(id);
    end.call(window, id);
  };
  window.allHaveTicked = async () => {
    const before = new Map(ticks);
    while ([...ticks].some(([id, count]) => count === before.get(id))) {
      await new Promise((ready) => { setTimeout(ready, 20); });
    }
  };
}

export class Harness {
  /// @param command  Of the server, with its arguments; it names its address and the setup code on
  /// stdout or stderr. FOLDER is replaced.
  static async start({ modules, command, folder, chromium }) {
    if (!chromium || !existsSync(chromium)) {
      console.log('skipped: no browser (Debian package chromium-headless-shell)');
      // Continuous integration has everything: there a test that is left out counts as failed.
      process.exit(/^(0?)$/.test(process.env.PLUMB_REQUIRE_ALL ?? '') ? kSkip : 1);
    }
    const h = new Harness();
    const load = createRequire(join(modules, 'index.js'));
    h.axe = readFileSync(load.resolve('axe-core/axe.min.js'), 'utf8');
    rmSync(folder, { recursive: true, force: true });
    mkdirSync(join(folder, 'data'), { recursive: true });
    h.folder = folder;
    h.failures = [];
    h.password = kPassword;  // of every account, once its person has logged in
    h.firstPassword = kFirstPassword;
    h.fresh = new Set();  // accounts whose first password stands
    h.log = [];
    h.contexts = [];
    h.check = (holds, what) => { if (!holds) throw new Error(`expected: ${what}`); };
    h.equal = (found, expected, what) => h.check(found === expected,
      `${what}: ${JSON.stringify(expected)}, found ${JSON.stringify(found)}`);
    h.command = command.map((part) => part.replace('FOLDER', join(folder, 'data')));
    // Whatever goes wrong here, nothing stays behind.
    process.on('exit', () => h.server.kill('SIGKILL'));
    await h.launch(h.command, () => h.url && h.setupCode);
    // WebGL by SwiftShader, but not the page itself: painting it by an emulated graphics card took
    // fifteen times as long (3 pictures of 1920x1080 on a loaded machine: 87 s, so 6 s).
    const args = ['--no-sandbox', '--disable-dev-shm-usage', '--use-gl=angle',
      '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-gpu-compositing',
      '--disable-gpu-rasterization'];
    // WebKitGTK is driven by webdriver.mjs, one process for each person.
    if (/WebKitWebDriver$/.test(chromium)) {
      h.browser = { contexts: () => [], close: async () => {} };
      return h;
    }
    const { chromium: chrome, firefox } = load('playwright-core');
    // A Firefox as it is sold, by WebDriver BiDi.
    h.isFirefox = /firefox/.test(chromium);
    h.browser = await (h.isFirefox
      ? firefox.launch({ channel: 'moz-firefox', executablePath: chromium })
      : chrome.launch({ executablePath: chromium, args }));
    return h;
  }

  /// Until it has said what isReady() waits for.
  async launch([program, ...rest], isReady) {
    const server = spawn(program, rest, { stdio: ['pipe', 'pipe', 'pipe'] });
    this.server = server;
    server.on('exit', (code, signal) => {
      if (!this.finished && server === this.server) {
        console.error(`the server ended: ${code ?? signal}\n${this.log.join('\n')}`);
        process.exit(1);
      }
    });
    await new Promise((ready) => {
      for (const input of [server.stdout, server.stderr]) {
        createInterface({ input }).on('line', (line) => {
          this.log.push(line);
          this.url ??= /https?:\/\/127\.0\.0\.1:\d+\//.exec(line)?.[0];
          this.setupCode ??= /setup code: (\S+)/.exec(line)?.[1];
          if (isReady(line)) ready();
        });
      }
    });
  }

  /// As a power cut does; nothing runs until powerOn().
  async cutPower() {
    const { server } = this;
    this.server = { kill() {}, stdin: { write() {}, end() {} } };
    const gone = new Promise((ready) => { server.on('exit', ready); });
    server.kill('SIGKILL');
    await gone;
  }
  /// The same program at the same address.
  powerOn() {
    const { host } = new URL(this.url);
    return this.launch(this.command.map((part) => part.replace('127.0.0.1:0', host)),
      (line) => line.includes(this.url));
  }

  file(name) { return join(this.folder, name); }
  tell(command) { this.server.stdin.write(`${command}\n`); }

  /// A browser of one's own; complaints of its console are failures.
  async person(name, viewport = kSize, options = {}) {
    const context = await this.browser.newContext({ viewport, reducedMotion: 'reduce',
      ignoreHTTPSErrors: this.url.startsWith('https'), ...options });
    await context.addInitScript(definePixelsOf);
    await context.addInitScript(switchOffAntialiasing);
    await context.addInitScript(countTicks);
    if (kDelay_ms) await context.addInitScript(delayAnswers, kDelay_ms);
    const page = await context.newPage();
    page.setDefaultTimeout(kPatience_ms);
    page.on('pageerror', (error) => {
      // The style by which a screenshot hides the caret; Chromium does not report it as an error.
      if (this.isFirefox && error.message.includes('blocked an inline style')) return;
      this.failures.push(`${name}: script error: ${error.message}`);
    });
    page.on('console', (message) => {
      // The browser itself reports answers such as 401 and 404, which the page expects.
      if (message.type() === 'error' && !message.text().startsWith('Failed to load resource')) {
        this.failures.push(`${name}: console: ${message.text()}`);
      }
    });
    return page;
  }

  /// The first account, an engineer of that name.
  async firstStart(page, name = 'engineer') {
    await page.goto(this.url);
    await page.getByLabel('Setup code').fill(this.setupCode);
    await page.getByLabel('Name').fill(name);
    await page.getByLabel('Password', { exact: true }).fill(kPassword);
    await page.getByLabel('Password again').fill(kPassword);
    await page.getByRole('button', { name: 'Create account' }).click();
    await page.getByRole('navigation').waitFor();
  }

  /// Below what is to be approved.
  async sign(page, password = kPassword) {
    const signed = page.getByRole('region', { name: 'You are signing exactly this' });
    await signed.getByLabel('Your password').fill(password);
    // Where there are cautions.
    const reason = signed.getByLabel('Why it becomes the reference nevertheless');
    if (await reason.count()) await reason.fill('no better one is possible');
    await page.getByRole('button', { name: 'Sign and approve' }).click();
  }

  async logIn(page, name) {
    await page.goto(this.url);
    // Where somebody has a PIN.
    const byPassword = page.getByRole('button', { name: 'Log in with name and password' });
    await page.getByLabel('Name').or(byPassword).first().waitFor();
    if (await byPassword.count()) await byPassword.click();
    await page.getByLabel('Name').fill(name);
    const first = this.fresh.delete(name);
    await page.getByLabel('Password').fill(first ? kFirstPassword : kPassword);
    await page.getByRole('button', { name: 'Log in' }).click();
    if (first) {
      await page.getByLabel('Password that you were given').fill(kFirstPassword);
      await page.getByLabel('Your own password').fill(kPassword);
      await page.getByLabel('Password again').fill(kPassword);
      await page.getByRole('button', { name: 'Change password' }).click();
      // Not for the navigation: a narrow window folds it away.
      await page.getByLabel('Your own password').waitFor({ state: 'detached' });
    }
    await page.locator('#top a.brand').waitFor();
  }

  /// On the screen of accounts.
  async addAccount(page, name, role) {
    const card = page.locator('section',
      { has: page.getByRole('heading', { name: 'Add an account' }) });
    await card.getByLabel('Name').fill(name);
    await card.getByLabel('Role').selectOption(role);
    await card.getByLabel('Password', { exact: true }).fill(kFirstPassword);
    await card.getByLabel('Your password').fill(this.password);
    await card.getByRole('button', { name: 'Add' }).click();
    await page.getByRole('cell', { name, exact: true }).waitFor();
    this.fresh.add(name);
  }

  /// Fills the form; what comes of it is the caller's to see.
  async addPatient(page, code, site = '') {
    await page.goto(`${this.url}#/patients`);
    await page.getByLabel('Code', { exact: true }).fill(code);
    await page.getByLabel('Site').fill(site);
    await page.getByRole('button', { name: 'Add a patient' }).click();
  }

  /// Clicks the region's corners, in fractions of the map, and returns the map.
  async drawRegion(page, corners) {
    const map = page.getByRole('application');
    await map.scrollIntoViewIfNeeded();
    const box = await map.boundingBox();
    for (const [x, y] of corners) {
      await page.mouse.click(box.x + x * box.width, box.y + y * box.height);
    }
    await page.getByText(`${corners.length} corners`).waitFor();
    return map;
  }

  /// Like addAccount(), through the interface.
  async addAccountByApi(page, name, role) {
    const { status } = await this.api(page, 'users', 'POST',
      { name, role, password: kFirstPassword, own_password: this.password });
    this.equal(status, 201, `the account ${name}`);
    this.fresh.add(name);
  }

  /// A request with the session of that page's person: { status, body }.
  async api(page, path, method = 'GET', body = undefined) {
    return page.evaluate(async ([where, how, what]) => {
      const { csrf_token } = await (await fetch('/api/v1/session')).json();
      const headers = { 'X-CSRF-Token': csrf_token,
        ...(what === undefined ? {} : { 'Content-Type': 'application/json' }) };
      const response = await fetch(`/api/v1/${where}`,
        { method: how, headers, body: what === undefined ? undefined : JSON.stringify(what) });
      return { status: response.status, body: await response.json().catch(() => null) };
    }, [path, method, body]);
  }

  /// The body of an answer that is no refusal.
  async ok(page, path, method, body) {
    const answer = await this.api(page, path, method, body);
    this.check(answer.status < 300,
      `${method} ${path}: ${answer.status} ${JSON.stringify(answer.body)}`);
    return answer.body;
  }
  /// Waits for a status of the appliance.
  async until(page, what, holds) {
    for (const begun = Date.now(); ;) {
      const { body } = await this.api(page, 'status');
      if (holds(body)) return body;
      this.check(Date.now() - begun < 60000, what);
      await new Promise((ready) => { setTimeout(ready, 50); });
    }
  }
  /// A sweep to its result: the number of the scan.
  async sweepByApi(page, ...commands) {
    const before = (await this.api(page, 'status')).body.last_result?.id;
    for (const command of commands) this.tell(command);
    this.tell('press');
    const { last_result: last } = await this.until(page, 'a result',
      (status) => status.state === 'result' && status.last_result?.id !== before);
    return last.id;
  }

  /// On these pages the people have seen that the session was changed from elsewhere.
  async acknowledge(...pages) {
    await Promise.all(pages.map((page) => page.evaluate(async () => {
      const seen = () => JSON.parse(sessionStorage.getItem('plumb-session-seen') ?? '{}')?.id;
      const response = await fetch('/api/v1/status', { headers: { 'X-Plumb-Background': '1' } });
      if (!response.ok) return;  // nobody is logged in
      const { session } = await response.json();
      for (const begun = Date.now(); seen() !== session?.id;) {
        if (Date.now() - begun > 20000) {
          throw new Error(`the session that is known is ${seen()}, not ${session?.id}`);
        }
        document.querySelector('.session-alert button')?.click();
        await new Promise((ready) => { setTimeout(ready, 20); });
      }
    })));
  }

  /// The machine of that page's browser sleeps: no network, and while the time goes on its steady
  /// clock stands still.
  async sleep(page, seconds) {
    await page.context().setOffline(true);
    await this.setClockOn(page, seconds);
  }
  wake(page) { return page.context().setOffline(false); }
  setClockOn(page, seconds) {
    return page.evaluate((s) => {
      const now = Date.now.bind(Date);
      Date.now = () => now() + 1000 * s;
    }, seconds);
  }

  /// Until whatever the page does each second has been done once more.
  ticks(page) { return page.evaluate(() => window.allHaveTicked()); }

  /// What has the focus, by its text.
  focused(page) { return page.evaluate(() => document.activeElement.textContent); }

  async step(name, work) {
    const begun = Date.now();
    try {
      await work();
      console.log(`ok      ${name} (${Date.now() - begun} ms)`);
    } catch (error) {
      console.log(`FAILED  ${name}: ${error.message}`);
      this.failures.push(`${name}: ${error.message}`);
      let i = 0;
      for (const context of this.browser.contexts()) {
        for (const page of context.pages()) {
          await page.screenshot(
            { path: this.file(`failed-${name.replace(/\W+/g, '-')}-${i++}.png`) }).catch(() => {});
        }
      }
      await this.finish();  // the steps after it build on this one
    }
  }

  /// Takes a screenshot, but only with PLUMB_PICTURES=1.
  async picture(page, name, { fullPage = true } = {}) {
    if (keepsPictures) await page.screenshot({ path: this.file(name), fullPage, timeout: 90000 });
  }

  /// Takes a screenshot and checks the screen with axe. Leave axe out where screens_test.mjs checks
  /// the same screen.
  async look(page, name, { axe = true, fullPage = true } = {}) {
    await this.picture(page, `${name}.png`, { fullPage });
    if (!axe) return;
    // Through the debugger, not as a script element: the page's policy stays in force.
    if (!await page.evaluate(() => 'axe' in window)) await page.evaluate(this.axe);
    const look = async () => (await page.evaluate(() => window.axe.run({
      resultTypes: ['violations'],
      runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'best-practice'] }))).violations;
    let violations = await look();
    // The screen may be drawn anew under axe's eyes, and is then half a screen to it.
    if (violations.length) violations = await look();
    for (const { id, help, nodes } of violations) {
      const where = nodes.slice(0, 3).map((node) =>
        `${node.target.join(' ')} (${node.failureSummary?.split('\n')[1]?.trim()})`);
      this.failures.push(`axe, ${name}: ${id}: ${help}: ${where.join('; ')}`);
    }
  }

  async finish() {
    this.finished = true;
    await this.browser.close();
    this.server.stdin.end('quit\n');
    this.server.kill('SIGTERM');
    for (const failure of this.failures) console.log(`  - ${failure}`);
    console.log(this.failures.length ? `${this.failures.length} failures` : 'all well');
    process.exit(this.failures.length ? 1 : 0);
  }
}
