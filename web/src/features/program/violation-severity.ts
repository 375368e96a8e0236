// Level and name of violations.

import type { CheckAnswer_Violation } from "../../gen/robomesh_pb";
import type { NameIn } from "../../i18n/texts";

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
