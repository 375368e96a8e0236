// State of a robot in one word with colour and shape; whether it obeys a stop; why it accepts no motion.

import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { ControllerState, ControllerState_Program, Event, ReplayState } from "../../gen/robomesh_pb";
import {
  ControllerState_Activity as Activity,
  CommandRequest_Command as Command,
  ControllerState_Known as Known,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
  Capabilities_Stops as Stops,
} from "../../gen/robomesh_pb";
import { stampWhen } from "../../i18n/format";
import { isOfKind, reasonsText, reasonText } from "../../i18n/reasons";
import { operatorText } from "../../i18n/stop-words";
import type { TextName } from "../../i18n/texts";
import { t } from "../../i18n/texts";
import { ageOf, isStale } from "./staleness";
import type { Latest } from "./topics";

/** Level of attention; each has its own colour and shape. */
export type Level = "normal" | "warning" | "alarm";

export interface StateWord {
  word: TextName;
  /** "motion": normal, and the arm moves or is about to. */
  level: Level | "motion";
  /** What it does in this state, in words. */
  detail?: string;
}

const ACTIVITIES: Record<Activity, StateWord> = {
  [Activity.ACTIVITY_UNSPECIFIED]: { word: "state_unknown", level: "normal" },
  [Activity.ACTIVITY_UNKNOWN]: { word: "state_unknown", level: "normal" },
  [Activity.IDLE]: { word: "state_idle", level: "normal" },
  [Activity.MOVING]: { word: "state_moving", level: "motion" },
  [Activity.HOMING]: { word: "state_homing", level: "motion" },
  [Activity.HOLDING]: { word: "state_holding", level: "warning" },
  [Activity.STOPPED]: { word: "state_stopped", level: "alarm" },
  [Activity.FAULT]: { word: "state_fault", level: "alarm" },
};

const MOVES = new Set([Activity.MOVING, Activity.HOMING]);
const NEEDS_RESUME_OR_RESET = new Set([Activity.HOLDING, Activity.STOPPED, Activity.FAULT]);
const NOT_MOVING = new Set([Activity.IDLE, Activity.HOLDING, Activity.STOPPED, Activity.FAULT]);

// The gateway waits as long before it reports this, then repeats it every 2 s.
const STOP_RESPONSE_MS = 2000;
const REPEAT_MS = 3000;
export const DISOBEYED = "stop.disobeyed";
const END_S = 0.01; // a recording's end, by its player's rounding
const POSITIONS_STALE = "positions.stale";
const UNPROVEN = new Set([
  "joints.axes_extra",
  "joints.base_undeclared",
  "joints.not_verified",
  "joints.of_other_robot",
  "joints.disagree",
  "joints.other_model",
  "joints.other_software",
  "joints.invalid",
]);
const READS_ONLY = "robot.reads_only";
const ONLY_WATCHED = new Set([READS_ONLY, "robot.motion_off"]);

/** Return how long before a controller's report an event was [ms], by the gateway's clock. */
export function msBefore(state: ControllerState, stamp: Timestamp | undefined): number {
  return state.timestamp && stamp ? timestampMs(state.timestamp) - timestampMs(stamp) : 0;
}

/** Return whether the arm moves although its stop was sent, by the controller's report or the gateway's event. */
export function disobeys(state: ControllerState | undefined, events: readonly Event[] = []): boolean {
  const stop = state?.stop;
  if (!state || !stop?.sent) return false;
  if (MOVES.has(state.activity) && msBefore(state, stop.since) > STOP_RESPONSE_MS) return true;
  // Any stop counts: a repeated request must not hide the event.
  return events.some(({ code, timestamp }) => code === DISOBEYED && msBefore(state, timestamp) < REPEAT_MS);
}

