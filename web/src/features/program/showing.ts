// What the 3-D view shows: the checked motion at a moment, or what is being taught. One at a time.

import { effect, signal } from "@preact/signals";
import type { CheckAnswer_Violation } from "../../gen/robomesh_pb";
import { ghostAt, redLinks, toolPath } from "../../scene/ghost";
import { aim, aimAt } from "./aim";
import { checked } from "./check";
import { duration, moment, path, playing, positionsAt, redNow } from "./motion";
import { robotKey } from "./subject";

/** The violation that was clicked last. */
export const chosen = signal<CheckAnswer_Violation | null>(null);

/** Shows the checked motion at a moment [s]. */
export function showMoment(time: number): void {
  aimAt(null);
  moment.value = Math.min(duration.value, Math.max(0, time));
}

/** Shows what is being taught at joint positions [rad] or [m]; null: nothing. */
export function teach(positions: readonly number[] | null): void {
  hideMoment();
  aimAt(positions);
}

export function hideMoment(): void {
  playing.value = false;
  moment.value = null;
  chosen.value = null;
}

/** Keeps the view in step, until the returned function is called. */
export function keepShowing(): () => void {
  const ends = [
    effect(() => {
      const of = path.value;
      const at = moment.value;
      ghostAt(robotKey.value, aim.value ?? (of && at !== null ? positionsAt(of, at) : null));
    }),
    effect(() => void (redLinks.value = redNow.value)),
    effect(() => {
      const points = path.value?.toolPositions ?? [];
      const count = Math.floor(points.length / 3);
      const point = (i: number) => [points[3 * i] ?? 0, points[3 * i + 1] ?? 0, points[3 * i + 2] ?? 0] as const;
      toolPath.value = count ? Array.from({ length: count }, (_, i) => point(i)) : null;
    }),
    // A new check: a moment stays where it still is; what was clicked is of the old one.
    effect(() => {
      void checked.value;
      chosen.value = null;
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
