// Violations that a check found: their levels, their names, and rows of those with a common cause.

import type { CheckAnswer_Violation } from "../../../gen/robomesh_pb";
import type { NameIn } from "../../../i18n/texts";

export interface ViolationGroup {
  /** The nearest violation, which the row describes and opens. */
  worst: CheckAnswer_Violation;
  first: number;
  last: number;
  fromS: number;
  untilS: number;
}

const MOVES = /^\s*(home|move_)/;

/** Group violations in the order of their first ones. Lines are neighbours if no line between them moves the robot.
 *
 * Errors of the text share a row only if their texts are equal. */
export function groupViolations(violations: readonly CheckAnswer_Violation[], text: string): readonly ViolationGroup[] {
  const lines = text.split("\n");
  const none = (from: number, to: number) =>
    !lines.slice(from, Math.max(from, to - 1)).some((line) => MOVES.test(line));
  const groups: ViolationGroup[] = [];
  const newest = new Map<string, ViolationGroup>();
  for (const each of violations) {
    const { kind, pair, refuses, line, timeS, untilS } = each;
    const cause = [kind, refuses, ...pair, kind === "program" ? each.text : ""].join("\n");
    const before = newest.get(cause);
    if (before && none(before.last, line) && none(line, before.first)) {
      if ((each.distance ?? 0) < (before.worst.distance ?? 0)) before.worst = each;
      before.first = Math.min(before.first, line);
      before.last = Math.max(before.last, line);
      before.untilS = Math.max(before.untilS, untilS);
      continue;
    }
    const begun = { worst: each, first: line, last: line, fromS: timeS, untilS };
    newest.set(cause, begun);
    groups.push(begun);
  }
  return groups;
}

/** Return the level: an alarm if the gateway requires checks and refuses it, otherwise a warning. */
export function severityOf({ refuses }: CheckAnswer_Violation): "warning" | "alarm" {
  return refuses ? "alarm" : "warning";
}

const KINDS: Record<string, NameIn<"program">> = {
  program: "kind_program",
  limit: "kind_limit",
  speed: "kind_speed",
  singularity: "kind_singularity",
  collision: "kind_collision",
  clearance: "kind_clearance",
  unreachable: "kind_unreachable",
};

/** Return the text of a kind; null: a newer check's kind, shown unchanged. */
export const kindText = (kind: string): NameIn<"program"> | null => KINDS[kind] ?? null;
