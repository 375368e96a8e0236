// The program's robot, for all panels of the page.

import { computed, signal } from "@preact/signals";
import { Matrix4 } from "three";
import type { Description } from "../../../gen/robomesh_pb";
import { forwardOf } from "../../../scene/parts/forward-kinematics";

export const robotKey = signal("");
export const description = signal<Description | undefined>(undefined);
/** Joint positions [rad] or [m], in the description's order; null: not known now. */
export const livePositions = signal<readonly number[] | null>(null);

/** Return the tool's placement in the base frame (16, by rows) at joint positions [rad] or [m]; null: no tool. */
export const toolAt = computed(() => {
  const of = description.value;
  const frame = of?.frames.find(({ name }) => name === "tool");
  if (!of || frame?.frameToLink.length !== 16) return () => null;
  const forward = forwardOf(
    of.urdf,
    of.joints.map((joint) => joint.name),
  );
  const toLink = new Matrix4().fromArray(frame.frameToLink).transpose();
  return (positions: readonly number[]): readonly number[] | null => {
    const link = forward(positions).get(frame.link);
    return link ? link.clone().multiply(toLink).transpose().elements : null;
  };
});
