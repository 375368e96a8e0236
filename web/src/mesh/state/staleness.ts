// Ages of messages, and from which age a topic is stale: what the page must no longer show as live.

import type { ControllerState, Description } from "../../gen/robomesh_pb";
import { hello } from "../console/connection";
import type { Latest } from "./topics";
import { now } from "./topics";

/** Return the age [s] of a sample now; null: not known. */
export function ageOf(latest: Latest<unknown> | undefined, at = now.value): number | null {
  if (!latest || latest.sample.newAt === null) return null;
  return Math.max(0, (at - latest.sample.newAt) / 1000);
}

/** Return the age [s] of joint states, including the gateway's report of its last unit's age; null: not known. */
export function jointsAge(
  joints: Latest<unknown> | undefined,
  controller: Latest<ControllerState> | undefined,
  at = now.value,
): number | null {
  if (!joints) return null;
  const own = ageOf(joints, at);
  const reportAge = ageOf(controller, at);
  const lastUnit = controller?.message.lastUnitAgeS;
  if (reportAge === null || lastUnit === undefined || controller === undefined) return own;
  const reported = reportAge + lastUnit;
  if (own === null) return reported;
  // A report from before the newest states does not describe them.
  return controller.sample.arrived >= joints.sample.arrived ? Math.max(own, reported) : own;
}

// Topics with the joints, and those computed from them: a robot may have another stale time.
const OF_ARM: readonly string[] = ["joints", "joints/slow", "frames", "kinematics"];

/** Return the age [s] at which a robot's topic is stale; infinite if it does not expire. */
export function staleAfter(topic: string, description?: Description): number {
  if (description?.staleAfterS !== undefined && OF_ARM.includes(topic)) return description.staleAfterS;
  const rows = hello.value?.stale ?? [];
  const row = rows.find((r) => r.topic === topic) ?? rows.find((r) => r.topic === topic.replace(/\/.*/, "/*"));
  return row?.afterS ?? Number.POSITIVE_INFINITY;
}

export function isStale(topic: string, age: number | null, description?: Description): boolean {
  return age === null || age > staleAfter(topic, description);
}
