// How much a violation asks to be looked at, and what its kind is called.

import type { CheckAnswer_Violation } from "../../gen/robomesh_pb";
import type { ProgramText } from "../../i18n/program";

/** What a gateway that requires checks refuses is an alarm, the rest is a warning. */
export function severityOf({ refuses }: CheckAnswer_Violation): "warning" | "alarm" {
  return refuses ? "alarm" : "warning";
}

const KINDS: Record<string, ProgramText> = {
  program: "kind_program",
  limit: "kind_limit",
  speed: "kind_speed",
  singularity: "kind_singularity",
  collision: "kind_collision",
  clearance: "kind_clearance",
  unreachable: "kind_unreachable",
};

/** The text of a kind; null: a kind of a newer check, shown as it is. */
export const kindText = (kind: string): ProgramText | null => KINDS[kind] ?? null;
