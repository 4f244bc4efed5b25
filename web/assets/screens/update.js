import { get, live, may, post, postForFile } from '../api.js';
import { action, clear, h } from '../dom.js';
import { S } from '../strings.js';

export async function showUpdate(place) {
  const text = S.update;
  const body = h('div', {});
  const draw = async () => {
    const update = await get('update', true);
    const choices = update.bundles.map((name) => h('li', { class: 'row' }, h('span', {}, name), may('update') && action(text.install, () => post('update', { bundle: name }), { class: 'primary', 'aria-label': `${text.install} ${name}` })));
    clear(body, h('dl', { class: 'facts' }, h('dt', {}, text.installed), h('dd', {}, live.status?.version ?? S.none), update.slot && [h('dt', {}, text.slot), h('dd', {}, update.slot)]),
      update.installing && [h('p', {}, text.installing), h('progress', { max: 1, value: update.fraction, 'aria-label': text.installing })],
      update.supported ? [h('h2', {}, text.bundles), choices.length ? h('ul', { class: 'files' }, choices) : h('p', { class: 'hint' }, text.noBundles)] : h('p', { class: 'caution' }, `${text.unsupported}: ${update.message}`),
      update.supported && update.message && h('p', {}, update.message));
  };
  clear(place, h('h1', {}, text.title), h('section', { class: 'card' }, body),
    may('diagnostics') && h('section', { class: 'card' }, h('h2', {}, text.diagnostics), h('p', {}, text.diagnosticsText), action(text.download, async () => {
      const { blob, name } = await postForFile('diagnostics');
      const url = URL.createObjectURL(blob);
      h('a', { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10000);
    }, {})));
  await draw();
  return live.listen((kind) => { if (kind === 'update') draw().catch(() => {}); });
}
