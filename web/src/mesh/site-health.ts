// What each site's watch says of the mesh, and what is wrong of it in words.

import type { MeshState, MeshState_Seen as Seen } from "../gen/robomesh_pb";
import { MeshStateSchema } from "../gen/robomesh_pb";
import type { Latest } from "./topics";
import { ageOf, isStale, useTopics } from "./topics";

/** s: from there on, times of two machines can no longer be compared by eye. */
export const CLOCK_OFF_S = 0.5;

/** The newest view of the mesh of each site, by site. */
export function useMesh(): ReadonlyMap<string, Latest<MeshState>> {
  const states = useTopics(MeshStateSchema, "robomesh/*/-/mesh");
  return new Map([...states].map(([key, latest]) => [key.split("/")[1] ?? "", latest]));
}

/** Age [s] of a process's last health message now, with that of the report. */
export function seenAge(seen: Seen, latest: Latest<MeshState>): number {
  return seen.ageS + (ageOf(latest) ?? 0);
}

export function isSilent(seen: Seen, latest: Latest<MeshState>): boolean {
  return isStale("health/*", seenAge(seen, latest));
}

/** Whether its clock is off by more than what can be measured leaves open. */
export function isClockOff({ clockOffsetS, roundTripS }: Seen): boolean {
  return clockOffsetS !== undefined && Math.abs(clockOffsetS) - (roundTripS ?? 0) / 2 > CLOCK_OFF_S;
}

export function isMeshStale(latest: Latest<MeshState> | undefined): boolean {
  return !latest || isStale("mesh", ageOf(latest));
}
