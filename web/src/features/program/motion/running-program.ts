// The program that the gateway runs, or ran last, as it publishes it.

import { signal } from "@preact/signals";
import type { ProgramState } from "../../../gen/robomesh_pb";
import { ProgramState_Outcome as Outcome } from "../../../gen/robomesh_pb";

/** The newest state while fresh; null: none. */
export const program = signal<ProgramState | null>(null);

export function isRunning(): boolean {
  return program.value?.outcome === Outcome.RUNNING;
}

/** Return the running line if the text still contains it unchanged; null: none. */
export function runningLine(lines: readonly string[]): number | null {
  const now = program.value;
  if (!now || now.outcome !== Outcome.RUNNING) return null;
  const written = (lines[now.line - 1] ?? "").replace(/#.*/, "").trim();
  return written && now.statement.replace(/#.*/, "").trim() === written ? now.line : null;
}
