// The program that the gateway runs, or ran last: what every monitor is told of it.

import { signal } from "@preact/signals";
import type { ProgramState } from "../../gen/robomesh_pb";
import { ProgramState_Outcome as Outcome } from "../../gen/robomesh_pb";

/** The newest, while it is fresh; null: nobody says so now. */
export const program = signal<ProgramState | null>(null);

export function isRunning(): boolean {
  return program.value?.outcome === Outcome.RUNNING;
}

/** The line that runs, where the text still has it as it runs; null: none does. */
export function runningLine(lines: readonly string[]): number | null {
  const now = program.value;
  if (!now || now.outcome !== Outcome.RUNNING) return null;
  const written = (lines[now.line - 1] ?? "").replace(/#.*/, "").trim();
  return written && now.statement.replace(/#.*/, "").trim() === written ? now.line : null;
}
