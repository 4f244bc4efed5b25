// SPDX-License-Identifier: Apache-2.0
// The profile learned from good scans by the connected sensor unit, and its earlier versions.
import { get, may, post } from '../api.js';
import { clear, done, field, h, hint, localTime, row, rowHead, select, table } from '../dom.js';
import { signedForm } from '../signed_form.js';
import { S, said } from '../words.js';

const number = (value, digits) =>
  `${value < 0 ? '−' : ''}${Math.abs(value).toFixed(digits).replace('.', S.decimal)}`;
const kValues = [
  ['focal', ({ focal_x_scale: x, focal_y_scale: y }) => `${number(50 * (x + y - 2), 2)} %`],
  ['depthScale', ({ depth_scale: scale }) => `${number(100 * (scale - 1), 2)} %`],
  ['depthOffset', ({ depth_offset_m: offset }) => `${number(1000 * offset, 1)} mm`],
  ['readout', ({ color_readout_s: readout }) => `${number(1000 * readout, 1)} ms`],
];

function versionRow(one) {
  const text = S.profile;
  const known = one.num_sweeps > 0;
  return row(rowHead(one.version), localTime(one.made_at), text.causes[one.cause] ?? one.cause,
    known ? one.num_sweeps : S.none,
    ...kValues.map(([, words]) => (known ? words(one.values) : S.none)),
    known && h('a', {
      href: `/api/v1/sensor-profile/${one.version}/file`, download: '',
    }, text.download));
}

/// Needs the permission and the password again: every later scan starts from this profile.
function change({ serial, versions }, load) {
  const text = S.profile;
  const earlier = versions.slice(1).filter((one) => one.num_sweeps > 0);
  const choices = { reset: text.resetChoice };
  for (const { version } of earlier) choices[`v${version}`] = text.takeBackChoice(version);
  const choice = select(choices, 'reset', {});
  return signedForm({ class: 'form inline below' }, async (sign) => {
    const body = { serial, ...sign() };
    if (choice.value === 'reset') {
      await post('sensor-profile/reset', body);
      done(text.resetDone);
    } else {
      await post('sensor-profile/roll-back', { ...body, version: Number(choice.value.slice(1)) });
      done(text.takenBack);
    }
    await load();
  }, h('button', { class: 'danger' }, text.submit), field(text.which, choice));
}

export function profileCard() {
  const text = S.profile;
  const place = h('section', { class: 'card sensor-profile' });
  const load = async () => {
    const profile = await get('sensor-profile', true);
    const heads = [text.version, text.made, text.cause, text.sweeps,
      ...kValues.map(([name]) => text[name]), text.download];
    clear(place, h('h2', {}, text.title), hint(text.hint),
      profile.serial && h('p', {}, `${text.serial}: `, h('code', {}, profile.serial)),
      profile.why_none ? h('p', {}, text.noneKept, said(profile, 'why_none'))
        : profile.versions.length === 0 && h('p', {}, text.none),
      !profile.why_none && h('p', {}, h('a', { class: 'button', href: '#/repeats' },
        S.repeats.title)),
      profile.versions.length > 0 && table(heads, profile.versions.map(versionRow), text.title),
      profile.versions.length > 0 && may('settings') && change(profile, load));
  };
  load().catch((error) => clear(place, error.message));
  return place;
}
