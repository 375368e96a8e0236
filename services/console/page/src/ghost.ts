// Where the arm would stand at a target that is being set: asked of the mesh, shown as a ghost.

import { signal } from "@preact/signals";
import { ForwardAnswerSchema, ForwardRequestSchema } from "./gen/robomesh_pb";
import { ask } from "./mesh";

/** Placements of the links in the base frame (16 numbers, by rows) at the target; null: no target. */
export const ghost = signal<ReadonlyMap<string, readonly number[]> | null>(null);

let wanted: { robotKey: string; positions: readonly number[] } | null = null;
let asking = false;

/** Shows the ghost at joint positions; null takes it away. One question at a time, the newest next. */
export function showGhost(robotKey: string, positions: readonly number[] | null): void {
  wanted = positions && { robotKey, positions };
  if (!wanted) ghost.value = null;
  else if (!asking) void askNext();
}

async function askNext(): Promise<void> {
  asking = true;
  while (wanted) {
    const { robotKey, positions } = wanted;
    try {
      const key = `${robotKey}/kinematics/forward`;
      const request = { jointPositions: [...positions] };
      const answer = await ask(key, ForwardRequestSchema, request, ForwardAnswerSchema, 1);
      if (wanted) ghost.value = new Map(answer.links.map((link) => [link.name, link.placementToBase]));
    } catch {
      ghost.value = null; // without kinematics a target is set as well, unseen
    }
    if (wanted?.positions === positions) break;
  }
  asking = false;
}
