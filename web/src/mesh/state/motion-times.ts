// How long motions took, by the times of their requests and of the controller's reports; known for those seen here.

import { useEffect, useRef, useState } from "preact/hooks";
import type { AuditEntry, ControllerState } from "../../gen/robomesh_pb";
import { ControllerState_Activity as Activity, AuditEntry_Outcome as Outcome } from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { moves } from "./robot-state";

const MOTIONS = new Set(["HOME", "MOVE_ABSOLUTE", "MOVE_RELATIVE"]);

/** Return the duration [s] of each completed motion, by the number of its audit entry. */
export function useMotionTimes(
  audit: readonly AuditEntry[],
  state: ControllerState | undefined,
): ReadonlyMap<bigint, number> {
  const [times, setTimes] = useState<ReadonlyMap<bigint, number>>(new Map());
  const moved = useRef(false);
  const moving = moves(state);
  useEffect(() => {
    const ended = moved.current && !moving;
    moved.current = moving;
    // Another end than rest at the target: a stop, a hold, a fault.
    if (!ended || !state || state.stop || state.activity !== Activity.IDLE) return;
    const end = stampMs(state.timestamp);
    const last = audit.find(
      ({ request, outcome, timestamp }) =>
        MOTIONS.has(request) && outcome === Outcome.ACCEPTED && stampMs(timestamp) < end,
    );
    if (last) setTimes((known) => new Map([...known, [last.number, (end - stampMs(last.timestamp)) / 1000]]));
  }, [moving]);
  return times;
}
