// The pose being taught: set on the ghost by sliders, by numbers or by the gizmo. It moves no robot.

import { computed, signal } from "@preact/signals";
import { InverseAnswerSchema, InverseRequestSchema, InverseRequest_Task as Task } from "../../../gen/robomesh_pb";
import { rollPitchYaw, toDegrees, toRadians } from "../../../i18n/format";
import { reasonText } from "../../../i18n/reasons";
import { ask, reasonOf } from "../../../mesh/console/connection";
import { robotKey, toolAt } from "./program-robot";

const TIMEOUT_S = 5;
const FULL_POSE = 6; // a full pose can be reached with so many joints

/** Joint positions [rad] or [m]; null: no pose is being taught. */
export const taughtPositions = signal<readonly number[] | null>(null);
/** Why the wanted pose cannot be reached; "" when it can. */
export const taughtProblem = signal("");
const requestedPose = signal<readonly number[] | null>(null);
/** The tool in the base frame, 16 by rows: the wanted pose, or the joints' pose; null: not known. */
export const taughtPose = computed(
  () => requestedPose.value ?? (taughtPositions.value && toolAt.value(taughtPositions.value)),
);

let solving = false;

/** Aim at joint positions; null ends it. */
export function teachPositions(positions: readonly number[] | null): void {
  taughtPositions.value = positions;
  requestedPose.value = null;
  taughtProblem.value = "";
}

/** Aim at a pose of the tool, with the joint positions nearest to the current ones. */
export function teachPose(pose: readonly number[]): void {
  requestedPose.value = pose;
  if (!solving) void solve();
}

/** Drop the wanted pose: the tool is at the joints' pose. */
export function dropRequestedPose(): void {
  requestedPose.value = null;
  taughtProblem.value = "";
}

/** Send one request at a time, the newest next. */
async function solve(): Promise<void> {
  solving = true;
  let pose = requestedPose.value;
  while (pose) {
    const near = taughtPositions.value ?? [];
    const task = near.length < FULL_POSE ? Task.POSITION_AND_AXIS_5D : Task.POSE_6D;
    let found: readonly number[] | undefined;
    let problem = "";
    try {
      const request = { pose: [...pose], task, near: [...near] };
      const key = `${robotKey.value}/kinematics/inverse`;
      const answer = await ask(key, InverseRequestSchema, request, InverseAnswerSchema, TIMEOUT_S);
      found = answer.solutions[0]?.jointPositions;
      problem = reasonText(answer.cause, answer.reason);
    } catch (error) {
      problem = reasonOf(error);
    }
    if (requestedPose.value) {
      if (found) taughtPositions.value = found;
      taughtProblem.value = found ? "" : problem;
    }
    pose = requestedPose.value === pose ? null : requestedPose.value;
  }
  solving = false;
}

/** Return X, Y, Z [mm], roll, pitch, yaw [degrees] of a placement, as programs write it. */
export function poseNumbers(pose: readonly number[]): number[] {
  const at = [pose[3], pose[7], pose[11]].map((each) => (each ?? 0) * 1000);
  return [...at, ...rollPitchYaw(pose).map(toDegrees)];
}

/** Return the placement (16, by rows) of X, Y, Z [mm] and roll, pitch, yaw [degrees]. */
export function poseOf(numbers: readonly number[]): number[] {
  const [x = 0, y = 0, z = 0] = numbers.map((each) => each / 1000);
  const [roll = 0, pitch = 0, yaw = 0] = numbers.slice(3).map(toRadians);
  const [cr, sr] = [Math.cos(roll), Math.sin(roll)];
  const [cp, sp] = [Math.cos(pitch), Math.sin(pitch)];
  const [cy, sy] = [Math.cos(yaw), Math.sin(yaw)];
  return [
    ...[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
    ...[sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
    ...[-sp, cp * sr, cp * cr, z],
    ...[0, 0, 0, 1],
  ];
}
