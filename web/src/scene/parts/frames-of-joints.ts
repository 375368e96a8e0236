// Placements of the links computed from joint states, for a slow link that carries no frames.

import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import * as THREE from "three";
import { FrameTransformsSchema } from "../../gen/foxglove/FrameTransforms_pb";
import { JointStatesSchema } from "../../gen/foxglove/JointStates_pb";
import type { Description } from "../../gen/robomesh_pb";
import type { Forward } from "./forward-kinematics";

/** Convert a payload of JointStates to one of FrameTransforms. */
export function framesOfJoints(
  prefix: string,
  { joints, frames, baseToSite }: Description,
  forward: Forward,
  payload: Uint8Array,
): Uint8Array {
  const base = matrixOf(baseToSite);
  const positionsByName = new Map(
    fromBinary(JointStatesSchema, payload).joints.map(({ name, position }) => [name, position]),
  );
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
  return toBinary(FrameTransformsSchema, create(FrameTransformsSchema, { transforms }));
}

/** Read 16 doubles by rows; anything else is the identity. */
function matrixOf(rows: readonly number[]): THREE.Matrix4 {
  const matrix = new THREE.Matrix4();
  return rows.length === 16 ? matrix.fromArray(rows).transpose() : matrix;
}
