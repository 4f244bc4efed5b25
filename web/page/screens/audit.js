// SPDX-License-Identifier: Apache-2.0
// The audit log: what was done, by whom and from where. It can be filtered and exported as CSV.
import { get } from '../api.js';
import { detailWords, subjectWords, userWords } from '../audit_words.js';
import { csvOf } from '../csv.js';
import { action, checkbox, clear, field, h, hint, redraw, row, saveBlob, table } from '../dom.js';
import { S, wordOf } from '../words.js';

const kPage = 100;

export async function showAudit(place) {
  const text = S.audit;
  const rows = [];  // of words
  const list = h('div', {});
  const count = h('p', { class: 'hint', role: 'status' });
  const filter = h('input', { type: 'search', autocomplete: 'off' });
  const views = checkbox(text.views, false, { onchange: () => startAgain() });
  const heads = [`${text.time} (UTC)`, text.user, text.action, text.subject, text.detail,
    text.address];
  let oldest = 0;
  const matching = () => {
    const wanted = filter.value.trim().toLowerCase();
    return rows.filter((words) => words.join(' ').toLowerCase().includes(wanted));
  };
  const draw = () => {
    const found = matching();
    count.textContent = text.shown(found.length, rows.length);
    redraw(list, found.length ? table(heads, found.map((words) =>
      row(...words.map((word) => word || S.none))), text.title) : hint(text.empty));
  };
  const load = async () => {
    const { entries } = await get(
      `audit?before=${oldest}&limit=${kPage}&views=${views.box.checked ? 1 : 0}`);
    for (const entry of entries) {
      rows.push([entry.time.replace('T', ' ').replace('Z', ''), userWords(entry),
        wordOf(text.actions, entry.action), subjectWords(entry), detailWords(entry),
        entry.address]);
      oldest = entry.number;
    }
    draw();
    more.hidden = entries.length < kPage;
  };
  const startAgain = () => {
    rows.length = 0;
    oldest = 0;
    load();
  };
  const more = action(text.more, load, {});
  const take = action(text.csv, async () => {
    saveBlob(new Blob([csvOf(heads, matching())], { type: 'text/csv' }), 'plumb-log.csv');
  }, {});
  filter.addEventListener('input', draw);
  clear(place, h('h1', {}, text.title), h('section', { class: 'card' },
    field(text.filter, filter, text.filterHint),
    views.element, count, list,
    h('div', { class: 'row' }, more, take, h('a', {
      class: 'button', href: '/api/v1/audit.jsonl', download: '',
    }, text.whole)), hint(text.wholeHint)));
  await load();
}
