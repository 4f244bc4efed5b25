// SPDX-License-Identifier: Apache-2.0
// Templates, with which plans of one site begin: size of the region and tolerances.
import { get, post, put } from '../../api.js';
import {
  action, clear, done, field, h, hint,
} from '../../dom.js';
import { kReason } from '../../limits.js';
import { S } from '../../words.js';

const boundsOf = (region) => {
  const side = (k) => [Math.min(...region.map((p) => p[k])), Math.max(...region.map((p) => p[k]))];
  return [side(0), side(1)];
};

/// Region size and tolerances that plans of this patient's site begin with: to be used here, and to
/// be made of what is here.
export async function templateOf(patient, grid, model, inputs, drawing, changed) {
  const text = S.plan;
  const { site } = patient;
  if (!site) return hint(text.templateNoSite);
  const element = h('div', { class: 'plan-template' });
  const load = async () => {
    const { templates } = await get('templates', true);
    const found = templates.find((one) => one.site.toLowerCase() === site.toLowerCase());
    const advice = h('input', {
      autocomplete: 'off', maxlength: kReason.maxlength, value: found?.hint ?? '',
    });
    const use = found && action(text.templateUse, async () => {
      const [x, y] = model.isocentre ?? (model.region.length > 2
        ? boundsOf(model.region).map(([low, high]) => (low + high) / 2)
        : [grid.x_min + grid.width * grid.step / 2, grid.y_min + grid.height * grid.step / 2]);
      const [dx, dy] = [found.width_mm / 2000, found.height_mm / 2000];
      const round = (value) => Math.round(1000 * value) / 1000;
      drawing.set([[x - dx, y - dy], [x + dx, y - dy], [x + dx, y + dy], [x - dx, y + dy]]
        .map((point) => point.map(round)));
      inputs.shift.value = found.tolerance.shift_mm;
      inputs.rotation.value = found.tolerance.rotation_deg;
      // A planning CT says its posture itself.
      if (found.posture && !inputs.posture.disabled) {
        inputs.posture.value = found.posture;
        inputs.posture.dispatchEvent(new Event('change', { bubbles: true }));
      }
      changed();
    }, {});
    const keep = action(text.templateKeep, async () => {
      if (model.region.length < 3) throw new Error(text.templateNeedsRegion);
      const [width, height] = boundsOf(model.region)
        .map(([low, high]) => Math.round(1000 * (high - low)));
      await put('templates', {
        site, width_mm: width, height_mm: height,
        shift_tolerance_mm: Number(inputs.shift.value),
        rotation_tolerance_deg: Number(inputs.rotation.value),
        posture: inputs.posture.value, hint: advice.value.replace(/\s+/g, ' ').trim(),
      });
      done(S.saved);
      await load();
    }, {});
    const drop = found && action(text.templateRemove, async () => {
      await post('templates/remove', { site });
      await load();
    }, {});
    const says = found ? text.templateIs(found.width_mm, found.height_mm,
      found.tolerance.shift_mm, found.tolerance.rotation_deg) : text.templateNone;
    const more = found && (found.posture || found.hint) && hint(text.templateSays(
      text.postures[found.posture] ?? S.none, found.hint || S.none));
    clear(element, hint(says), more, field(text.templateHint, advice, text.templateHintHint),
      h('div', { class: 'row' }, use, keep, drop));
  };
  await load();
  return h('fieldset', {}, h('legend', {}, text.template(site)), element);
}
