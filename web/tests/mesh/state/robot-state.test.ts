// The state of a robot in words: what a person must see first, and why nothing moves.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create, fromBinary } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import {
  ControllerState_Activity as Activity,
  CommandRequest_Command as Command,
  ControllerStateSchema,
  EventSchema,
  ControllerState_Known as Known,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
  ReplayStateSchema,
  Capabilities_Stops as Stops,
  ToPage_HelloSchema,
} from "../../../src/gen/robomesh_pb";
import { stampWhen } from "../../../src/i18n/format";
import { t } from "../../../src/i18n/texts";
import { hello } from "../../../src/mesh/console/connection";
import * as page from "../../../src/mesh/state/robot-state";
import { latest } from "../../latest";
import { ARM, payloads } from "../../recorded";

type Init = MessageInitShape<typeof ControllerStateSchema>;
const at = (second: number) => timestampFromMs(1e12 + 1000 * second);
const up = { link: Link.UP, activity: Activity.IDLE, timestamp: at(10) };
const state = (values: Init = {}) => create(ControllerStateSchema, { ...up, ...values } as Init);
const sent = { sent: true, by: "li", since: at(0) };
const unsent = { ...sent, sent: false };
const just = { ...sent, since: at(9) };
const { MOVING, HOMING, HOLDING, STOPPED, FAULT, ACTIVITY_UNKNOWN } = Activity;
const reasons = (code: string, text = code, ...causes: object[]) => ({ linkReasons: [{ code, text, causes }] }) as Init;

beforeEach(() => {
  const stale = ["controller", "replay"].map((topic) => ({ topic, afterS: 2 }));
  hello.value = create(ToPage_HelloSchema, { stale });
});

test.each<[string, Init, string, string?]>([
  ["at rest", {}, "state_idle normal"],
  ["moving", { activity: MOVING }, "state_moving motion"],
  ["homing", { activity: HOMING }, "state_homing motion"],
  ["on hold", { activity: HOLDING }, "state_holding warning"],
  ["of a newer program", { activity: 77 as Activity }, "state_unknown warning", "77"],
  ["silent", { link: Link.SILENT, activity: MOVING }, "state_silent warning"],
  ["without a link", { link: Link.DOWN, activity: MOVING }, "state_no_link alarm"],
  ["stopped without a link", { link: Link.DOWN, stop: sent, activity: STOPPED }, "state_stopped alarm"],
  ["told to stop, and not known to rest", { stop: sent, activity: ACTIVITY_UNKNOWN }, "state_stop_sent alarm"],
  ["told to stop just now", { stop: just, activity: MOVING }, "state_stopping alarm"],
  ["still moving after a stop", { stop: sent, activity: MOVING }, "state_disobeys alarm"],
  ["not told of its stop", { stop: unsent, activity: MOVING }, "state_stop_unsent alarm"],
  ["with a fault and a stop", { fault: "hot", stop: just, activity: STOPPED }, "state_fault alarm"],
  ["disobeying with a fault", { fault: "hot", stop: sent, activity: HOMING }, "state_disobeys alarm"],
  ["running a program at rest", { program: {} }, "state_running motion"],
  ["running and moving", { program: {}, activity: MOVING }, "state_running motion", "running_moves"],
  ["running and homing", { program: {}, activity: HOMING }, "state_running motion", "running_homes"],
  ["in a held program", { program: { held: true, waitS: 1 } }, "state_holding warning"],
  ["with a program after a stop", { program: {}, activity: STOPPED }, "state_stopped alarm"],
])("a robot %s has one word, the most urgent", (_, values, shown, detail) => {
  const { word, level, detail: found } = page.stateWord(latest(state(values)));
  expect(`${word} ${level}`).toBe(shown);
  expect(found).toBe(detail?.startsWith("running") ? t(detail as "running_moves") : detail);
});

test("a program that waits says for how long", () => {
  const word = page.stateWord(latest(state({ program: { waitS: 1.2345 }, activity: MOVING })));
  expect(page.stateText(word)).toBe("Running · waits 1.23\u202fs");
  expect(page.stateText(page.stateWord(latest(state())))).toBe("Idle");
});

test.each([
  ["not known", undefined, "state_unknown"],
  ["old", latest(state({ activity: MOVING, fault: "hot" }), 3), "state_stale"],
  ["of unknown age", latest(state(), null), "state_stale"],
])("a state that is %s never looks live", (_, controller, word) => {
  expect(page.stateWord(controller)).toEqual({ word, level: "warning" });
  if (controller)
    expect(page.problemOf({ word: "state_stale", level: "warning" }, controller.message)).toBe(t("nothing_comes"));
});

