// SPDX-License-Identifier: Apache-2.0
// How the 3-D view moves a surface as the correction will.
import * as THREE from 'three';

/// Makes a matrix of four rows.
const matrixOf = (rows) => new THREE.Matrix4().set(...rows.flat());

/// From the frame of a mesh to another; the same without T.
export const frameOf = (T) => (T ? matrixOf(T) : new THREE.Matrix4());

/// The motion by which the correction moves the current surface, in that surface's frame: it undoes
/// the motion of the body, which is stated in a frame to which T leads.
export function correctionOf(T, motion) {
  const toMotion = frameOf(T);
  return toMotion.clone().invert().multiply(matrixOf(motion).invert()).multiply(toMotion);
}

/// A fraction of a rigid motion: turned and shifted by it, as seen from `centre`.
export function fractionOf(motion, fraction, centre) {
  const turn = new THREE.Quaternion()
    .slerp(new THREE.Quaternion().setFromRotationMatrix(motion), fraction);
  const shift = centre.clone().applyMatrix4(motion).sub(centre).multiplyScalar(fraction);
  const from = centre.clone().negate().applyQuaternion(turn).add(centre).add(shift);
  return new THREE.Matrix4().compose(from, turn, new THREE.Vector3(1, 1, 1));
}
