// Health of the mesh by each site's watch, and its problems in words.

import type { MeshState, MeshState_Seen as Seen } from "../../gen/robomesh_pb";
import { MeshStateSchema } from "../../gen/robomesh_pb";
import { ageOf, isStale } from "./staleness";
import type { Latest } from "./topics";
import { useTopics } from "./topics";

/** s: with a larger offset, times of two machines cannot be compared by eye. */
export const CLOCK_OFF_S = 0.5;

/** The newest view of the mesh by site. */
export function useMesh(): ReadonlyMap<string, Latest<MeshState>> {
  const states = useTopics(MeshStateSchema, "robomesh/*/-/mesh");
  return new Map([...states].map(([key, latest]) => [key.split("/")[1] ?? "", latest]));
}

/** Return the age [s] of a process's last health message, including the report's own age. */
export function reportAge(seen: Seen, latest: Latest<MeshState>): number {
  return seen.ageS + (ageOf(latest) ?? 0);
}

export function isSilent(seen: Seen, latest: Latest<MeshState>): boolean {
  return isStale("health/*", reportAge(seen, latest));
}

/** Return whether a clock's offset exceeds the uncertainty of its measurement. */
export function isClockOff({ clockOffsetS, roundTripS }: Seen): boolean {
  return clockOffsetS !== undefined && Math.abs(clockOffsetS) - (roundTripS ?? 0) / 2 > CLOCK_OFF_S;
}

export function isMeshStale(latest: Latest<MeshState> | undefined): boolean {
  return !latest || isStale("mesh", ageOf(latest));
}