/** Describe a latched stop: by whom, since when, and the arm's known state. A requested stop is not a stopped arm. */
export function stopText({ stop, activity }: ControllerState, disobeyed = false): string {
  if (!stop) return "";
  const text = !stop.sent
    ? "stop_unsent_by"
    : disobeyed || MOVES.has(activity)
      ? "stop_moving_by"
      : NOT_MOVING.has(activity)
        ? "stopped_by"
        : "stop_sent_by";
  return t(text, { by: operatorText(stop.by), time: stampWhen(stop.since) });
}

/** Return the state word of a robot, the most urgent first. */
export function stateWord(controller: Latest<ControllerState> | undefined, events?: readonly Event[]): StateWord {
  if (!controller) return { word: "state_unknown", level: "warning" };
  if (isStale("controller", ageOf(controller))) return { word: "state_stale", level: "warning" };
  const { link, stop, fault, activity, program } = controller.message;
  if (disobeys(controller.message, events)) return { word: "state_disobeys", level: "alarm" };
  if (fault) return { word: "state_fault", level: "alarm" };
  if (stop && !stop.sent) return { word: "state_stop_unsent", level: "alarm" };
  if (stop && MOVES.has(activity)) return { word: "state_stopping", level: "alarm" };
  if (stop) return { word: NOT_MOVING.has(activity) ? "state_stopped" : "state_stop_sent", level: "alarm" };
  if (link === Link.DOWN) return { word: "state_no_link", level: "alarm" };
  if (link === Link.SILENT) return { word: "state_silent", level: "warning" };
  if (program && !NEEDS_RESUME_OR_RESET.has(activity)) return programWord(program, activity);
  // A newer program's value has no word.
  return ACTIVITIES[activity] ?? { word: "state_unknown", level: "warning", detail: String(activity) };
}

/** Return the state of an arm with a running program: even at rest it can move without a new command. */
function programWord(program: ControllerState_Program, activity: Activity): StateWord {
  if (program.held) return ACTIVITIES[Activity.HOLDING];
  const running = { word: "state_running", level: "motion" } as const;
  if (program.waitS !== undefined)
    return { ...running, detail: t("running_waits", { seconds: Number(program.waitS.toFixed(2)) }) };
  if (activity === Activity.HOMING) return { ...running, detail: t("running_homes") };
  return activity === Activity.MOVING ? { ...running, detail: t("running_moves") } : running;
}

/** Return the state word of a replayed robot: the recorded one only while it plays. */
export function replayWord(
  replay: Latest<ReplayState> | undefined,
  controller: Latest<ControllerState> | undefined,
): StateWord {
  if (!replay) return { word: "state_unknown", level: "normal" };
  const { playing, positionS, durationS } = replay.message;
  if (isStale("replay", ageOf(replay)) || (!playing && positionS >= durationS - END_S))
    return { word: "state_replay_ended", level: "normal" };
  return playing && controller ? stateWord(controller) : { word: "state_replay_paused", level: "normal" };
}

/** Return a state in words, with what the robot does in it. */
export function stateText({ word, detail }: StateWord): string {
  return detail ? `${t(word)} · ${detail}` : t(word);
}

/** Return whether the controller stopped without a request or has a fault; it moves again only after a reset. */
export function stoppedByItself(state: ControllerState | undefined): boolean {
  return state !== undefined && !state.stop && [Activity.STOPPED, Activity.FAULT].includes(state.activity);
}

/** Explain why the joints that the controller sends may not be the model's; empty: they are. */
export function whyUnproven(state: ControllerState | undefined): string {
  if (!state?.jointsUnproven) return "";
  const why = state.linkReasons.filter(({ code }) => UNPROVEN.has(code));
  const text = reasonsText(why, t("joints_unproven"));
  return t("sentence", { text: text.charAt(0).toUpperCase() + text.slice(1) });
}

/** Return whether the robot is only watched, as long as its driver and its site file are the same. */
export function isOnlyWatched(state: ControllerState | undefined): boolean {
  if (!state?.readOnly) return false;
  return state.linkReasons.some(({ causes }) => causes.some(({ code }) => ONLY_WATCHED.has(code)));
}

