// SPDX-License-Identifier: Apache-2.0
// The map of a plan on which region and isocentre are drawn, by pointer or by keys.
import { arrowOf, clear, h, say, svg } from '../../dom.js';
import { crossAt, mapFrame, setMarks, viewOf } from '../../drawings/map_frame.js';
import { cellAt, outlineOf, paintHeights } from '../../drawings/maps.js';
import { S } from '../../words.js';

const kStep_m = 0.005;
const kSnap_m = 0.012;
const kUndoSteps = 200;
const kFinger_px = 14;  // a corner is drawn smaller than a finger can aim
const kSame_m = 0.0005;
const distance = ([ax, ay], [bx, by]) => Math.hypot(ax - bx, ay - by);

/// A point of a plan, which is in metres, as people read and type it.
export const inMillimetres = (point) => point?.map((value) => Number((1000 * value).toFixed(3)));

/// Area in square centimetres and length of the outline in millimetres.
export function measure(region) {
  let area = 0;
  let round = 0;
  region.forEach(([ax, ay], i) => {
    const [bx, by] = region[(i + 1) % region.length];
    area += (ax * by - bx * ay) / 2;
    round += Math.hypot(bx - ax, by - ay);
  });
  return { cm2: Math.round(1e4 * Math.abs(area)), mm: Math.round(1000 * round) };
}

