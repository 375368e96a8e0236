// Check of a target while an operator chooses it: what the motion there would meet, before it is sent.

import { computed, signal } from "@preact/signals";
import type { CheckAnswer_Violation, Description_Joint } from "../../gen/robomesh_pb";
import { CheckAnswerSchema, CheckRequestSchema } from "../../gen/robomesh_pb";
import { jointUnit } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import { ask, inOwnName } from "../console/connection";

const TIMEOUT_S = 10;
/** Each check is of the newest target, and the kinematics has other work. */
const REST_MS = 100;
const RETRY_MS = 1000;
const DECIMALS = 6; // of degrees or mm

interface Target {
  robotKey: string;
  program: string;
}

let wanted: Target | null = null;
let checking = false;
const found = signal<readonly CheckAnswer_Violation[]>([]);

/** Check the motion to joint positions [rad] or [m] from where the robot is; null: no target any more. */
export function checkTarget(
  robotKey: string,
  joints: readonly Description_Joint[],
  positions: readonly number[] | null,
): void {
  if (!positions) {
    wanted = null;
    found.value = [];
    return;
  }
  const numbers = joints.map((joint, i) => ((positions[i] ?? 0) * jointUnit(joint).factor).toFixed(DECIMALS));
  wanted = { robotKey, program: `move_joints ${numbers.join(" ")}` };
  if (!checking) void checkNewest();
}

/** Why the target would be refused or warned of, in a sentence; empty: no reason is known. */
export const targetProblem = computed(() => {
  const first = found.value.find(({ refuses }) => refuses) ?? found.value[0];
  return first ? reasonText(first.reason, first.text) : "";
});

/** Parts that collide or come too close on the way or at the target, named as in a check's pairs. */
export const targetParts = computed<ReadonlySet<string>>(() => new Set(found.value.flatMap(({ pair }) => pair)));

async function checkNewest(): Promise<void> {
  checking = true;
  let last: Target | null = null;
  while (wanted && wanted !== last) {
    const target: Target = wanted;
    let restMs = REST_MS;
    last = target;
    try {
      const key = inOwnName(`${target.robotKey}/kinematics/check`);
      const { violations } = await ask(
        key,
        CheckRequestSchema,
        { program: target.program },
        CheckAnswerSchema,
        TIMEOUT_S,
      );
      // A later target near this one has most likely the same problem, until its own check.
      if (wanted) found.value = violations;
    } catch {
      // Nothing is known, and the gateway checks the motion itself; a kinematics that starts answers later.
      found.value = [];
      last = null;
      restMs = RETRY_MS;
    }
    await new Promise((resolve) => setTimeout(resolve, restMs));
  }
  checking = false;
}
