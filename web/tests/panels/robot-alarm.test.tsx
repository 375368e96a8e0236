// The most urgent alarm, above the robot's page.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import {
  ControllerState_Activity as Activity,
  ControllerStateSchema,
  EventSchema,
  Event_Severity as Severity,
} from "../../src/gen/robomesh_pb";
import { newPage } from "../console";
import { press, pressable, texts } from "../hands";
import { show } from "../shown";

const at = (s: number) => timestampFromMs(1e12 + 1000 * s);
const event = (s: number, severity = Severity.CRITICAL, code = "axis.torn") =>
  create(EventSchema, { timestamp: at(s), severity, code, text: "axis 2 is torn" });
const STOPPED = { activity: Activity.MOVING, stop: { sent: true, since: at(0) } };
let draw: (state: MessageInitShape<typeof ControllerStateSchema> | null, ...events: ReturnType<typeof event>[]) => void;

beforeEach(async () => {
  newPage();
  const { RobotAlarm } = await import("../../src/panels/robot-alarm");
  const place = show(null);
  draw = (state, ...events) =>
    show(<RobotAlarm state={state ? create(ControllerStateSchema, state) : undefined} events={events} />, place);
});

const CRITICAL = expect.stringMatching(/^At .*: axis 2 is torn$/);

test("an arm that moves on after its stop raises an alarm that nobody can dismiss", () => {
  draw({ ...STOPPED, timestamp: at(3) }, event(2));
  expect(texts("[role=alert]")).toEqual([expect.stringMatching(/^It moves although .* emergency stop/)]);
  expect(pressable()).toEqual([]);
});

test.each([
  ["nothing happened", null, [], []],
  ["an error happened", null, [event(1, Severity.ERROR)], []],
  ["a critical event happened, and then a lesser one", null, [event(2, Severity.INFO), event(1)], [CRITICAL]],
  ["a critical event happened 10 min ago", { timestamp: at(600) }, [event(0)], [CRITICAL]],
  ["a critical event is older", { timestamp: at(601) }, [event(0)], []],
  [
    "the arm did not obey before",
    { timestamp: at(10) },
    [event(0, Severity.CRITICAL, "stop.disobeyed")],
    [expect.stringMatching(/^At .* it moved on although it was told to stop\.$/)],
  ],
])("when %s, the page says so", (_, state, events, says) => {
  draw(state, ...events);
  expect(texts("[role=alert] [title]")).toEqual(says);
});

test("a dismissed alarm stays away, and a later one comes", () => {
  draw(null, event(1));
  press("Dismiss");
  expect(texts("[role=alert]")).toEqual([]);
  draw(null, event(2), event(1));
  expect(texts("[role=alert] [title]")).toEqual([CRITICAL]);
});
