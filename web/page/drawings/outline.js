// SPDX-License-Identifier: Apache-2.0
// The outline of the reference over the camera's picture, so that a person can be laid in the same
// posture.
import { clear, h, hint, svg } from '../dom.js';
import { S } from '../words.js';

/// Around the image element. `draw` once it shows the picture to which the outline belongs.
export function referenceOutline(picture) {
  const drawing = svg('svg', { class: 'lying', role: 'img' });
  const note = hint();
  const hide = () => {
    drawing.toggleAttribute('hidden', true);
    note.hidden = true;
  };
  const draw = ({ lines, is_placed: isPlaced }, version) => {
    const text = S.status;
    const { naturalWidth: width, naturalHeight: height } = picture;
    // As the picture is fitted into its box.
    drawing.setAttribute('viewBox', `0 0 ${width} ${height}`);
    const path = lines.map((line) => line.map(([x, y], i) =>
      `${i ? 'L' : 'M'}${(x * width).toFixed(1)} ${(y * height).toFixed(1)}`).join(''));
    clear(drawing, ['halo', 'line'].map((part) =>
      svg('path', { class: part, d: path.join('') })));
    const words = !isPlaced ? text.outlineWaits
      : lines.length ? text.outline(version) : text.outlineOutside;
    drawing.setAttribute('aria-label', words);
    drawing.toggleAttribute('hidden', !lines.length);
    note.textContent = words;
    note.hidden = false;
  };
  hide();
  return { element: h('div', { class: 'camera' }, picture, drawing), note, draw, hide };
}
