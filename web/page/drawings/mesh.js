// SPDX-License-Identifier: Apache-2.0
// The 3-D view; loaded only when it is opened.
import { arrowOf } from '../dom.js';
import * as THREE from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { cellAt, errorIndex, errorTable, kOutside } from './maps.js';
import { orientationCube } from './mesh_cube.js';
import { correctionOf, fractionOf, frameOf } from './mesh_motion.js';

function geometryOf({ positions, corners }) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(corners, 1));
  geometry.computeVertexNormals();
  return geometry;
}

const rowsOf = ({ elements }) => [0, 1, 2, 3].map((row) =>
  [0, 1, 2, 3].map((column) => elements[4 * column + row]));

/// The cell of the map under a point of the mesh, or -1.
function cellOf(grid, T, x, y, z) {
  if (!grid) return -1;
  return T ? cellAt(grid, T[0][0] * x + T[0][1] * y + T[0][2] * z + T[0][3],
    T[1][0] * x + T[1][1] * y + T[1][2] * z + T[1][3]) : cellAt(grid, x, y);
}

/// Colours of the vertices by the error map; T maps the mesh's frame to the map's.
/// @param region  NaN outside the region of interest: dimmed there, as the map is.
function coloursByError(geometry, grid, deviation, region, T, tolerance_m) {
  const position = geometry.getAttribute('position');
  const colours = new Uint8Array(3 * position.count);
  const scale = errorTable();
  for (let i = 0; i < position.count; ++i) {
    const cell = cellOf(grid, T, position.getX(i), position.getY(i), position.getZ(i));
    const value = cell < 0 ? NaN : deviation.values[cell];
    const at = 3 * errorIndex(value / tolerance_m);
    const light = cell >= 0 && region && Number.isNaN(region.values[cell]) ? kOutside : 1;
    for (let k = 0; k < 3; ++k) {
      colours[3 * i + k] = Number.isNaN(value) ? 80 : scale[at + k] * light;
    }
  }
  return new THREE.BufferAttribute(colours, 3, true);
}

const kGround = 0x0d1216;
const kTurn = 0.1;  // radians for each arrow key

/// A word that faces the viewer and hides behind nothing.
function label(text, height) {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('2d');
  const font = '600 48px sans-serif';
  context.font = font;
  canvas.width = Math.ceil(context.measureText(text).width) + 16;
  canvas.height = 64;
  context.font = font;  // a new size forgets it
  context.lineWidth = 8;
  context.strokeStyle = '#05080a';
  context.fillStyle = '#ffe08a';
  context.textBaseline = 'middle';
  context.strokeText(text, 8, 34);
  context.fillText(text, 8, 34);
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({
    map: new THREE.CanvasTexture(canvas), depthTest: false, transparent: true,
  }));
  sprite.scale.set(height * canvas.width / canvas.height, height, 1);
  return sprite;
}

/// The marks of the maps, around the box that is looked at: they show what lies where.
function marksAround(compass, words, box, radius) {
  const group = new THREE.Group();
  const centre = box.getCenter(new THREE.Vector3());
  const half = box.getSize(new THREE.Vector3()).multiplyScalar(0.5);
  for (const [name, [x, y]] of Object.entries(compass?.ways ?? {})) {
    const reach = Math.min(Math.abs(x) > 0.3 ? half.x / Math.abs(x) : Infinity,
      Math.abs(y) > 0.3 ? half.y / Math.abs(y) : Infinity);
    // The gantry stands behind the head or the feet.
    const away = reach + (name === 'gantry' ? 0.62 : 0.16) * radius;
    const sprite = label(words[name], 0.13 * radius);
    sprite.position.set(centre.x + x * away, centre.y + y * away, box.min.z + half.z);
    group.add(sprite);
  }
  return group;
}

