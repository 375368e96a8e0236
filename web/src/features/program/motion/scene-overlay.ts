// The 3-D view's overlay: the checked motion at a moment, or the pose being taught; one at a time.

import { effect, signal } from "@preact/signals";
import type { CheckAnswer_Violation } from "../../../gen/robomesh_pb";
import { checkTarget, targetParts } from "../../../mesh/control/target-check";
import { ghostAt, redLinks, toolPath } from "../../../scene/overlays";
import { duration, moment, path, playing, positionsAt, violatingLinks } from "./checked-motion";
import { checked } from "./program-check";
import { description, robotKey } from "./program-robot";
import { taughtPositions, teachPositions } from "./taught-pose";

/** The last violation that was clicked. */
export const clickedViolation = signal<CheckAnswer_Violation | null>(null);

/** Show the checked motion at a moment [s]. */
export function showMoment(time: number): void {
  teachPositions(null);
  moment.value = Math.min(duration.value, Math.max(0, time));
}

/** Show the pose being taught at joint positions [rad] or [m]; null: none. */
export function teach(positions: readonly number[] | null): void {
  hideMoment();
  teachPositions(positions);
}

export function hideMoment(): void {
  playing.value = false;
  moment.value = null;
  clickedViolation.value = null;
}

/** Update the view until the returned function is called. */
export function startOverlay(): () => void {
  const ends = [
    effect(() => {
      const of = path.value;
      const at = moment.value;
      ghostAt(robotKey.value, taughtPositions.value ?? (of && at !== null ? positionsAt(of, at) : null));
    }),
    effect(() => checkTarget(robotKey.value, description.value?.joints ?? [], taughtPositions.value)),
    effect(() => void (redLinks.value = taughtPositions.value ? targetParts.value : violatingLinks.value)),
    effect(() => {
      const points = path.value?.toolPositions ?? [];
      const count = Math.floor(points.length / 3);
      const point = (i: number) => [points[3 * i] ?? 0, points[3 * i + 1] ?? 0, points[3 * i + 2] ?? 0] as const;
      toolPath.value = count ? Array.from({ length: count }, (_, i) => point(i)) : null;
    }),
    // After a new check keep the moment if it exists; the clicked violation belonged to the old check.
    effect(() => {
      void checked.value;
      clickedViolation.value = null;
      const at = moment.peek();
      if (!path.value) hideMoment();
      else if (at !== null) moment.value = Math.min(at, duration.value);
    }),
  ];
  return () => {
    for (const end of ends) end();
    teach(null);
    ghostAt(robotKey.value, null);
    redLinks.value = new Set();
    toolPath.value = null;
  };
}
