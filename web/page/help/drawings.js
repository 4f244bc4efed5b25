// SPDX-License-Identifier: Apache-2.0
// Help in place: how to sweep, where markers go, how the board lies. Drawn here, so that they have
// the colours of the theme; what they show is in words below each of them.
import { h, svg } from '../dom.js';
import { S } from '../words.js';

const rect = (x, y, width, height, kind, rx = 3) =>
  svg('rect', { x, y, width, height, rx, class: `help-${kind}` });
const path = (d, kind) => svg('path', { d, class: `help-${kind}` });
const ellipse = (cx, cy, rx, ry) => svg('ellipse', { cx, cy, rx, ry, class: 'help-body' });
const label = (x, y, words, anchor = 'middle') =>
  svg('text', { x, y, 'text-anchor': anchor, class: 'help-label' }, words);

/// A body on its back from above, its head to the left.
const bodyFromAbove = () => [rect(30, 55, 300, 70, 'couch', 8), ellipse(66, 90, 17, 15),
  rect(86, 66, 124, 48, 'body', 20), rect(200, 68, 112, 18, 'body', 9),
  rect(200, 94, 112, 18, 'body', 9)];

/// For what is drawn on it.
export const bodyOutline = (properties) =>
  svg('svg', { viewBox: '10 40 340 100', 'aria-hidden': 'true', ...properties }, bodyFromAbove());

/// On both sides, one about every 35 cm.
const markers = () => [40, 110, 180, 250, 320].flatMap((x, i) => [
  rect(x - 7, i % 2 ? 22 : 28, 14, 14, 'marker', 0),
  rect(x - 7, i % 2 ? 144 : 138, 14, 14, 'marker', 0)]);

const fromAbove = (hasPath) => svg('svg', { viewBox: '0 0 360 180', 'aria-hidden': 'true' },
  bodyFromAbove(), markers(),
  hasPath && [path('M50 90C62 58 84 58 96 90S130 122 146 90 178 58 194 90 228 122 244 90 276 58 '
    + '306 84', 'way'), path('M298 72l12 14-18 4', 'way')]);

const fromTheSide = () => svg('svg', { viewBox: '0 0 360 180', 'aria-hidden': 'true' },
  rect(30, 128, 300, 8, 'couch'), rect(150, 136, 36, 30, 'couch'),
  ellipse(66, 116, 13, 12), rect(82, 100, 130, 28, 'body', 14), rect(200, 110, 112, 18, 'body', 9),
  path('M14 150h18M322 92h18M330 158h18', 'edge'),
  path('M66 36H300', 'way'), path('M291 29l13 7-13 7', 'way'),
  rect(130, 29, 26, 13, 'sensor'), path('M143 42L108 100M143 42L178 100', 'ray'),
  path('M143 48V96M138 56l5-9 5 9M138 88l5 9 5-9', 'edge'),
  label(190, 74, '70–100 cm', 'start'));

/// The board with its cross at the lasers and its arrow to the gantry, from above.
const board = () => svg('svg', { viewBox: '0 0 360 180', 'aria-hidden': 'true' },
  rect(30, 40, 250, 100, 'couch', 8), path('M310 30a22 60 0 0 1 0 120', 'edge'),
  rect(110, 52, 110, 76, 'paper'),
  [[118, 60], [194, 60], [118, 102], [194, 102]].map(([x, y]) => rect(x, y, 18, 18, 'marker', 0)),
  path('M10 90H300M165 10V170', 'laser'), path('M157 90h16M165 82v16', 'edge'),
  path('M226 90h34M251 83l10 7-10 7', 'way'), label(330, 170, S.help.gantry));

const figure = (drawing, words) => h('figure', { class: 'help' }, drawing,
  h('figcaption', {}, words));
const fold = (title, ...figures) => h('details', { class: 'help-fold' }, h('summary', {}, title),
  h('div', { class: 'help-figures' }, figures));

export const sweepHelp = () => fold(S.help.sweepTitle,
  figure(fromAbove(true), S.help.sweepAbove), figure(fromTheSide(), S.help.sweepSide));
export const markerHelp = () => fold(S.help.markersTitle,
  figure(fromAbove(false), S.help.markers));
export const boardHelp = () => fold(S.help.boardTitle, figure(board(), S.help.board));
