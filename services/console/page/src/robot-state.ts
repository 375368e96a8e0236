// The one word that says how a robot is, with its colour and shape.

import { ControllerState_Activity as Activity, ControllerState_Link as Link } from "./gen/robomesh_pb";
import type { ControllerState } from "./gen/robomesh_pb";
import { ageOf, isStale } from "./topics";
import type { Latest } from "./topics";
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

/** The state word of a robot, the most urgent first. */
export function stateWord(controller: Latest<ControllerState> | undefined): StateWord {
  if (!controller) return { word: "state_unknown", level: "warning" };
  if (isStale("controller", ageOf(controller))) return { word: "state_stale", level: "warning" };
  const { link, stop, fault, activity } = controller.message;
  if (fault) return { word: "state_fault", level: "alarm" };
  if (stop) return { word: "state_stopped", level: "alarm" };
  if (link === Link.DOWN) return { word: "state_no_link", level: "alarm" };
  if (link === Link.SILENT) return { word: "state_silent", level: "warning" };
  return ACTIVITIES[activity] ?? { word: "state_unknown", level: "warning" };
}