/// Height map with a polygon and a point that people draw, by pointer or keys. `model` is {region,
/// isocentre}; `changed` is called after each change.
/// @param body  The region where no corner is drawn; null: it is not known.
/// @param fixedPoint  The isocentre is not changed here.
export function editor({ grid, map, body, compass }, model, editable, changed,
  fixedPoint = false) {
  const text = S.plan;
  const canvas = h('canvas', { class: 'map', 'aria-hidden': 'true' });
  paintHeights(canvas, map, grid.step);
  const width = grid.width * grid.step;
  const height = grid.height * grid.step;
  const overlay = svg('svg', {
    viewBox: `0 0 ${width} ${height}`, class: 'draw', tabindex: '0', role: 'application',
    'aria-label': text.mapLabel,
  });
  const view = viewOf(grid, null);
  const box = mapFrame({ grid, view, canvas, compass, cross: overlay });
  box.style.setProperty('max-width', `${75 * width / height}vh`);
  // The crosshair is there once the keys have moved it.
  const state = {
    chosen: -1, grabbed: null, picking: false, onIsocentre: false, crosshair: null,
  };
  const before = [];  // for undo
  const remember = () => {
    before.push(JSON.stringify([model.region, model.isocentre]));
    if (before.length > kUndoSteps) before.shift();
  };
  const toMap = ([x, y]) => [x - grid.x_min, height - (y - grid.y_min)];
  const round = (value) => Math.round(value * 1000) / 1000;
  const fromEvent = (event) => {
    const area = overlay.getBoundingClientRect();
    return [round(grid.x_min + (event.clientX - area.left) / area.width * width),
      round(grid.y_min + (1 - (event.clientY - area.top) / area.height) * height)];
  };
  /// The corner that a pointer touches; nothing where it touches none.
  const cornerAt = (event) => {
    const { corner } = event.target.dataset ?? {};
    if (corner !== undefined) return Number(corner);
    if (event.pointerType !== 'touch') return -1;
    const reach = kFinger_px * width / overlay.getBoundingClientRect().width;
    const point = fromEvent(event);
    const away = model.region.map((other) => distance(point, other));
    const nearest = away.indexOf(Math.min(...away));
    return away[nearest] < reach ? nearest : -1;
  };
  /// A corner that is dragged lies straight beside its neighbours where it nearly does.
  const snapped = (point, i) => {
    const n = model.region.length;
    for (const other of [model.region[(i + n - 1) % n], model.region[(i + 1) % n]]) {
      for (const k of [0, 1]) if (Math.abs(point[k] - other[k]) < kSnap_m) point[k] = other[k];
    }
    return point;
  };
  const lengths = (points, size) => points.length > 1 && points.map(([ax, ay], i) => {
    if (i + 1 === points.length && points.length < 3) return null;
    const [bx, by] = points[(i + 1) % points.length];
    const mm = 1000 * Math.hypot(bx - ax, by - ay);
    return mm > 40 && svg('text', {
      x: (ax + bx) / 2, y: (ay + by) / 2, class: 'length', 'font-size': 1.6 * size,
    }, `${mm.toFixed(0)} mm`);
  });
  const whole = body && outlineOf(body, grid);
  const draw = () => {
    const points = model.region.map(toMap);
    const size = width / 110;
    clear(overlay,
      points.length < 3 && whole && svg('path', { d: whole, class: 'outline whole-body' }),
      points.length > 1 && svg(points.length > 2 ? 'polygon' : 'polyline', {
        points: points.map((point) => point.join(',')).join(' '), class: 'region',
      }),
      lengths(points, size),
      editable && points.map(([x, y], i) => svg('circle', {
        cx: x, cy: y, r: size, class: i === state.chosen ? 'corner chosen' : 'corner',
        'data-corner': i,
      })),
      model.isocentre && crossAt(toMap(model.isocentre), 2 * size,
        state.onIsocentre ? 'isocentre chosen' : 'isocentre'),
      state.crosshair && crossAt(toMap(state.crosshair), 3 * size, 'crosshair'));
  };
  const skinAt = (point) => {
    const cell = cellAt(grid, ...point);
    return cell < 0 || Number.isNaN(map.values[cell]) ? 0 : round(map.values[cell]);
  };
  const middleOfMap = [round(grid.x_min + width / 2), round(grid.y_min + height / 2)];
  const middle = () => {
    const n = model.region.length;
    const mean = (k) => round(model.region.reduce((sum, point) => sum + point[k], 0) / n);
    return n > 2 ? [mean(0), mean(1)] : middleOfMap;
  };
  /// Inserts it into the nearest edge, so that the outline does not cross itself.
  const addCorner = (point) => {
    const i = nearestEdge(model.region, point);
    model.region.splice(i, 0, point);
    return i;
  };
  const deleteCorner = () => {
    if (!model.region[state.chosen]) return;
    remember();
    model.region.splice(state.chosen, 1);
    state.chosen = Math.min(state.chosen, model.region.length - 1);
    update();
  };
  const moveCrosshair = ([dx, dy], by) => {
    const [x, y] = state.crosshair ?? middleOfMap;
    const within = (value, low, size) => round(Math.max(low, Math.min(low + size, value)));
    state.crosshair = [within(x + by * dx, grid.x_min, width),
      within(y + by * dy, grid.y_min, height)];
    draw();
    say(text.crosshairAt(...inMillimetres(state.crosshair)));
  };
  /// Adds a corner at the crosshair, which stays for the next one; takes the corner that is there.
  const enterCorner = () => {
    state.crosshair ??= middleOfMap;
    const there = model.region.findIndex((other) => distance(other, state.crosshair) < kSame_m);
    if (there < 0) {
      remember();
      const i = addCorner([...state.crosshair]);
      state.chosen = -1;
      update();
      say(text.corner(i + 1, ...inMillimetres(state.crosshair)));
    } else {
      state.chosen = there;
      update();
      say(text.corner(there + 1, ...inMillimetres(model.region[there])));
    }
  };
  /// The isocentre by keys: put on the skin, then moved at the height that it has.
  const keyOnIsocentre = (key, direction, by) => {
    if (key !== 'i' || !model.isocentre) remember();
    if (key === 'i') {
      state.onIsocentre = true;
      state.chosen = -1;
      model.isocentre ??= [...middle(), skinAt(middle())];
    } else if (direction) {
      const [x, y, z] = model.isocentre;
      model.isocentre = [round(x + by * direction[0]), round(y + by * direction[1]), z];
    } else {
      model.isocentre = null;
      state.onIsocentre = false;
    }
    update();
    say(model.isocentre ? text.isocentreAt(...inMillimetres(model.isocentre))
      : text.isocentreGone);
  };
  const update = () => { draw(); changed(); };
  const undo = () => {
    const last = before.pop();
    if (!last) return;
    const [region, isocentre] = JSON.parse(last);
    model.region.splice(0, model.region.length, ...region);
    model.isocentre = isocentre;
    state.chosen = Math.min(state.chosen, region.length - 1);
    update();
  };
  if (editable) {
    overlay.addEventListener('pointerdown', (event) => {
      overlay.focus();
      const point = fromEvent(event);
      const touched = cornerAt(event);
      remember();
      state.onIsocentre = false;
      state.crosshair = null;
      if (state.picking && !fixedPoint) {
        model.isocentre = [...point, skinAt(point)];
        state.picking = false;
        overlay.classList.remove('picking');
      } else if (touched >= 0) {
        state.chosen = touched;
        // A finger beside the corner does not move it before the finger moves.
        state.grabbed = model.region[touched].map((value, k) => value - point[k]);
        overlay.setPointerCapture(event.pointerId);
      } else {
        state.chosen = addCorner(point);
      }
      update();
    });
    overlay.addEventListener('pointermove', (event) => {
      if (!state.grabbed) return;
      const point = fromEvent(event).map((value, k) => round(value + state.grabbed[k]));
      model.region[state.chosen] = snapped(point, state.chosen);
      update();
    });
    overlay.addEventListener('pointerup', () => { state.grabbed = null; });
    overlay.addEventListener('keydown', (event) => {
      const chosen = model.region[state.chosen];
      const direction = arrowOf(event);
      const by = kStep_m * (event.shiftKey ? 10 : 1);
      const isDelete = event.key === 'Delete' || event.key === 'Backspace';
      const key = event.key.toLowerCase();
      const isUndo = key === (event.ctrlKey ? 'z' : 'u');
      // All other shortcuts are the browser's.
      if (event.altKey || event.metaKey || (event.ctrlKey && !isUndo)) return;
      const movesPoint = key === 'i'
        || (state.onIsocentre && model.isocentre && (direction || isDelete));
      if (!fixedPoint && movesPoint) {
        event.preventDefault();
        keyOnIsocentre(key, direction, by);
        return;
      }
      if (key === 'n' || key === 'enter' || key === 'escape') state.onIsocentre = false;
      if (event.key === 'Enter' || (direction && !chosen)) {
        event.preventDefault();
        if (direction) moveCrosshair(direction, by);
        else enterCorner();
        return;
      }
      if (isUndo) {
        undo();
      } else if (event.key === 'Escape') {
        state.chosen = -1;  // the arrows move the crosshair again
      } else if (key === 'n' && model.region.length) {
        state.chosen = (state.chosen + 1) % model.region.length;
      } else if (isDelete && chosen) {
        deleteCorner();
      } else if (direction) {
        remember();
        model.region[state.chosen] = [round(chosen[0] + by * direction[0]),
          round(chosen[1] + by * direction[1])];
      } else {
        return;
      }
      event.preventDefault();
      update();
      const now = model.region[state.chosen];
      if (now) say(text.corner(state.chosen + 1, ...inMillimetres(now)));
    });
  }
  draw();
  return {
    element: box, draw, undo, deleteCorner,
    mark: (wanted) => setMarks(box, view, wanted),
    hasCorner: () => Boolean(model.region[state.chosen]),
    /// In place of all corners; can be undone.
    set: (region) => {
      remember();
      model.region.splice(0, model.region.length, ...region);
      state.chosen = -1;
      update();
    },
    setIsocentre: (point) => {
      remember();
      model.isocentre = point;
      update();
    },
    clear: () => {
      remember();
      model.region.length = 0;
      state.chosen = -1;
      update();
    },
    pick: () => {
      state.picking = true;
      overlay.classList.add('picking');
      overlay.focus();
      say(text.picking);
    },
  };
}

function nearestEdge(region, [x, y]) {
  if (region.length < 3) return region.length;
  let best = [Infinity, region.length];
  region.forEach(([ax, ay], i) => {
    const [bx, by] = region[(i + 1) % region.length];
    const length2 = (bx - ax) ** 2 + (by - ay) ** 2 || 1e-9;
    const along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2;
    const fraction = Math.max(0, Math.min(1, along));
    const away = distance([x, y], [ax + fraction * (bx - ax), ay + fraction * (by - ay)]);
    if (away < best[0]) best = [away, i + 1];
  });
  return best[1];
}
