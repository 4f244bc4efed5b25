// SPDX-License-Identifier: Apache-2.0
// The profile of the room's couch: what it can apply, and how its own display counts.
import { live, may, post } from '../api.js';
import {
  card, checkbox, clear, done, field, h, hint, select, signedTime,
} from '../dom.js';
import { kAxes } from '../numbers.js';
import { signedForm } from '../signed_form.js';
import { S, saidEach } from '../words.js';

/// With the password, by the version that was read.
function profileForm(couch) {
  const text = S.couch;
  const name = h('input', {
    required: true, maxlength: 32, autocomplete: 'off', value: couch.name,
  });
  const axes = select(text.axes, `${couch.num_axes}`, {});
  const unit = select({ mm: 'mm', cm: 'cm' }, couch.is_in_cm ? 'cm' : 'mm', {});
  const hides = checkbox(text.hides, couch.hides_rest, {});
  const wraps = checkbox(text.wraps, couch.wraps, {});
  const reverses = kAxes.map((axis) => ({
    axis,
    ...checkbox(text.ways[axis.name], couch.axes[axis.name].factor < 0, {}),
  }));
  return h('details', {}, h('summary', {}, text.change),
    signedForm({ class: 'form columns' }, async (sign) => {
      await post('couch', {
        version: couch.version, name: name.value.trim(), num_axes: Number(axes.value),
        is_in_cm: unit.value === 'cm', hides_rest: hides.box.checked,
        wraps: wraps.box.checked,
        ...Object.fromEntries(reverses.map(({ axis, box }) =>
          [`reverses_${axis.name}`, box.checked])),
        ...sign(),
      });
      done(S.saved);
    }, h('div', { class: 'row' }, h('button', { class: 'primary' }, text.sign)),
    field(text.name, name), field(text.numAxes, axes), field(text.unit, unit),
    h('fieldset', { class: 'reverses' }, h('legend', {}, text.reverses),
      hint(text.reversesHint), reverses.map(({ element }) => element)),
    wraps.element, hides.element));
}

/// @returns the card, and what ends it.
export function couchCard() {
  const text = S.couch;
  const place = h('div', {});
  let shown = null;
  const draw = () => {
    const couch = live.status?.couch;
    const key = couch && `${S.languageName} ${couch.version}`;
    if (!couch || key === shown) return;  // somebody may be typing
    shown = key;
    clear(place, couch.version === 0 ? h('p', {}, text.none)
      : [h('p', { class: 'judged-in' }, `✓ ${text.holds(couch.version, couch.signed_by,
        signedTime(couch.signed_at))}`),
      h('ul', { class: 'findings small' }, saidEach(couch, 'notes').map((one) =>
        h('li', {}, one)))],
    may('calibrate') && profileForm(couch));
  };
  draw();
  const end = live.listen(draw);
  return { place: card(text.title, hint(text.hint), place), end };
}
