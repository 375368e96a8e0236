// The program that the gateway runs, or ran last, in one line on every page of the robot.

import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { Event, ProgramState } from "../../gen/robomesh_pb";
import { ProgramState_Outcome as Outcome } from "../../gen/robomesh_pb";
import { clock, staleText } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import { t } from "../../i18n/texts";
import { ageOf, isStale } from "../../mesh/state/staleness";
import type { Latest } from "../../mesh/state/topics";

const SHOWN_MS = 60_000; // after its end
const ENDS = new Set(["program.done", "program.ended"]);

/** Return whether a run is in progress, or ended within the last minute. */
export function isShown(
  latest: Latest<ProgramState> | undefined,
  events: readonly Event[],
): latest is Latest<ProgramState> {
  if (!latest) return false;
  const { outcome, timestamp } = latest.message;
  if (outcome === Outcome.RUNNING) return true;
  if (outcome !== Outcome.DONE && outcome !== Outcome.ENDED) return false;
  const end = events.find(({ code }) => ENDS.has(code));
  // Both times are from the gateway's clock.
  return end !== undefined && between(end.timestamp, timestamp) < SHOWN_MS;
}

export function ProgramLine({ latest }: { latest: Latest<ProgramState> }) {
  const { outcome } = latest.message;
  const age = ageOf(latest);
  const stale = outcome === Outcome.RUNNING && isStale("program", age);
  const words = programText(latest);
  return (
    <p class={`program-line row to-end gap-4 ${outcome === Outcome.ENDED ? "ended" : ""}`}>
      {(stale || outcome === Outcome.ENDED) && <span class="shape warning" aria-hidden="true" />}
      <span class={`program-words clip ${stale ? "outdated" : ""}`} title={words}>
        {words}
      </span>
      {stale && <span class="age">{staleText(age)}</span>}
    </p>
  );
}

function programText({ message }: Latest<ProgramState>): string {
  const { name, operator, line, statement, step, steps, leftS, text } = message;
  const at = t("program_at", { line, statement });
  switch (message.outcome) {
    case Outcome.DONE:
      return t("program_done", { name, operator });
    case Outcome.ENDED:
      return t("program_ended", { name, operator, at, text: reasonText(message.reason, text) });
    default: {
      const gone = clock(between(message.since, message.timestamp) / 1000);
      // The gateway reports it each second, and not less of it while the program is held.
      const time = leftS === undefined ? gone : t("program_left", { gone, left: clock(Math.ceil(leftS)) });
      return t("program_runs", { name, operator, at, time, step, steps });
    }
  }
}

function between(from: Timestamp | undefined, to: Timestamp | undefined): number {
  return from && to ? timestampMs(to) - timestampMs(from) : 0;
}
