// SPDX-License-Identifier: Apache-2.0
// Templates, with which plans of one site begin: size of the region and tolerances.
import { get, post, put } from '../../api.js';
import { action, clear, done, h, hint } from '../../dom.js';
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
      });
      done(S.saved);
      await load();
    }, {});
    const drop = found && action(text.templateRemove, async () => {
      await post('templates/remove', { site });
      await load();
    }, {});
    const says = found ? text.templateIs(found.width_mm / 10, found.height_mm / 10,
      found.tolerance.shift_mm, found.tolerance.rotation_deg) : text.templateNone;
    clear(element, hint(says), h('div', { class: 'row' }, use, keep, drop));
  };
  await load();
  return h('fieldset', {}, h('legend', {}, text.template(site)), element);
}
