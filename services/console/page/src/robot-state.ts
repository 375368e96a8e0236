// The one word that says how a robot is, with its colour and shape.

import { ControllerState_Activity as Activity, ControllerState_Link as Link } from "./gen/robomesh_pb";
import type { ControllerState, StopState } from "./gen/robomesh_pb";
import { stampTime } from "./format";
import { ageOf, isStale } from "./topics";
import type { Latest } from "./topics";
import { t } from "./texts";
import type { TextName } from "./texts";

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

/** A latched stop in words: by whom, since when, and whether the controller had it. */
export function stopText(stop: StopState): string {
  const values = { by: stop.by || "–", time: stampTime(stop.since) };
  return t(stop.sent ? "stopped_by" : "stop_unsent_by", values);
}

/** The state word of a robot, the most urgent first. */
export function stateWord(controller: Latest<ControllerState> | undefined): StateWord {
  if (!controller) return { word: "state_unknown", level: "warning" };
  if (isStale("controller", ageOf(controller))) return { word: "state_stale", level: "warning" };
  const { link, stop, fault, activity } = controller.message;
  if (fault) return { word: "state_fault", level: "alarm" };
  // Asked for is not stopped: the word says what is known of the arm.
  if (stop && !stop.sent) return { word: "state_stop_unsent", level: "alarm" };
  if (stop) return { word: MOVES.has(activity) ? "state_stopping" : "state_stopped", level: "alarm" };
  if (link === Link.DOWN) return { word: "state_no_link", level: "alarm" };
  if (link === Link.SILENT) return { word: "state_silent", level: "warning" };
  return ACTIVITIES[activity] ?? { word: "state_unknown", level: "warning" };
}
