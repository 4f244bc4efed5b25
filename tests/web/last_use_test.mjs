// SPDX-License-Identifier: Apache-2.0
// When a session was used last, as the page counts it, without a browser: last_use_test.mjs SOURCES
import assert from 'node:assert/strict';
import { join } from 'node:path';

const [sources] = process.argv.slice(2);
globalThis.window = { addEventListener() {} };
globalThis.document = { addEventListener() {}, documentElement: { lang: 'en' } };
let told = null;
let hear;
globalThis.BroadcastChannel = class {
  addEventListener(kind, take) { hear = (data) => take({ data }); }
  postMessage(message) { told = message; }
};
/// Requests that have not been answered yet, by their path.
const waiting = new Map();
globalThis.fetch = (path) => new Promise((answer) => {
  waiting.set(path, () => answer({ ok: true, status: 200, json: async () => ({}) }));
});
let time_ms = 1e6;
performance.now = () => time_ms;
Date.now = () => 1e9 + time_ms;

const { get, since_s: since, touchedAt } = await import(join(sources, 'web/page/api.js'));
const seconds = (s) => { time_ms += 1000 * s; };
const answer = async (path, request) => {
  waiting.get(`/api/v1/${path}`)();
  await request;
};

const slow = get('scans');
seconds(10);
const swift = get('status');
seconds(5);
await answer('status', swift);
assert.equal(since(touchedAt()), 5, 'from the request, not from its answer');
assert.deepEqual(told, { kind: 'used', age_s: 5 }, 'the other tabs hear how long ago');
told = null;
seconds(1);
await answer('scans', slow);
assert.equal(since(touchedAt()), 6, 'an answer that comes late makes the use no older');
assert.equal(told, null);

hear({ kind: 'used', age_s: 30 });
assert.equal(since(touchedAt()), 6, 'nor does another tab');
hear({ kind: 'used', age_s: 2 });
assert.equal(since(touchedAt()), 2, 'whose use was 2 s ago');
const quiet = get('checks', true);
await answer('checks', quiet);
assert.equal(since(touchedAt()), 2, 'what the page asks by itself is no use');
console.log('all well');
process.exit(0);