test("the gateway's event that a stop is disobeyed counts for 3 s, whatever the controller reports", () => {
  const stopped = state({ stop: just, activity: STOPPED });
  const event = (second: number, code = page.DISOBEYED) => [create(EventSchema, { code, timestamp: at(second) })];
  expect(page.disobeys(stopped, event(7.1))).toBe(true);
  expect(page.disobeys(stopped, event(6.9))).toBe(false);
  expect(page.disobeys(stopped, event(9, "stop.sent"))).toBe(false);
  expect(page.disobeys(state({ stop: unsent }), event(9))).toBe(false);
  expect(page.disobeys(undefined, event(9))).toBe(false);
  expect(page.stateWord(latest(stopped), event(9)).word).toBe("state_disobeys");
  expect(page.stopText(stopped, true)).toContain("still moves");
  expect(page.msBefore(stopped, undefined)).toBe(0);
});

test.each<[string, Init, "stop_unsent_by" | "stop_moving_by" | "stopped_by" | "stop_sent_by"]>([
  ["not sent", { stop: unsent, activity: STOPPED }, "stop_unsent_by"],
  ["sent while it moves", { stop: sent, activity: HOMING }, "stop_moving_by"],
  ["sent, and it rests", { stop: sent, activity: HOLDING }, "stopped_by"],
  ["sent, and nothing more is known", { stop: sent, activity: ACTIVITY_UNKNOWN }, "stop_sent_by"],
])("a stop that was %s says so, by whom and since when", (_, values, text) => {
  expect(page.stopText(state(values))).toBe(t(text, { by: "li", time: stampWhen(at(0)) }));
  expect(page.stopText(state())).toBe("");
});

const read = (code: string, text = code) => ({ readOnly: true, ...reasons("robot.read_only", "r", { code, text }) });
test.each<[string, Init, string]>([
  ["can move", {}, ""],
  ["is only read", read("robot.reads_only"), t("reads_only_text")],
  ["has no proven stop", { readOnly: true }, t("read_only_text")],
  [
    "has an obstacle of its own",
    read("joints.disagree", "the joints disagree"),
    t("no_motion_reason", { text: "the joints disagree" }),
  ],
  ["has its motion off", read("robot.motion_off", "off"), t("no_motion_reason", { text: "off" })],
  ["has an obstacle of its kind", read("fanuc.not_connected", "no RMI"), t("no_motion_reason", { text: "no RMI" })],
  ["is stopped", { stop: sent, link: Link.DOWN }, t("reset_needs")],
  ["has no link", { link: Link.SILENT, mode: Mode.LOCAL }, t("no_motion_link")],
  ["is in local mode", { mode: Mode.LOCAL, activity: FAULT }, t("no_motion_local")],
  ["has a fault", { activity: FAULT }, t("own_reset_needs")],
  ["stopped by itself", { activity: STOPPED }, t("own_reset_needs")],
  ["has unproven joints", { jointsUnproven: true }, "Joints unproven."],
  [
    "has stale positions",
    reasons("positions.stale", "positions are old"),
    t("no_motion_reason", { text: "positions are old" }),
  ],
])("a robot that %s says why nothing moves it", (_, values, why) => {
  expect(page.whyNoMotion(state(values))).toBe(why);
  expect(page.whyNoNewMotion(state(values))).toBe(why);
  expect(page.whyNoTarget(state(values))).toBe(why);
});

test("joints that may not be the model's name their reason as a sentence", () => {
  const unproven = { jointsUnproven: true, ...reasons("joints.disagree", "the joints disagree") };
  expect(page.whyUnproven(state(unproven))).toBe("The joints disagree.");
  expect(page.whyUnproven(state({ jointsUnproven: true, ...reasons("other") }))).toBe("Joints unproven.");
  expect(page.whyUnproven(state(reasons("joints.disagree")))).toBe("");
});

test.each<[string, Init, "no_motion_held" | "no_motion_jog" | "no_motion_program"]>([
  ["holding", { activity: HOLDING, jog: {} }, "no_motion_held"],
  ["in a held program", { program: { held: true } }, "no_motion_held"],
  ["jogged", { jog: {}, program: {} }, "no_motion_jog"],
  ["running a program", { program: {} }, "no_motion_program"],
])("a robot that is %s takes no new motion, but goes on", (_, values, why) => {
  expect(page.whyNoNewMotion(state(values))).toBe(t(why));
  expect(page.whyNoMotion(state(values))).toBe("");
});

test("a robot that is not homed has no target, and can be homed", () => {
  expect(page.whyNoTarget(state({ homed: Known.NO }))).toBe(t("no_motion_unhomed"));
  expect(page.whyNoNewMotion(state({ homed: Known.NO }))).toBe("");
  expect(page.whyNoTarget(state({ homed: Known.YES }))).toBe("");
});

