// SPDX-License-Identifier: Apache-2.0
// The cube in the corner of the 3-D view: which way is which, from wherever it is looked at.
import * as THREE from 'three';

const kFraction = 0.24;  // of the view's shorter side
const kLeast = 72;    // pixels of the page
const kFace = 128;

/// Sides of the cube in its own frame, in the order of a box's faces: +x, -x, +y, -y, +z, -z.
/// Its y points to the first mark (head, gantry or +X), its z up.
function names(compass, words) {
  const marks = Object.entries(compass?.ways ?? {});
  const [ux, uy] = marks[0]?.[1] ?? [0, 1];
  const toward = ([x, y]) => {
    // Head and feet come before the gantry, which stands behind them.
    const found = marks.find(([, way]) => way[0] * x + way[1] * y > 0.9);
    return found ? words[found[0]] : '';
  };
  const { head, left } = compass?.ways ?? {};
  // Who lies on the back has the left to the right of somebody who looks from the feet to the head.
  const supine = head && left && head[0] * left[1] - head[1] * left[0] < 0;
  const patient = compass?.by === 'posture' && head && left;
  const front = supine ? [words.anterior, words.posterior] : [words.posterior, words.anterior];
  return [toward([uy, -ux]), toward([-uy, ux]), toward([ux, uy]), toward([-ux, -uy]),
    ...(patient ? front : [words.top, words.bottom])];
}

function face(text) {
  const canvas = document.createElement('canvas');
  canvas.width = kFace;
  canvas.height = kFace;
  const context = canvas.getContext('2d');
  context.fillStyle = '#26343f';
  context.fillRect(0, 0, kFace, kFace);
  context.strokeStyle = '#ffe08a';
  context.lineWidth = 6;
  context.strokeRect(3, 3, kFace - 6, kFace - 6);
  const font = (size) => `700 ${size}px sans-serif`;
  context.font = font(60);
  const fits = Math.min(60, 60 * 0.86 * kFace / Math.max(1, context.measureText(text).width));
  context.font = font(fits);
  context.fillStyle = '#ffe08a';
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillText(text, kFace / 2, kFace / 2 + 2);
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  return texture;
}

// The writing on a face stands upright for a person who looks at it with z up, and the writing on
// the top for one who stands at the feet.
const kTurns = [Math.PI / 2, -Math.PI / 2, Math.PI, 0, 0, Math.PI];

/// Gives draw(renderer, camera, target), which adds the cube to what is drawn, and dispose().
export function orientationCube(compass, words) {
  const [ux, uy] = Object.values(compass?.ways ?? {})[0] ?? [0, 1];
  const geometry = new THREE.BoxGeometry(1, 1, 1);
  const materials = names(compass, words).map((text, i) => {
    const map = face(text);
    map.center.set(0.5, 0.5);
    map.rotation = kTurns[i];
    return new THREE.MeshBasicMaterial({ map });
  });
  const cube = new THREE.Mesh(geometry, materials);
  cube.rotation.z = Math.atan2(uy, ux) - Math.PI / 2;
  const scene = new THREE.Scene();
  scene.add(cube);
  const eye = new THREE.OrthographicCamera(-0.95, 0.95, 0.95, -0.95, 0.1, 10);
  eye.up.set(0, 0, 1);
  return {
    draw(renderer, camera, target) {
      const { clientWidth, clientHeight } = renderer.domElement;
      const side = Math.max(kLeast, kFraction * Math.min(clientWidth, clientHeight));
      eye.position.copy(camera.position).sub(target).normalize().multiplyScalar(4);
      eye.quaternion.copy(camera.quaternion);
      renderer.autoClear = false;
      renderer.clearDepth();
      renderer.setViewport(clientWidth - side, 0, side, side);
      renderer.render(scene, eye);
      renderer.setViewport(0, 0, clientWidth, clientHeight);
      renderer.autoClear = true;
    },
    dispose() {
      geometry.dispose();
      for (const material of materials) {
        material.map.dispose();
        material.dispose();
      }
    },
  };
}
