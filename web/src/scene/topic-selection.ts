// Choice of a robot's topics: for one at another site those that fit a slow link, unless the operator wants all.

import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { signal } from "@preact/signals";
import * as THREE from "three";
import { FrameTransformsSchema } from "../gen/foxglove/FrameTransforms_pb";
import { JointStatesSchema } from "../gen/foxglove/JointStates_pb";
import type { Description } from "../gen/robomesh_pb";
import { hello } from "../mesh/connection";
import { isReplay } from "../mesh/robot-name";
import type { Forward } from "./forward-kinematics";

export const TOPIC_SELECTIONS = ["slow", "all"] as const;
export type TopicSelection = (typeof TOPIC_SELECTIONS)[number];

const requested = signal<ReadonlyMap<string, TopicSelection>>(new Map());

/** Return whether the robot is at another site than this console. */
export function isRemote(robotKey: string): boolean {
  const [, site, robot = ""] = robotKey.split("/");
  return hello.value !== null && hello.value.site !== site && !isReplay(robot);
}

export function topicSelection(robotKey: string): TopicSelection {
  return requested.value.get(robotKey) ?? (isRemote(robotKey) ? "slow" : "all");
}

export function selectTopics(robotKey: string, reach: TopicSelection): void {
  requested.value = new Map(requested.value).set(robotKey, reach);
}

/** Return the topic of the robot's joint states, whole or thinned. */
export function jointsTopic(robotKey: string): "joints" | "joints/slow" {
  return topicSelection(robotKey) === "slow" ? "joints/slow" : "joints";
}

/** Return the topic that supplies the 3-D view's placements. */
export function framesTopic(robotKey: string): "frames" | "joints/slow" {
  return topicSelection(robotKey) === "slow" ? "joints/slow" : "frames";
}

/** Convert JointStates to FrameTransforms payloads: over a slow link the page computes placements. */
export function framesOf(
  prefix: string,
  description: Description,
  forward: Forward,
): (joints: Uint8Array) => Uint8Array {
  const base = matrixOf(description.baseToSite);
  const { joints, frames } = description;
  return (payload) => {
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
  };
}

/** Read 16 doubles by rows; anything else is the identity. */
function matrixOf(rows: readonly number[]): THREE.Matrix4 {
  const matrix = new THREE.Matrix4();
  return rows.length === 16 ? matrix.fromArray(rows).transpose() : matrix;
}
