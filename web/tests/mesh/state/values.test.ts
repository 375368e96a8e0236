// Names, numbers and units of values to plot. tests/services/test_plotted_values.py compares them with the recorder's.

import type { DescMessage, MessageInitShape } from "@bufbuild/protobuf";
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { beforeEach, expect, test } from "vitest";
import { JointStatesSchema } from "../../../src/gen/foxglove/JointStates_pb";
import {
  ControllerStateSchema,
  DescriptionSchema,
  Description_Joint_Type as JointType,
  KinematicStateSchema,
  ControllerState_Link as Link,
  SignalsSchema,
} from "../../../src/gen/robomesh_pb";
import { hello } from "../../../src/mesh/console/connection";
import * as page from "../../../src/mesh/state/values";
import { ARM, messages, payloads } from "../../recorded";

const greeting = messages.flatMap(({ message }) => (message.case === "hello" ? [message.value] : []))[0];
const description = create(DescriptionSchema, {
  joints: [{ name: "waist" }, { name: "rail/left", type: JointType.PRISMATIC }],
});

function read(topic: string, payload: Uint8Array): Record<string, number> {
  const found: Record<string, number> = {};
  page.readerOf(topic)?.(payload, (name, value) => (found[name] = value));
  return found;
}
const made = <S extends DescMessage>(topic: string, schema: S, values: MessageInitShape<S>) =>
  read(topic, toBinary(schema, create(schema, values)));

beforeEach(() => {
  hello.value = greeting ?? null;
});

test("a real robot's joints and kinematics are read under the names of their parts", () => {
  const payload = payloads(`${ARM}/joints`).at(-1) ?? new Uint8Array();
  const found = read("joints", payload);
  for (const { name, position } of fromBinary(JointStatesSchema, payload).joints)
    expect(found[`joints/${name}/position`]).toBe(position);
  expect(Object.keys(read("kinematics", payloads(`${ARM}/kinematics`).at(-1) ?? payload))).toEqual(
    expect.arrayContaining(["x", "yaw", "speed"].map((name) => `kinematics/tool/${name}`)),
  );
});

test("a number that a message does not have is absent, not 0", () => {
  expect(made("joints", JointStatesSchema, { joints: [{ name: "a", effort: 0 }, { name: "b" }] })).toEqual({
    "joints/a/effort": 0,
  });
  expect(made("kinematics", KinematicStateSchema, {})).toEqual({});
  expect(made("controller", ControllerStateSchema, {})).not.toHaveProperty("controller/rate_hz");
});

test("the margin of a joint is that to its nearer limit, and the tool's speed that of all directions", () => {
  const values = {
    linearVelocity: { x: 3, y: 0, z: -4 },
    limitMargins: [{ name: "waist", lower: 2, upper: 1 }],
    manipulability: 0,
    singularityMargin: 0.5,
    clearance: { distance: 0.25 },
    ownClearance: { distance: 0.125 },
  };
  expect(made("kinematics", KinematicStateSchema, values)).toEqual({
    "kinematics/tool/speed": 5,
    "kinematics/margin/waist": 1,
    "kinematics/manipulability": 0,
    "kinematics/singularity_margin": 0.5,
    "kinematics/clearance": 0.25,
    "kinematics/own_clearance": 0.125,
  });
});

test("of other messages each number, choice and flag is read, of lists by name or place, but no time and no text", () => {
  const found = made("controller", ControllerStateSchema, {
    timestamp: { seconds: 5n },
    link: Link.UP,
    fault: "7",
    readOnly: true,
    counters: { unitsReceived: 2n ** 40n },
    linkReasons: [{ code: "x" }],
    capabilities: { commands: [3, 4] },
  });
  expect(found).toMatchObject({
    "controller/link": 2,
    "controller/read_only": 1,
    "controller/counters/units_received": 2 ** 40,
    "controller/capabilities/commands/1": 4,
  });
  expect(Object.keys(found).filter((name) => /timestamp|fault|code/.test(name))).toEqual([]);
});

test("signals are read as numbers, and bring their units", () => {
  const signals = [
    { name: "payload.mass", unit: "kg", value: { case: "number", value: 1.5 } },
    { name: "io.in.1", value: { case: "on", value: true } },
    { name: "program.name", value: { case: "text", value: "7" } },
  ] as const;
  expect(page.unitOf("signals/payload.mass", description)).toBe("");
  expect(made("signals", SignalsSchema, { signals: [...signals] })).toEqual({
    "signals/payload.mass": 1.5,
    "signals/io.in.1": 1,
  });
  expect(page.unitOf("signals/payload.mass", description)).toBe("kg");
  page.learnUnit("joints/payload.mass", "g");
  page.learnUnit("signals/payload.mass", "");
  expect(page.unitOf("signals/payload.mass", description)).toBe("kg");
});

test("many robots' signals do not fill this page's memory, and known ones keep their newest unit", () => {
  for (let i = 0; i < 5100; i++) page.learnUnit(`signals/a${i}`, "V");
  page.learnUnit("signals/a1", "mV");
  expect(["a1", "a4000", "a5099"].map((name) => page.unitOf(`signals/${name}`, undefined))).toEqual(["mV", "V", ""]);
});

test.each([
  ["joints/waist/position", "rad"],
  ["joints/waist/velocity", "rad/s"],
  ["joints/waist/acceleration", "rad/s²"],
  ["joints/waist/effort", "N·m"],
  ["joints/rail/left/position", "m"],
  ["joints/rail/left/velocity", "m/s"],
  ["joints/rail/left/effort", "N"],
  ["joints/waist/other", ""],
  ["kinematics/tool/x", "m"],
  ["kinematics/tool/yaw", "rad"],
  ["kinematics/tool/speed", "m/s"],
  ["kinematics/margin/waist", "rad"],
  ["kinematics/margin/rail/left", "m"],
  ["kinematics/own_clearance", "m"],
  ["kinematics/manipulability", ""],
  ["controller/rate_hz", "Hz"],
  ["controller/health/jitter_s", "s"],
  ["controller/counters/units_sent", ""],
  ["mesh", ""],
])("the unit of %s is %j", (name, unit) => {
  expect(page.unitOf(name, description)).toBe(unit);
});

test("a joint that is not described yet turns", () => {
  expect(page.unitOf("joints/rail/left/position", undefined)).toBe("rad");
});

test("a value belongs to the most specific topic", () => {
  expect(page.topicOf("joints/slow/waist/position", ["joints", "joints/slow"])).toBe("joints/slow");
  expect(page.topicOf("joints/waist/position", ["joints", "joints/slow"])).toBe("joints");
  expect(page.topicOf("jointsx/waist", ["joints"])).toBeNull();
});

test("a topic without numbers has no reader, and before the console greets the page none has", () => {
  expect(page.topicsOfValues()).toEqual(expect.arrayContaining(["joints", "controller", "signals"]));
  expect(page.readerOf("video/front")).toBeNull();
  hello.value = null;
  expect([page.topicsOfValues(), page.readerOf("joints")]).toEqual([[], null]);
});
