// SPDX-License-Identifier: Apache-2.0
// WebKitGTK's MiniBrowser on a screen in memory, by WebDriver (W3C) over HTTP: a process of the
// driver for each person, since it holds one session.
import { spawn } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { join } from 'node:path';
import { keepsPictures } from './harness.mjs';

const kPatience_ms = 60000;
const kElement = 'element-6066-11e4-a52e-4f735466cecf';  // the key of an element, by the standard
const kLook_ms = 50;

const after = (ms) => new Promise((ready) => { setTimeout(ready, ms); });
const children = [];
process.on('exit', () => children.forEach((child) => child.kill('SIGKILL')));

function begin(program, args, options = {}) {
  const child = spawn(program, args, { stdio: 'ignore', ...options });
  children.push(child);
  return child;
}

async function freePort() {
  const server = createServer();
  await new Promise((ready) => { server.listen(0, '127.0.0.1', ready); });
  const { port } = server.address();
  await new Promise((ready) => { server.close(ready); });
  return port;
}

/// A screen that nobody sees: its name, such as ":3".
export async function startScreen(xvfb) {
  const child = begin(xvfb, ['-displayfd', '3', '-screen', '0', '1920x1200x24', '-nolisten', 'tcp'],
    { stdio: ['ignore', 'ignore', 'ignore', 'pipe'] });
  const number = await new Promise((ready, fail) => {
    child.stdio[3].once('data', (data) => ready(`${data}`.trim()));
    child.once('exit', () => fail(new Error('Xvfb ended')));
  });
  return `:${number}`;
}

/// In the page: a visible element of a kind that a person would name. Texts begin as given.
function seek(kind, name) {
  const isSeen = (element) => element.getClientRects().length > 0
    && getComputedStyle(element).visibility !== 'hidden';
  const begins = (element) => element.textContent.replace(/\s+/g, ' ').trim().startsWith(name);
  const all = (selector) => [...document.querySelectorAll(selector)].filter(isSeen);
  // The topmost dialog keeps everything else from being used.
  const dialog = all('dialog[open]').pop();
  const inDialog = (element) => !dialog || dialog.contains(element);
  if (kind === 'field') {
    const label = all('label').filter(inDialog).find(begins);
    return label?.control ?? label?.querySelector('input, select, textarea') ?? null;
  }
  const selector = { button: 'button', link: 'a', text: 'main *, dialog *' }[kind];
  if (kind === 'text') {
    return all(selector).find((element) => element.innerText?.includes(name)) ?? null;
  }
  return all(selector).filter(inDialog).find(begins) ?? null;
}

export class Person {
  static async start({ driver, browser, display, folder, name, width, height }) {
    const home = join(folder, `home-${name}`);
    mkdirSync(home, { recursive: true, mode: 0o700 });
    const port = await freePort();
    begin(driver, ['--host=127.0.0.1', `--port=${port}`], { env: {
      ...process.env, DISPLAY: display, GDK_BACKEND: 'x11', HOME: home, XDG_RUNTIME_DIR: home,
      XDG_CACHE_HOME: home, XDG_DATA_HOME: home, XDG_CONFIG_HOME: home, LIBGL_ALWAYS_SOFTWARE: '1',
      LANG: 'en_US.UTF-8', LANGUAGE: 'en',
    } });
    const one = new Person();
    one.folder = folder;
    one.base = `http://127.0.0.1:${port}`;
    await one.until('the driver', () => one.call('GET', '/status').catch(() => null));
    const { sessionId, capabilities } = await one.call('POST', '/session', { capabilities: {
      alwaysMatch: {
        'webkitgtk:browserOptions': { binary: browser, args: ['--automation'] },
      } } });
    one.base += `/session/${sessionId}`;
    one.browser = `${capabilities.browserName} ${capabilities.browserVersion}`;
    await one.call('POST', '/window/rect', { width, height });
    return one;
  }

  async call(method, path, body) {
    const response = await fetch(`${this.base}${path}`, { method,
      body: method === 'POST' ? JSON.stringify(body ?? {}) : undefined });
    const { value } = await response.json();
    if (!response.ok) throw new Error(`${method} ${path}: ${value.error}: ${value.message}`);
    return value;
  }
  async until(what, holds, patience_ms = kPatience_ms) {
    for (const begun = Date.now(); ;) {
      const found = await holds();
      if (found) return found;
      if (Date.now() - begun > patience_ms) throw new Error(`expected: ${what}`);
      await after(kLook_ms);
    }
  }
  /// Runs a function in the page.
  run(work, ...args) {
    return this.call('POST', '/execute/sync',
      { script: `return (${work})(...arguments)`, args });
  }
  async find(kind, name) {
    const found = await this.until(`${kind} “${name}”`, () => this.run(seek, kind, name));
    return found[kElement];
  }
  goto(url) { return this.call('POST', '/url', { url }); }
  see(text) { return this.find('text', text); }
  /// A press of the pointer; again where the page has drawn the element anew meanwhile.
  async click(kind, name) {
    await this.until(`a press of ${name}`, async () => {
      const element = await this.find(kind, name);
      // The driver itself leaves it below the window.
      await this.run((one) => one.scrollIntoView({ block: 'center', behavior: 'instant' }),
        { [kElement]: element }).catch(() => {});
      return this.call('POST', `/element/${element}/click`).then(() => true, (error) => {
        if (/stale|intercepted|interactable/.test(error.message)) return false;
        throw error;
      });
    });
  }
  async fill(name, text) {
    const element = await this.find('field', name);
    await this.call('POST', `/element/${element}/clear`);
    await this.call('POST', `/element/${element}/value`, { text });
  }
  /// A request with the session of this page: { status, body }.
  api(path, method = 'GET', body = null) {
    return this.call('POST', '/execute/async', { script: `
      const [where, how, what, done] = arguments;
      (async () => {
        const { csrf_token } = await (await fetch('/api/v1/session')).json();
        const response = await fetch('/api/v1/' + where, { method: how,
          headers: { 'X-CSRF-Token': csrf_token,
            ...(what === null ? {} : { 'Content-Type': 'application/json' }) },
          body: what === null ? undefined : JSON.stringify(what) });
        done({ status: response.status, body: await response.json().catch(() => null) });
      })();`, args: [path, method, body] });
  }
  /// As playwright's, for the harness.
  async screenshot({ path }) {
    writeFileSync(path, Buffer.from(await this.call('GET', '/screenshot'), 'base64'));
  }
  async picture(name) {
    if (keepsPictures) await this.screenshot({ path: join(this.folder, `${name}.png`) });
  }
  close() { return this.call('DELETE', ''); }
}