/** Explain why nothing moves the robot now, not even RESUME, and what to do; empty: it can move, as far as is known. */
export function whyNoMotion(state: ControllerState | undefined): string {
  if (!state) return "";
  if (state.readOnly) {
    const causes = state.linkReasons.flatMap((reason) => reason.causes);
    // A controller's own obstacle; the others are about proofs.
    const own = causes.find(({ code }) => /^joints\.|^robot\.motion_off$/.test(code) || isOfKind(code));
    if (own) return t("no_motion_reason", { text: reasonText(own, own.text) });
    return causes.some(({ code }) => code === READS_ONLY) ? t("reads_only_text") : t("read_only_text");
  }
  if (state.stop) return t("reset_needs");
  if (state.link !== Link.UP) return t("no_motion_link");
  if (state.mode === Mode.LOCAL) return t("no_motion_local");
  if (stoppedByItself(state)) return t("own_reset_needs");
  if (state.jointsUnproven) return whyUnproven(state);
  const stale = state.linkReasons.find(({ code }) => code === POSITIONS_STALE);
  return stale ? t("no_motion_reason", { text: reasonText(stale, stale.text) }) : "";
}

/** Explain why no motion can begin, although a running or held one may go on; empty: it can. */
export function whyNoNewMotion(state: ControllerState | undefined): string {
  const why = whyNoMotion(state);
  if (why || !state) return why;
  if (state.activity === Activity.HOLDING || state.program?.held) return t("no_motion_held");
  if (state.jog) return t("no_motion_jog");
  return state.program ? t("no_motion_program") : "";
}

/** Explain why no joint has a target; a robot that is not homed can still be homed. */
export function whyNoTarget(state: ControllerState | undefined): string {
  return whyNoMotion(state) || (state?.homed === Known.NO ? t("no_motion_unhomed") : "");
}

/** Return what a stop request can do now, as the name of the button's text. */
export function stopRequestText(
  controller: Latest<ControllerState> | undefined,
): "stop" | "stop_ours" | "stop_not_now" | "stop_none" {
  if (!controller) return "stop"; // not known yet
  switch (controller.message.capabilities?.stops) {
    case Stops.NONE:
      return "stop_none";
    case Stops.NOT_NOW:
      return "stop_not_now";
    case Stops.OURS:
      return isStale("controller", ageOf(controller)) ? "stop_not_now" : "stop_ours";
    default:
      return isStale("controller", ageOf(controller)) ? "stop_not_now" : "stop";
  }
}

/** Explain why a command is never sent to the robot; empty: it can be. */
export function whyNoCommand(state: ControllerState | undefined, command: Command): string {
  const { capabilities } = state ?? {};
  if (!capabilities || state?.readOnly || capabilities.commands.includes(command)) return "";
  return t(command === Command.HOME && capabilities.absolute ? "homed_by_nature" : "no_such_command");
}

/** Return whether the controller reports motion. */
export function moves(state: ControllerState | undefined): boolean {
  return state !== undefined && MOVES.has(state.activity);
}

/** Describe the problem: only the reason of this state. */
export function problemOf({ word }: StateWord, state: ControllerState | undefined): string {
  switch (word) {
    case "state_stale":
      return t("nothing_comes"); // the last report about the link is outdated
    case "state_disobeys":
      return t("disobeys");
    case "state_fault":
      return state?.fault || t("own_fault");
    case "state_stopped":
    case "state_stopping":
    case "state_stop_sent":
    case "state_stop_unsent":
      return state?.stop ? stopText(state) : t("own_stop");
    case "state_no_link":
    case "state_silent":
      return reasonsText(state?.linkReasons, state?.linkText);
    default:
      return state?.jointsUnproven ? t("joints_unproven") : "";
  }
}
