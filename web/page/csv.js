// SPDX-License-Identifier: Apache-2.0
// Tables that the page makes for spreadsheets.
import { S } from './words.js';

/// A field of a CSV file: one that a spreadsheet would take as a formula is text.
function csvField(value) {
  const text = String(value ?? '');
  const safe = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return `"${safe.replaceAll('"', '""')}"`;
}

/// As spreadsheets of the language read it (web/exchange/csv.hpp): after the mark of UTF-8, with
/// semicolons where the decimal sign is a comma.
export const csvOf = (heads, rows, decimal = S.decimal) => `\ufeff${[heads, ...rows]
  .map((words) => `${words.map(csvField).join(decimal === ',' ? ';' : ',')}\r\n`).join('')}`;
