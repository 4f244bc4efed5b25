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
      rows.push(h('tr', {}, h('td', {}, entry.time.replace('T', ' ').replace('Z', '')), h('td', {}, entry.user || S.none), h('td', {}, entry.action), h('td', {}, entry.subject || S.none), h('td', {}, entry.detail || S.none), h('td', {}, entry.address || S.none)));
      oldest = entry.number;
    }
    clear(list, rows.length ? table([`${text.time} (UTC)`, text.user, text.action, text.subject, text.detail, text.address], rows, text.title) : h('p', { class: 'hint' }, text.empty));
    more.hidden = entries.length < kPage;
  };
  const more = action(text.more, load, {});
  clear(place, h('h1', {}, text.title), h('section', { class: 'card' }, list, more));
  await load();
}
