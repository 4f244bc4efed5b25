// SPDX-License-Identifier: Apache-2.0
// The unit's own authority, by which tablets trust its page.
import { h } from '../dom.js';
import { S } from '../words.js';

/// How a tablet comes to trust this unit, once.
export function authority(fingerprint) {
  const text = S.certificate;
  const { href } = new URL('/authority.crt', location.href);
  return h('details', { class: 'authority' }, h('summary', {}, text.authority),
    h('p', {}, text.authorityHint, ' ', h('code', {}, fingerprint)),
    h('p', {}, h('a', { class: 'button', href, download: 'plumb-authority.crt' },
      text.authorityLink)),
    h('ul', {}, Object.values(text.authoritySteps)
      .map((step) => h('li', {}, typeof step === 'function' ? step(href) : step))));
}