/// Box of the vertices within the region of interest, else of all: what the camera looks at.
function boxOfInterest(geometry, grid, region, T) {
  const box = new THREE.Box3();
  const position = geometry.getAttribute('position');
  const point = new THREE.Vector3();
  for (let i = 0; i < position.count; i += 3) {
    point.fromBufferAttribute(position, i);
    const cell = region ? cellOf(grid, T, point.x, point.y, point.z) : -1;
    if (cell >= 0 && !Number.isNaN(region.values[cell])) box.expandByPoint(point);
  }
  if (!box.isEmpty()) return box;
  geometry.computeBoundingBox();
  return geometry.boundingBox.clone();
}

/// Draws into `canvas`. Throws where there is no WebGL.
/// @param surface  {positions, corners}.
/// @param motion  Of the body; null: there is no correction to show.
/// @param T_motion  From the surface's frame to that of the motion; null: the same.
/// @param words  Of the compass's marks.
/// Gives setGhost(load, fraction), setFraction(fraction), correct(fraction, deviationAfter),
/// look(name), cut(way, fraction), picture(), stop().
export function openMesh(canvas, {
  surface, grid, deviation, region, T, motion, T_motion, tolerance_m, compass, words,
}) {
  const renderer = new THREE.WebGLRenderer({
    canvas, antialias: true, logarithmicDepthBuffer: true, preserveDrawingBuffer: true,
  });
  renderer.localClippingEnabled = true;
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(kGround);
  const camera = new THREE.PerspectiveCamera(40, 1, 0.05, 10);
  camera.up.set(0, 0, 1);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x445566, 1.6));
  const sun = new THREE.DirectionalLight(0xffffff, 1.8);
  sun.position.set(-0.6, -0.4, 1);
  scene.add(sun);
  const geometry = geometryOf(surface);
  const measured = coloursByError(geometry, grid, deviation, region, T, tolerance_m);
  geometry.setAttribute('color', measured);
  const material = new THREE.MeshStandardMaterial({
    vertexColors: true, roughness: 0.9, side: THREE.DoubleSide,
  });
  const box = boxOfInterest(geometry, grid, region, T);
  const { center, radius } = box.getBoundingSphere(new THREE.Sphere());
  const body = new THREE.Mesh(geometry, material);
  body.matrixAutoUpdate = false;
  scene.add(body, marksAround(compass, words, box, radius));
  const cube = orientationCube(compass, words);
  const controls = new OrbitControls(camera, canvas);
  controls.enableDamping = false;

  let due = false;
  const draw = () => {
    due = false;
    const { clientWidth, clientHeight } = canvas;
    if (!clientWidth) return;
    renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    renderer.setSize(clientWidth, clientHeight, false);
    camera.aspect = clientWidth / clientHeight;
    camera.updateProjectionMatrix();
    renderer.render(scene, camera);
    cube.draw(renderer, camera, controls.target);
  };
  const request = () => {
    if (due) return;
    due = true;
    requestAnimationFrame(draw);
  };
  controls.addEventListener('change', request);
  const resize = new ResizeObserver(request);
  resize.observe(canvas);

  /// From the side of a mark, from above, or askew ("reset").
  const look = (name) => {
    // Upright on the screen is the way of the first mark: the head, the gantry or +X.
    const [ux, uy] = Object.values(compass?.ways ?? {})[0] ?? [0, 1];
    const [x, y] = compass?.ways[name] ?? [0, 0];
    const from = {
      top: [-0.01 * ux, -0.01 * uy, 1], reset: [-0.7 * ux, -0.7 * uy, 0.8],
    }[name] ?? [x, y, 0.35];
    camera.position.copy(center)
      .add(new THREE.Vector3(...from).normalize().multiplyScalar(2.8 * radius));
    controls.target.copy(center);
    controls.update();
    request();
  };
  canvas.addEventListener('keydown', (event) => {
    const turn = arrowOf(event);
    const zoom = { '+': 0.9, '=': 0.9, '-': 1.1 }[event.key];
    if (!turn && !zoom) return;
    event.preventDefault();
    const offset = camera.position.clone().sub(controls.target);
    if (turn) {
      offset.applyAxisAngle(new THREE.Vector3(0, 0, 1), kTurn * turn[0]);
      const side = new THREE.Vector3().crossVectors(camera.up, offset).normalize();
      const tilted = offset.clone().applyAxisAngle(side, -kTurn * turn[1]);
      if (Math.abs(tilted.clone().normalize().z) < 0.99) offset.copy(tilted);
    }
    if (zoom) offset.multiplyScalar(zoom);
    camera.position.copy(controls.target).add(offset);
    controls.update();
    request();
  });
  look('reset');

  let ghost = null;
  let isGhostWanted = false;
  // Both surfaces are drawn solid in turn by a screen-door pattern: nothing flickers where they lie
  // in each other, as it does with transparency.
  const setFraction = (fraction) => {
    if (!ghost) return;
    ghost.material.opacity = Math.max(0.02, 1 - fraction);
    material.opacity = Math.max(0.02, fraction);
    material.alphaHash = ghost.visible;
    material.needsUpdate = true;
    request();
  };
  /// Takes away what lies beyond a plane: above it ("height"), or toward the first mark ("along")
  /// or to the right of that ("across"). `fraction` of the box stays; nothing is cut without a way.
  const cut = (way, fraction) => {
    const [ux, uy] = Object.values(compass?.ways ?? {})[0] ?? [0, 1];
    const normal = { height: [0, 0, -1], along: [-ux, -uy, 0], across: [-uy, ux, 0] }[way];
    let planes = null;
    if (normal) {
      const plane = new THREE.Plane(new THREE.Vector3(...normal));
      const ends = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => plane.normal.dot(new THREE.Vector3(
        i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y,
        i & 4 ? box.max.z : box.min.z)));
      const [least, most] = [Math.min(...ends), Math.max(...ends)];
      plane.constant = -(most + fraction * (least - most));
      planes = [plane];
    }
    for (const one of [material, ghost?.material]) {
      if (!one) continue;
      one.clippingPlanes = planes;
      one.needsUpdate = true;
    }
    request();
  };
  const correction = motion ? correctionOf(T_motion, motion) : null;
  let corrected = null;
  return {
    look,
    setFraction,
    cut,
    /// Moves the surface by a fraction of the correction, 0 to 1. Its colours are those of the
    /// nearer end.
    /// @param deviationAfter  The error map after the correction.
    correct(fraction, deviationAfter) {
      if (!correction) return;
      body.matrix.copy(fractionOf(correction, fraction, center));
      body.matrixWorldNeedsUpdate = true;
      if (fraction > 0.5) {
        corrected ??= coloursByError(geometry, grid, deviationAfter, region,
          rowsOf(frameOf(T).multiply(correction)), tolerance_m);
      }
      geometry.setAttribute('color', fraction > 0.5 ? corrected : measured);
      request();
    },
    /// @param load  Gives the reference's surface; null: it is hidden.
    async setGhost(load, fraction) {
      isGhostWanted = Boolean(load);
      const reference = !ghost && load ? await load() : null;
      // Meanwhile it may have been hidden again, or have come by another call.
      if (reference && !ghost) {
        ghost = new THREE.Mesh(geometryOf(reference), new THREE.MeshStandardMaterial({
          color: 0x6ea8ff, alphaHash: true, side: THREE.DoubleSide,
          clippingPlanes: material.clippingPlanes,
        }));
        if (T) ghost.applyMatrix4(frameOf(T).invert());
        scene.add(ghost);
      }
      if (ghost) ghost.visible = isGhostWanted;
      if (!isGhostWanted) {
        material.opacity = 1;
        material.alphaHash = false;
        material.needsUpdate = true;
      } else setFraction(fraction);
      request();
    },
    picture() {
      draw();
      return canvas.toDataURL('image/png');
    },
    stop() {
      resize.disconnect();
      controls.dispose();
      cube.dispose();
      geometry.dispose();
      renderer.dispose();
    },
  };
}
