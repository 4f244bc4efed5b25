import { currentSession, get, live, may, post, postForFile, remove } from '../api.js';
import { action, clear, done, field, form, h } from '../dom.js';
import { S } from '../strings.js';

/// Sends a bundle with a bar; fetch tells nothing of what has left.
function upload() {
  const text = S.update;
  const input = h('input', { type: 'file', accept: '.raucb', required: true });
  const bar = h('progress', { max: 1, value: 0, 'aria-label': text.uploading, hidden: true });
  const send = (file) => new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', `/api/v1/update/bundles/${encodeURIComponent(file.name)}`);
    request.setRequestHeader('X-CSRF-Token', currentSession().csrf_token);
    request.setRequestHeader('Content-Type', 'application/octet-stream');
    request.upload.onprogress = (event) => { bar.value = event.loaded / event.total; };
    request.onload = () => (request.status < 300 ? resolve() : reject(new Error(JSON.parse(request.responseText || '{}').error ?? text.uploadFailed)));
    request.onerror = () => reject(new Error(text.uploadFailed));
    request.send(file);
  });
  return h('section', { class: 'card', hidden: true }, h('h2', {}, text.upload), h('p', { class: 'hint' }, text.uploadHint), form({ class: 'form inline' }, async () => {
    bar.hidden = false;
    try {
      await send(input.files[0]);
      input.value = '';
      done(text.uploaded);
    } finally {
      bar.hidden = true;
    }
  }, field(text.bundle, input), h('button', {}, text.send)), bar);
}

export async function showUpdate(place) {
  const text = S.update;
  const body = h('div', {});
  const sender = upload();
  const draw = async () => {
    const update = await get('update', true);
    const choices = update.bundles.map((name) => h('li', { class: 'row' }, h('span', { class: 'bundle' }, name), may('update') && [
      action(text.install, () => post('update', { bundle: name }), { class: 'primary', 'aria-label': `${text.install} ${name}`, disabled: update.installing }),
      action(text.remove, () => remove(`update/bundles/${name}`), { 'aria-label': `${text.remove} ${name}`, disabled: update.installing })]));
    clear(body, h('dl', { class: 'facts' }, h('dt', {}, text.installed), h('dd', {}, live.status?.version ?? S.none), update.slot && [h('dt', {}, text.slot), h('dd', {}, update.slot)]),
      update.installing && [h('p', { class: 'lead' }, text.installing, ' ', update.message), h('progress', { max: 1, value: update.fraction, 'aria-label': text.installing })],
      update.supported ? [h('h2', {}, text.bundles), choices.length ? h('ul', { class: 'files' }, choices) : h('p', { class: 'hint' }, text.noBundles)] : h('p', { class: 'caution' }, `${text.unsupported}: ${update.message}`),
      update.supported && !update.installing && update.message && h('p', { class: 'lead' }, update.message));
    sender.hidden = !update.supported || !may('update');
  };
  clear(place, h('h1', {}, text.title), h('section', { class: 'card' }, body), sender,
    may('diagnostics') && h('section', { class: 'card' }, h('h2', {}, text.diagnostics), h('p', {}, text.diagnosticsText), action(text.download, async () => {
      const { blob, name } = await postForFile('diagnostics');
      const url = URL.createObjectURL(blob);
      h('a', { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10000);
    }, {})));
  await draw();
  return live.listen((kind) => { if (kind === 'update') draw().catch(() => {}); });
}
