// The 3-D view; loaded only when it is opened.
import * as THREE from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { PLYLoader } from 'three/examples/jsm/loaders/PLYLoader.js';
import { cellAt, errorIndex, errorTable, kOutside } from './maps.js';

/// Colours each vertex by the error map; T maps the mesh's frame to the map's.
/// @param region  NaN outside the region of interest: dimmed there, as the map is.
function colourByError(geometry, grid, deviation, region, T, tolerance_m) {
  const position = geometry.getAttribute('position');
  const colours = new Uint8Array(3 * position.count);
  const scale = errorTable();
  for (let i = 0; i < position.count; ++i) {
    const [x, y, z] = [position.getX(i), position.getY(i), position.getZ(i)];
    const u = T ? T[0][0] * x + T[0][1] * y + T[0][2] * z + T[0][3] : x;
    const v = T ? T[1][0] * x + T[1][1] * y + T[1][2] * z + T[1][3] : y;
    const cell = grid ? cellAt(grid, u, v) : -1;
    const value = cell < 0 ? NaN : deviation.values[cell];
    const at = 3 * errorIndex(value / tolerance_m);
    const light = cell >= 0 && region && Number.isNaN(region.values[cell]) ? kOutside : 1;
    for (let k = 0; k < 3; ++k) colours[3 * i + k] = Number.isNaN(value) ? 80 : scale[at + k] * light;
  }
  geometry.setAttribute('color', new THREE.BufferAttribute(colours, 3, true));
}

/// Draws into `canvas`; returns {setGhost(url), stop()}. Throws where there is no WebGL.
export async function openMesh(canvas, { url, grid, deviation, region, T, tolerance_m }) {
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0x0d1216);
  const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 20);
  camera.up.set(0, 0, 1);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x445566, 1.6));
  const sun = new THREE.DirectionalLight(0xffffff, 1.8);
  sun.position.set(-0.6, -0.4, 1);
  scene.add(sun);
  const loader = new PLYLoader();
  const geometry = await loader.loadAsync(url);
  colourByError(geometry, grid, deviation, region, T, tolerance_m);
  const body = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.9, side: THREE.DoubleSide }));
  scene.add(body);
  geometry.computeBoundingSphere();
  const { center, radius } = geometry.boundingSphere;
  camera.position.set(center.x, center.y - 1.05 * radius, center.z + 1.15 * radius);
  const controls = new OrbitControls(camera, canvas);
  controls.target.copy(center);
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
  };
  const request = () => {
    if (due) return;
    due = true;
    requestAnimationFrame(draw);
  };
  controls.addEventListener('change', request);
  const resize = new ResizeObserver(request);
  resize.observe(canvas);
  canvas.addEventListener('keydown', (event) => {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    const zoom = { '+': 0.9, '=': 0.9, '-': 1.1 }[event.key];
    if (!turn && !zoom) return;
    event.preventDefault();
    const offset = camera.position.clone().sub(controls.target);
    if (turn) {
      offset.applyAxisAngle(new THREE.Vector3(0, 0, 1), turn[0]);
      const side = new THREE.Vector3().crossVectors(camera.up, offset).normalize();
      const tilted = offset.clone().applyAxisAngle(side, turn[1]);
      if (Math.abs(tilted.clone().normalize().z) < 0.99) offset.copy(tilted);
    }
    if (zoom) offset.multiplyScalar(zoom);
    camera.position.copy(controls.target).add(offset);
    controls.update();
    request();
  });
  controls.update();
  request();

  let ghost = null;
  return {
    async setGhost(ghostUrl) {
      if (!ghost && ghostUrl) {
        ghost = new THREE.Mesh(await loader.loadAsync(ghostUrl), new THREE.MeshStandardMaterial({ color: 0x6ea8ff, transparent: true, opacity: 0.35, depthWrite: false, side: THREE.DoubleSide }));
        if (T) ghost.applyMatrix4(new THREE.Matrix4().set(...T.flat()).invert());
        scene.add(ghost);
      }
      if (ghost) ghost.visible = Boolean(ghostUrl);
      request();
    },
    stop() {
      resize.disconnect();
      controls.dispose();
      geometry.dispose();
      renderer.dispose();
    },
  };
}
