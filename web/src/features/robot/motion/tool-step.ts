// A step of the tool along or about one axis of a frame, and where it leads.

import type { Description } from "../../../gen/robomesh_pb";
import { DASH, fixed, rollPitchYaw, toDegrees, toRadians } from "../../../i18n/format";
import { t } from "../../../i18n/texts";
import type { Axis } from "../../../panels/tool-panel";
import { POSE_AXES } from "../../../panels/tool-panel";

export const FRAMES = ["tool", "base", "site"] as const;

export interface ToolStep {
  axis: Axis;
  frame: (typeof FRAMES)[number];
  amount: number; // mm or degrees
}

export const isTurn = (axis: Axis): boolean => POSE_AXES.indexOf(axis) >= 3;

/** Return a pose (4x4, tool to base, by rows) after a step: along the axis, or about it through the tool's origin. */
export function poseAfter(pose: readonly number[], step: ToolStep, baseToSite: readonly number[]): number[] {
  const number = POSE_AXES.indexOf(step.axis) % 3;
  const [x = 0, y = 0, z = 0] = [0, 1, 2].map((row) => {
    if (step.frame === "tool") return pose[4 * row + number];
    return step.frame === "site" && baseToSite.length === 16 ? baseToSite[4 * number + row] : Number(row === number);
  });
  const after = [...pose];
  if (!isTurn(step.axis)) {
    for (const [row, part] of [x, y, z].entries())
      after[4 * row + 3] = (pose[4 * row + 3] ?? NaN) + (part * step.amount) / 1000;
    return after;
  }
  const [sine, cosine] = [Math.sin(toRadians(step.amount)), Math.cos(toRadians(step.amount))];
  for (const column of [0, 1, 2]) {
    const [a = 0, b = 0, c = 0] = [pose[column], pose[4 + column], pose[8 + column]];
    const along = (x * a + y * b + z * c) * (1 - cosine);
    after[column] = a * cosine + (y * c - z * b) * sine + x * along;
    after[4 + column] = b * cosine + (z * a - x * c) * sine + y * along;
    after[8 + column] = c * cosine + (x * b - y * a) * sine + z * along;
  }
  return after;
}

/** Return where steps lead, as the Tool panel shows it: the position after a step along an axis, else the angles. */
export function endText(
  pose: readonly number[] | undefined,
  steps: readonly ToolStep[],
  description: Description | undefined,
): string {
  const last = steps.at(-1);
  if (pose?.length !== 16 || !last) return DASH;
  const end = steps.reduce<readonly number[]>((at, step) => poseAfter(at, step, description?.baseToSite ?? []), pose);
  if (!isTurn(last.axis))
    return `${["x", "y", "z"].map((axis, row) => `${axis} ${fixed((end[4 * row + 3] ?? NaN) * 1000, 1)}`).join(", ")}\u202fmm`;
  const angles = rollPitchYaw(end).map(toDegrees);
  return (["roll", "pitch", "yaw"] as const).map((axis, i) => `${t(axis)} ${fixed(angles[i], 2)}°`).join(", ");
}
