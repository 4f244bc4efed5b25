// SPDX-License-Identifier: Apache-2.0
// What people draw on a set-up sheet: lines and dots over the photo, or over the outline of a body
// where there is none; by mouse, pen, finger or keys.
import { get, getOrNull, put } from '../../api.js';
import {
  action, arrowOf, clear, done, enable, h, hint, say, svg, warn,
} from '../../dom.js';
import { bodyOutline } from '../../help/drawings.js';
import { kDrawing } from '../../limits.js';
import { S } from '../../words.js';

const kStep = 0.02;      // of the picture, by an arrow key
const kApart = 0.004;    // a pointer that moves less adds nothing
const kSize = 1000;      // of the drawing's own units; the picture's sides may differ

/// The points as they are sent, and the lines that they make.
const linesOf = (points) => points.reduce((lines, [x, y, begins]) => {
  if (begins || !lines.length) lines.push([]);
  lines.at(-1).push([x, y]);
  return lines;
}, []);
const pointsOf = (lines) => lines.flatMap((line) =>
  line.map(([x, y], i) => [Number(x.toFixed(3)), Number(y.toFixed(3)), i === 0 ? 1 : 0]));

const at = ([x, y]) => `${Math.round(kSize * x)} ${Math.round(kSize * y)}`;
/// Light around dark, so that it is seen on any photo.
const drawn = (line) => {
  const d = line.length > 1 ? `M${line.map(at).join('L')}` : `M${at(line[0])}h0`;
  const kind = line.length > 1 ? 'line' : 'dot';
  return ['under', 'over'].map((layer) => svg('path', { d, class: `drawn ${kind} ${layer}` }));
};
const board = (properties, ...children) => svg('svg', {
  class: 'set-up-drawing', viewBox: `0 0 ${kSize} ${kSize}`, preserveAspectRatio: 'none',
  ...properties,
}, children);

const photoOf = ({ id, sheet_revision: revision }) => h('img', {
  // A photo that was taken again has another address, or the browser would show the one before.
  class: 'set-up-photo', alt: S.setUp.photoAlt, src: `/api/v1/patients/${id}/photo?of=${revision}`,
});
const groundOf = (patient) => (patient.has_photo ? photoOf(patient)
  : bodyOutline({ class: 'set-up-photo' }));

/// Photo and drawing of a sheet; null where there is neither.
export function setUpPicture(patient) {
  if (!patient.has_photo && !patient.has_drawing) return null;
  const over = board({ role: 'img', 'aria-label': S.setUp.drawingAlt });
  if (patient.has_drawing) {
    getOrNull(`patients/${patient.id}/drawing`).then((found) =>
      clear(over, linesOf(found?.points ?? []).map(drawn)));
  }
  return h('div', { class: 'set-up-picture' }, groundOf(patient), patient.has_drawing && over);
}

/// The board that is drawn on: { element, lines, undo, wipe }.
function drawingBoard(lines, changed) {
  const text = S.setUp;
  const state = { line: null, cursor: null };
  const overlay = board({ role: 'application', tabindex: 0, 'aria-label': text.drawOn });
  const draw = () => clear(overlay, lines.map(drawn), state.cursor
    && svg('path', { d: `M${at(state.cursor)}h0`, class: 'drawn cursor' }));
  const edited = () => { draw(); changed(); };
  const isFull = () => {
    const full = lines.flat().length >= kDrawing.points;
    if (full) warn(text.drawFull);
    return full;
  };
  const placeOf = (event) => {
    const { left, top, width, height } = overlay.getBoundingClientRect();
    const within = (value) => Math.max(0, Math.min(1, value));
    return [within((event.clientX - left) / width), within((event.clientY - top) / height)];
  };
  const undo = () => { if (lines.pop()) edited(); };
  overlay.addEventListener('pointerdown', (event) => {
    overlay.focus();
    if (!event.isPrimary || isFull()) return;
    state.cursor = null;
    state.line = [placeOf(event)];
    lines.push(state.line);
    overlay.setPointerCapture(event.pointerId);
    edited();
  });
  overlay.addEventListener('pointermove', (event) => {
    if (!state.line || !event.isPrimary) return;
    const [x, y] = placeOf(event);
    const [lastX, lastY] = state.line.at(-1);
    if (Math.hypot(x - lastX, y - lastY) < kApart || isFull()) return;
    state.line.push([x, y]);
    draw();
  });
  for (const end of ['pointerup', 'pointercancel']) {
    overlay.addEventListener(end, () => { state.line = null; });
  }
  overlay.addEventListener('keydown', (event) => {
    const direction = arrowOf(event);
    const isUndo = event.key.toLowerCase() === (event.ctrlKey ? 'z' : 'u');
    if (event.altKey || event.metaKey || (event.ctrlKey && !isUndo)) return;
    if (direction) {
      const by = kStep * (event.shiftKey ? 5 : 1);
      const [x, y] = state.cursor ?? [0.5, 0.5];
      state.cursor = [Math.max(0, Math.min(1, x + by * direction[0])),
        Math.max(0, Math.min(1, y - by * direction[1]))];
      draw();
      say(text.drawAt(...state.cursor.map((value) => Math.round(100 * value))));
    } else if (event.key === 'Enter' && !isFull()) {
      state.cursor ??= [0.5, 0.5];
      lines.push([[...state.cursor]]);
      edited();
      say(text.drawDot(lines.length));
    } else if (isUndo || event.key === 'Backspace' || event.key === 'Delete') {
      undo();
    } else {
      return;
    }
    event.preventDefault();
  });
  draw();
  return { element: overlay, undo, wipe: () => { lines.length = 0; edited(); } };
}

/// For who may change the sheet: opens the board over what is there. While it is drawn on, the
/// element has data-edited.
/// @param changed  Called when this begins.
export function drawingForm(patient, reload, changed) {
  const text = S.setUp;
  const place = h('div', {});
  const element = h('details', { class: 'below' }, h('summary', {}, text.draw), place);
  const open = async () => {
    const { points } = await get(`patients/${patient.id}/drawing`);
    const lines = linesOf(points);
    const edited = () => {
      element.dataset.edited = '';
      changed();
      for (const button of [undo, wipe]) enable(button, lines.length > 0);
    };
    const { element: overlay, ...acts } = drawingBoard(lines, edited);
    const asItIs = h('div', {});
    const undo = action(text.drawUndo, async () => acts.undo(), {});
    const wipe = action(text.drawClear, async () => acts.wipe(), {});
    const leave = async () => {
      delete element.dataset.edited;
      await reload();
    };
    const save = action(text.drawSave, async () => {
      await put(`patients/${patient.id}/drawing`,
        { points: pointsOf(lines), sheet_revision: patient.sheet_revision }).catch((error) => {
        if (error.status === 409) clear(asItIs, action(text.drawLeave, leave, {}));
        throw error;
      });
      done(text.drawSaved);
      await leave();
    }, { class: 'primary' });
    for (const button of [undo, wipe]) enable(button, lines.length > 0);
    const words = hint(text.drawHint);
    words.id = 'drawing-hint';
    overlay.setAttribute('aria-describedby', words.id);
    clear(place, words, h('div', { class: 'set-up-picture drawable' }, groundOf(patient), overlay),
      h('div', { class: 'row' }, save, undo, wipe, asItIs));
  };
  element.addEventListener('toggle', () => {
    if (element.open && !place.firstChild) open().catch((error) => warn(error.message));
  });
  return element;
}
