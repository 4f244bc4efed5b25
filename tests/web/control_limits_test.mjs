// SPDX-License-Identifier: Apache-2.0
// The control limits of the daily checks, without a browser: control_limits_test.mjs SOURCES
import assert from 'node:assert/strict';
import { join } from 'node:path';

const [sources] = process.argv.slice(2);
const { controlLimits } = await import(join(sources, 'web/page/drawings/control_limits.js'));

assert.equal(controlLimits([1, 2, 1, 2, 1, 9]), null, 'five before the newest are too few');
const limits = controlLimits([1, 2, 1, 2, 1, 2, 9]);
assert.equal(limits.mean, 1.5, 'without the newest');
assert.ok(Math.abs(limits.high - (1.5 + 2.66)) < 1e-12, 'neighbours differ by 1');
assert.ok(Math.abs(limits.low - (1.5 - 2.66)) < 1e-12);
assert.deepEqual(controlLimits([3, 3, 3, 3, 3, 3, 4]), { mean: 3, low: 3, high: 3 });
console.log('all well');
