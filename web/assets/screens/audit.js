import { get } from '../api.js';
import { action, clear, h, table } from '../dom.js';
import { S } from '../strings.js';

const kPage = 100;

export async function showAudit(place) {
  const text = S.audit;
  const rows = [];
  const list = h('div', {});
  let oldest = 0;
  const load = async () => {
    const { entries } = await get(`audit?before=${oldest}&limit=${kPage}`);
    for (const entry of entries) {
      const cell = (value) => h('td', {}, value || S.none);
      rows.push(h('tr', {}, cell(entry.time.replace('T', ' ').replace('Z', '')), cell(entry.user),
        cell(entry.action), cell(entry.subject), cell(entry.detail), cell(entry.address)));
      oldest = entry.number;
    }
    const heads = [`${text.time} (UTC)`, text.user, text.action, text.subject, text.detail,
      text.address];
    clear(list, rows.length ? table(heads, rows, text.title)
      : h('p', { class: 'hint' }, text.empty));
    more.hidden = entries.length < kPage;
  };
  const more = action(text.more, load, {});
  clear(place, h('h1', {}, text.title), h('section', { class: 'card' }, list, more));
  await load();
}
