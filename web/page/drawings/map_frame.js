// SPDX-License-Identifier: Apache-2.0
// A map as a picture that can be read: cropped, with axes, a scale bar, the edge of the region, and
// marks that say which way is which.
import { clear, fixed, h, svg } from '../dom.js';
import { cropOf, outlineOf } from './maps.js';
import { S } from '../words.js';

const kTick_m = 0.1;
const kMargin_m = 0.1;

const times = ([x, y], k) => [k * x, k * y];

/// Returns whose the marks on a picture are, and where they lie: {by, ways: {NAME: [x, y]}}, unit
/// vectors of the map, x right, y up.
///
/// The patient's sides were decided where the words were made: only a result whose body
/// "named_by" is "posture" shows head, feet, left and right, where the comparison found them. Else
/// the marks are the axes of the room, as in the words; where that is not known, the map's own.
/// @param room  Of the status: as it is known now.
/// @param body  Of the result: named_by, head_xy, left_xy, and the room as the comparison knew it;
///     none: nothing is the patient's.
export function compassOf(room, body, posture) {
  if (!room?.gantry_xy || !room.right_xy) return null;
  const known = room.known && body?.room_known !== false;
  // In the frame of the result's reference, which may lie otherwise in the room than today's.
  const gantry = body?.gantry_xy ?? room.gantry_xy;
  const right = body?.right_xy ?? room.right_xy;  // of a person who faces the gantry
  // Results before 0.2.0 have only the posture, which has a meaning where the room is known.
  if (body?.named_by === 'posture' && (body.head_xy || (known && posture))) {
    const head = body.head_xy ?? times(gantry, posture.startsWith('H') ? 1 : -1);
    const left = body.left_xy ?? times(right, posture === 'HFS' || posture === 'FFP' ? 1 : -1);
    const ways = { head, feet: times(head, -1), left, right: times(left, -1) };
    return { by: 'posture', ways: known ? { ...ways, gantry } : ways };
  }
  if (known && body?.named_by !== 'axes') {
    // The ticks of a map are the marker's x and y, which may differ from the room's axes.
    return { by: 'room', ways: { gantry, roomPlusX: right, roomMinusX: times(right, -1) } };
  }
  return {
    by: 'axes', ways: { plusX: [1, 0], minusX: [-1, 0], plusY: [0, 1], minusY: [0, -1] },
  };
}

/// The same where nothing has been compared yet: the sides that the posture of a plan has in a
/// known room, for people to check; else the axes.
export function compassOfPlan(room, posture) {
  if (!room?.known || !posture) return compassOf(room, null);
  const compass = compassOf(room, { named_by: 'posture' }, posture);
  return compass && { ...compass, by: 'plan' };
}

/// Name of the mark toward which a direction of the map points; nothing where none is near it.
export function markToward(compass, [x, y]) {
  const nearest = Object.entries(compass?.ways ?? {}).filter(([name]) => name !== 'gantry')
    .map(([name, [wx, wy]]) => [wx * x + wy * y, name]).sort(([a], [b]) => b - a)[0];
  if (nearest?.[0] > 0.8) return nearest[1];
  const { gantry } = compass?.ways ?? {};
  return gantry && gantry[0] * x + gantry[1] * y > 0.8 ? 'gantry' : null;
}

/// Says of what the marks are, where no comparison has found the patient's sides.
export const marksNote = (compass) => {
  const text = S.result;
  const note = {
    plan: text.marksOfPlan, room: text.marksOfRoom, axes: text.marksOfAxes,
  }[compass?.by];
  return note && h('p', { class: 'hint marks-note' }, note);
};

/// The part of the grid that is shown, in metres.
export function viewOf(grid, region) {
  const crop = region ? cropOf(region, grid, kMargin_m) : { left: 0, top: 0, width: 1, height: 1 };
  const width = grid.width * grid.step;
  const height = grid.height * grid.step;
  return {
    crop,
    x_min: grid.x_min + crop.left * width,
    y_max: grid.y_min + (1 - crop.top) * height,
    width: crop.width * width,
    height: crop.height * height,
  };
}

/// Shows the cropped part of what `draw(canvas)` paints for the whole grid.
export function drawCropped(canvas, view, draw) {
  const whole = document.createElement('canvas');
  draw(whole);
  const { crop } = view;
  const [left, top, width, height] = [crop.left * whole.width, crop.top * whole.height,
    crop.width * whole.width, crop.height * whole.height].map(Math.round);
  canvas.width = width;
  canvas.height = height;
  canvas.getContext('2d').drawImage(whole, left, top, width, height, 0, 0, width, height);
}

