// The checked motion at a moment: the ghost's position, and the links that violate something.

import { computed, signal } from "@preact/signals";
import type { CheckAnswer_Path } from "../../../gen/robomesh_pb";
import { checked } from "./program-check";

/** The displayed moment [s from the program's start]; null: none. */
export const moment = signal<number | null>(null);
export const playing = signal(false);

export const path = computed<CheckAnswer_Path | null>(() => {
  const found = checked.value?.answer.path;
  return found && found.timesS.length > 0 ? found : null;
});
export const duration = computed(() => path.value?.timesS.at(-1) ?? 0);

/** Return joint positions [rad] or [m] at a moment; null: no samples. */
export function positionsAt(of: CheckAnswer_Path, time: number): readonly number[] | null {
  const count = of.timesS.length;
  const width = of.jointPositions.length / count;
  const after = indexAt(of, time);
  const before = Math.max(0, after - 1);
  const [from, to] = [of.timesS[before] ?? 0, of.timesS[after] ?? 0];
  const share = to > from ? Math.min(1, Math.max(0, (time - from) / (to - from))) : 1;
  const at = (row: number, column: number) => of.jointPositions[row * width + column] ?? 0;
  return Array.from({ length: width }, (_, i) => at(before, i) + share * (at(after, i) - at(before, i)));
}

/** Return the index of the first sample at or after a moment, or of the last. */
function indexAt(of: CheckAnswer_Path, time: number): number {
  let [low, high] = [0, of.timesS.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((of.timesS[middle] ?? 0) < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Return the program's line at a moment. */
export const lineAtMoment = computed(() => {
  const of = path.value;
  return of && moment.value !== null ? (of.lines[indexAt(of, moment.value)] ?? null) : null;
});

/** Clearance at the moment [m]; null: no surroundings, or no moment. */
export const clearanceAtMoment = computed(() => {
  const of = path.value;
  if (!of || moment.value === null || of.clearances.length === 0) return null;
  const clearance = of.clearances[indexAt(of, moment.value)] ?? Infinity;
  return Number.isFinite(clearance) ? clearance : null;
});

/** Links and fixtures in violations at the moment. */
export const violatingLinks = computed<ReadonlySet<string>>(() => {
  const time = moment.value;
  const violations = checked.value?.answer.violations ?? [];
  if (time === null) return new Set();
  const now = violations.filter(
    (each) => each.timeS <= time + 1e-6 && time <= Math.max(each.timeS, each.untilS) + 1e-6,
  );
  return new Set(now.flatMap((each) => each.pair));
});
