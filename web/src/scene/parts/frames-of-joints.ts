// Placements of the links computed from joint states, for a slow link that carries no frames.

import { create } from "@bufbuild/protobuf";
import * as THREE from "three";
import type { FrameTransforms } from "../../gen/foxglove/FrameTransforms_pb";
import { FrameTransformsSchema } from "../../gen/foxglove/FrameTransforms_pb";
import type { JointStates } from "../../gen/foxglove/JointStates_pb";
import type { Description } from "../../gen/robomesh_pb";
import type { Forward } from "./forward-kinematics";

/** Return the frames of joint states. */
export function framesOfJoints(
  prefix: string,
  { joints, frames, baseToSite }: Description,
  forward: Forward,
  states: JointStates,
): FrameTransforms {
  const base = matrixOf(baseToSite);
  const positionsByName = new Map(states.joints.map(({ name, position }) => [name, position]));
  const placements = forward(joints.map(({ name, home }) => positionsByName.get(name) ?? home));
  const named = frames.flatMap(({ name, link, frameToLink }): [string, THREE.Matrix4][] => {
    const placement = placements.get(link);
    return placement ? [[name, placement.clone().multiply(matrixOf(frameToLink))]] : [];
  });
  const transforms = [...placements, ...named].map(([name, placement]) => {
    const [translation, rotation] = [new THREE.Vector3(), new THREE.Quaternion()];
    base.clone().multiply(placement).decompose(translation, rotation, new THREE.Vector3());
    const { x, y, z, w } = rotation;
    return {
      childFrameId: `${prefix}/${name}`,
      translation: { x: translation.x, y: translation.y, z: translation.z },
      rotation: { x, y, z, w },
    };
  });
  return create(FrameTransformsSchema, { transforms });
}

/** Read 16 doubles by rows; anything else is the identity. */
function matrixOf(rows: readonly number[]): THREE.Matrix4 {
  const matrix = new THREE.Matrix4();
  return rows.length === 16 ? matrix.fromArray(rows).transpose() : matrix;
}