function axes(view, size) {
  const ticks = [];
  const label = (value) => fixed(1000 * value, 0);
  const first = (low) => Math.ceil(low / kTick_m - 1e-6);
  for (let i = first(view.x_min); i * kTick_m <= view.x_min + view.width; ++i) {
    const x = i * kTick_m - view.x_min;
    ticks.push(svg('line', { x1: x, x2: x, y1: view.height, y2: view.height - size / 2 }),
      // Not where the axis is named.
      i % 2 === 0 && x > size && x < view.width - 4.2 * size
        && svg('text', { x, y: view.height - 0.7 * size, class: 'middle' }, label(i * kTick_m)));
  }
  const y_min = view.y_max - view.height;
  for (let i = first(y_min); i * kTick_m <= view.y_max; ++i) {
    const y = view.y_max - i * kTick_m;
    ticks.push(svg('line', { x1: 0, x2: size / 2, y1: y, y2: y }),
      i % 2 === 0 && y > 2.4 * size && y < view.height - 2 * size
        && svg('text', { x: 0.7 * size, y: y + 0.35 * size }, label(i * kTick_m)));
  }
  return svg('g', { class: 'axes' }, ticks,
    svg('text', { x: view.width - 0.3 * size, y: view.height - 0.7 * size, class: 'end' }, 'x mm'),
    svg('text', { x: 0.7 * size, y: 1.1 * size }, 'y mm'));
}

const sizeOf = (view) => Math.max(view.width, view.height) / 42;

/// The gantry's mark stands outside the head's or feet's.
function marks(view, compass) {
  if (!compass) return null;
  const text = S.result.marks;
  const size = sizeOf(view);
  const place = (name, [dx, dy], along, down) => {
    const reach = Math.min(Math.abs(dx) > 0.3 ? view.width / 2 / Math.abs(dx) : Infinity,
      Math.abs(dy) > 0.3 ? view.height / 2 / Math.abs(dy) : Infinity);
    const x = view.width / 2 + dx * reach;
    const y = view.height / 2 - dy * reach;
    const wide = 0.35 * size * text[name].length + 1.2 * size;
    const side = wide + along * Math.abs(dx);
    const ticks = 2.2 * size;  // the numbers of the axis at the left edge
    return svg('text', {
      x: Math.max(side + ticks, Math.min(view.width - side, x)),
      y: Math.max(1.6 * size + down * Math.abs(dy),
        Math.min(view.height - 2.6 * size - down * Math.abs(dy), y)) + 0.35 * size,
      class: `way ${name}`, 'data-mark': name,
    }, text[name]);
  };
  // The gantry's mark stands at the very edge, head or feet within it.
  const within = [5.6 * size, 1.5 * size];
  return svg('g', { class: 'ways', 'data-by': compass.by },
    Object.entries(compass.ways).map(([name, way]) =>
      place(name, way, ...(name === 'head' || name === 'feet' ? within : [0, 0]))));
}

/// In place of the marks that a frame has.
export const setMarks = (box, view, compass) =>
  clear(box.querySelector('.all-ways'), marks(view, compass));

/// @param reach  Half the length of its arms.
export const crossAt = ([x, y], reach, look) => svg('path', {
  d: `M${x - reach} ${y}h${2 * reach}M${x} ${y - reach}v${2 * reach}`, class: look,
});

/// @param canvas  Shows the view; what stands over it is drawn beside it.
export function mapFrame({ grid, view, canvas, region, compass, isocentre, cross }) {
  const size = sizeOf(view);
  const outline = region && outlineOf(region, grid);
  const shift = svg('g', {
    transform: `translate(${-view.crop.left * grid.width * grid.step} `
      + `${-view.crop.top * grid.height * grid.step})`,
  }, outline && svg('path', { d: outline, class: 'outline' }),
  isocentre && crossAt([isocentre[0] - grid.x_min,
    grid.height * grid.step - (isocentre[1] - grid.y_min)], size, 'isocentre'));
  const bar = Math.min(0.1, view.width / 3);
  const drawing = svg('svg', {
    viewBox: `0 0 ${view.width} ${view.height}`, class: 'frame', 'aria-hidden': 'true',
    'font-size': size,
  }, shift, axes(view, size), svg('g', { class: 'all-ways' }, marks(view, compass)),
  svg('g', { class: 'scale-bar' },
    svg('path', {
      d: `M${view.width - size - bar} ${1.2 * size}v${0.6 * size}h${bar}v${-0.6 * size}`,
    }),
    svg('text', { x: view.width - size - bar / 2, y: 1.3 * size, class: 'middle' },
      S.result.scaleBar)));
  return h('div', { class: 'map-box' }, canvas, drawing, cross);
}