test("of a robot without a state no obstacle is known", () => {
  expect(
    [page.whyNoMotion, page.whyNoNewMotion, page.whyNoTarget, page.whyUnproven].map((why) => why(undefined)),
  ).toEqual(["", "", "", ""]);
  expect([page.isOnlyWatched, page.stoppedByItself, page.moves].map((is) => is(undefined))).toEqual([
    false,
    false,
    false,
  ]);
});

test("only watched is a robot whose driver or site file gives it no motion", () => {
  expect(page.isOnlyWatched(state(read("robot.reads_only")))).toBe(true);
  expect(page.isOnlyWatched(state(read("robot.motion_off")))).toBe(true);
  expect(page.isOnlyWatched(state(read("joints.disagree")))).toBe(false);
  expect(page.isOnlyWatched(state({ ...read("robot.reads_only"), readOnly: false }))).toBe(false);
});

test.each([
  [Stops.NONE, 0, "stop_none"],
  [Stops.NOT_NOW, 0, "stop_not_now"],
  [Stops.OURS, 0, "stop_ours"],
  [Stops.OURS, 3, "stop_not_now"],
  [Stops.ANY, 0, "stop"],
  [Stops.ANY, 3, "stop_not_now"],
  [Stops.NONE, 3, "stop_none"],
])("a button for stops %i in a state %i s old promises no more than it can do: %s", (stops, ageS, text) => {
  expect(page.stopRequestText(latest(state({ capabilities: { stops } }), ageS))).toBe(text);
});

test("a stop is offered before anything is known of the robot, and to one of an older gateway", () => {
  expect(page.stopRequestText(undefined)).toBe("stop");
  expect(page.stopRequestText(latest(state()))).toBe("stop");
});

test("a command that the controller does not have says so", () => {
  const able = (values: Init) => state({ capabilities: { commands: [Command.JOG] }, ...values } as Init);
  const absolute = able({ capabilities: { absolute: true } });
  expect(page.whyNoCommand(able({}), Command.JOG)).toBe("");
  expect(page.whyNoCommand(able({}), Command.HOME)).toBe(t("no_such_command"));
  expect(page.whyNoCommand(absolute, Command.HOME)).toBe(t("homed_by_nature"));
  expect(page.whyNoCommand(absolute, Command.JOG)).toBe(t("no_such_command"));
  expect(page.whyNoCommand(able({ readOnly: true }), Command.HOME)).toBe("");
  expect(page.whyNoCommand(undefined, Command.HOME)).toBe("");
});

test.each<[string, Init, string]>([
  ["a fault", { fault: "hot" }, "hot"],
  ["a disobeyed stop", { stop: sent, activity: MOVING }, t("disobeys")],
  ["a stop", { stop: sent, activity: STOPPED }, t("stopped_by", { by: "li", time: stampWhen(at(0)) })],
  ["a stop of its own", { activity: STOPPED }, t("own_stop")],
  ["a fault of its own", { activity: FAULT }, t("own_fault")],
  ["a lost link", { link: Link.DOWN, linkText: "old", ...reasons("link.down", "refused") }, "refused"],
  ["a lost link of an older gateway", { link: Link.SILENT, linkText: "no unit" }, "no unit"],
  ["unproven joints", { jointsUnproven: true }, t("joints_unproven")],
  ["nothing", { linkText: "old" }, ""],
])("the problem of a robot with %s is the reason of its word only", (_, values, problem) => {
  const made = state(values);
  expect(page.problemOf(page.stateWord(latest(made)), made)).toBe(problem);
});

test("a replay has the recorded state only while it plays", () => {
  const robot = latest(state({ activity: MOVING }), 0);
  const word = (values: object, ageS = 0, controller: typeof robot | undefined = robot) =>
    page.replayWord(latest(create(ReplayStateSchema, { durationS: 10, ...values }), ageS), controller).word;
  expect(page.replayWord(undefined, robot).word).toBe("state_unknown");
  expect(word({ playing: true, positionS: 10 })).toBe("state_moving");
  expect(word({ playing: true, positionS: 5 }, 3)).toBe("state_replay_ended");
  expect(word({ playing: false, positionS: 5 })).toBe("state_replay_paused");
  expect(word({ playing: false, positionS: 9.995 })).toBe("state_replay_ended");
  expect(page.replayWord(latest(create(ReplayStateSchema, { playing: true, durationS: 9 })), undefined).word).toBe(
    "state_replay_paused",
  );
});

test("a real robot that homes, moves, is stopped and reset has the words for that, one after the other", () => {
  const words = payloads(`${ARM}/controller`).map(
    (each) => page.stateWord(latest(fromBinary(ControllerStateSchema, each))).word,
  );
  expect(words.join(" ")).toMatch(
    /^state_idle.* state_homing.* state_moving.* state_stopping.* state_stopped.* state_idle$/,
  );
});
