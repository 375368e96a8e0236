// Rows of a recording's events: the steps of a program are folded under its start.

import { Event_Severity as Severity } from "../../../gen/robomesh_pb";
import type { RecordedEvent } from "./recorder-requests";

/** The source of requests that a gateway's program sends. */
const PROGRAM = "program";
const STARTED = "program.started";

/** An event, and the steps of the run that it begins. */
export interface Row {
  happened: RecordedEvent;
  steps: readonly RecordedEvent[];
}

/** Return the rows of events, oldest first; a step that was refused, or whose start is not recorded, has a separate row. */
export function foldSteps(events: readonly RecordedEvent[]): Row[] {
  const rows: { happened: RecordedEvent; steps: RecordedEvent[] }[] = [];
  let run: RecordedEvent[] | null = null;
  for (const happened of events) {
    const { source, severity } = happened.event;
    if (run && source === PROGRAM && severity === Severity.INFO) {
      run.push(happened);
      continue;
    }
    const row = { happened, steps: [] };
    rows.push(row);
    if (happened.event.code === STARTED) run = row.steps;
  }
  return rows;
}
