// SPDX-License-Identifier: Apache-2.0
// Limits of control of a chart of individual values: what they do by chance (W. A. Shewhart).

const kLeast = 6;        // values before the newest: of fewer, the limits are chance themselves
const kPerRange = 2.66;  // 3 standard deviations in mean differences of neighbours

const meanOf = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

/// Mean and limits of all values but the newest, which is held against them; null of too few.
/// @param values  Oldest first.
export function controlLimits(values) {
  const before = values.slice(0, -1);
  if (before.length < kLeast) return null;
  const mean = meanOf(before);
  const range = meanOf(before.slice(1).map((value, i) => Math.abs(value - before[i])));
  return { mean, low: mean - kPerRange * range, high: mean + kPerRange * range };
}
