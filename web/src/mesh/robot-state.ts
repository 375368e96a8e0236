// How a robot is, in one word with its colour and shape; whether it heeds a stop; why it takes no motion.

import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { ControllerState, Event } from "../gen/robomesh_pb";
import {
  ControllerState_Activity as Activity,
  ControllerState_Known as Known,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
} from "../gen/robomesh_pb";
import { stampTime } from "../i18n/format";
import { reasonsText } from "../i18n/reasons";
import type { TextName } from "../i18n/texts";
import { t } from "../i18n/texts";
import type { Latest } from "./topics";
import { ageOf, isStale } from "./topics";

/** How much a state asks to be looked at; each has a colour and a shape of its own. */
export type Level = "normal" | "warning" | "alarm";

export interface StateWord {
  word: TextName;
  level: Level;
}

const ACTIVITIES: Record<Activity, StateWord> = {
  [Activity.ACTIVITY_UNSPECIFIED]: { word: "state_unknown", level: "normal" },
  [Activity.ACTIVITY_UNKNOWN]: { word: "state_unknown", level: "normal" },
  [Activity.IDLE]: { word: "state_idle", level: "normal" },
  [Activity.MOVING]: { word: "state_moving", level: "normal" },
  [Activity.HOMING]: { word: "state_homing", level: "normal" },
  [Activity.HOLDING]: { word: "state_holding", level: "warning" },
  [Activity.STOPPED]: { word: "state_stopped", level: "alarm" },
  [Activity.FAULT]: { word: "state_fault", level: "alarm" },
};

const MOVES = new Set([Activity.MOVING, Activity.HOMING]);
const RESTS = new Set([Activity.IDLE, Activity.HOLDING, Activity.STOPPED, Activity.FAULT]);

// The gateway waits as long before it says so, and then says it again each 2 s.
const HEEDED_WITHIN_MS = 2000;
const TOLD_AGAIN_MS = 3000;
export const DISOBEYED = "stop.disobeyed";

/** How long before a controller's report something was [ms], by the gateway's clock. */
export function before(state: ControllerState, stamp: Timestamp | undefined): number {
  return state.timestamp && stamp ? timestampMs(state.timestamp) - timestampMs(stamp) : 0;
}

/** Whether the arm moves on although its stop was sent: by the controller's word, or by the gateway's event. */
export function disobeys(state: ControllerState | undefined, events: readonly Event[] = []): boolean {
  const stop = state?.stop;
  if (!state || !stop?.sent) return false;
  if (MOVES.has(state.activity) && before(state, stop.since) > HEEDED_WITHIN_MS) return true;
  // Whichever stop it was: who asks again does not hide it.
  return events.some(({ code, timestamp }) => code === DISOBEYED && before(state, timestamp) < TOLD_AGAIN_MS);
}

/** A latched stop in words, by whom, since when. Asked for is not stopped: they say what is known of the arm. */
export function stopText({ stop, activity }: ControllerState, disobeyed = false): string {
  if (!stop) return "";
  const text = !stop.sent
    ? "stop_unsent_by"
    : disobeyed || MOVES.has(activity)
      ? "stop_moving_by"
      : RESTS.has(activity)
        ? "stopped_by"
        : "stop_sent_by";
  return t(text, { by: stop.by || "–", time: stampTime(stop.since) });
}

/** The state word of a robot, the most urgent first. */
export function stateWord(controller: Latest<ControllerState> | undefined, events?: readonly Event[]): StateWord {
  if (!controller) return { word: "state_unknown", level: "warning" };
  if (isStale("controller", ageOf(controller))) return { word: "state_stale", level: "warning" };
  const { link, stop, fault, activity } = controller.message;
  if (disobeys(controller.message, events)) return { word: "state_disobeys", level: "alarm" };
  if (fault) return { word: "state_fault", level: "alarm" };
  if (stop && !stop.sent) return { word: "state_stop_unsent", level: "alarm" };
  if (stop && MOVES.has(activity)) return { word: "state_stopping", level: "alarm" };
  if (stop) return { word: RESTS.has(activity) ? "state_stopped" : "state_stop_sent", level: "alarm" };
  if (link === Link.DOWN) return { word: "state_no_link", level: "alarm" };
  if (link === Link.SILENT) return { word: "state_silent", level: "warning" };
  return ACTIVITIES[activity] ?? { word: "state_unknown", level: "warning" };
}

/** Whether the controller stopped by itself, or has a fault: it moves no more until it is reset. */
export function stoppedByItself(state: ControllerState | undefined): boolean {
  return state !== undefined && !state.stop && [Activity.STOPPED, Activity.FAULT].includes(state.activity);
}

/** Why the robot can be moved by nobody now, and what to do; empty: as far as is known, it can. */
export function whyNoMotion(state: ControllerState | undefined): string {
  if (!state) return "";
  if (state.readOnly) return t("read_only_text");
  if (state.stop) return t("reset_needs");
  if (state.link !== Link.UP) return t("no_motion_link");
  if (state.mode === Mode.LOCAL) return t("no_motion_local");
  if (stoppedByItself(state)) return t("own_reset_needs");
  return "";
}

/** Why no joint can be moved; a robot that is not homed can be homed all the same. */
export function whyNoMove(state: ControllerState | undefined): string {
  return whyNoMotion(state) || (state?.homed === Known.NO ? t("no_motion_unhomed") : "");
}

/** Whether the controller says that the arm moves. */
export function moves(state: ControllerState | undefined): boolean {
  return state !== undefined && MOVES.has(state.activity);
}

/** What is wrong, in words. */
export function problemOf(state: ControllerState | undefined): string {
  if (disobeys(state)) return t("disobeys");
  if (state?.fault) return state.fault;
  if (state?.stop) return stopText(state);
  return reasonsText(state?.linkReasons, state?.linkText);
}
