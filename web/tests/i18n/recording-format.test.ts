// Facts of a recording, and signals, in words.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { afterEach, expect, test } from "vitest";
import { DescriptionSchema, RecordingSchema, SignalsSchema } from "../../src/gen/robomesh_pb";
import * as page from "../../src/i18n/recording-format";
import * as signals from "../../src/i18n/signals";
import { showFirstLanguage } from "../../src/i18n/texts";

const recording = (values: MessageInitShape<typeof RecordingSchema> = {}) => create(RecordingSchema, values);
const topic = (name: string, messages = 1, lost = 0) => ({
  topic: `robomesh/hall/arm/${name}`,
  messages: BigInt(messages),
  lost: BigInt(lost),
});

afterEach(() => showFirstLanguage("en"));

test.each([
  [912, "912\u202fB"],
  [4321, "4.3\u202fkB"],
  [123_456, "123\u202fkB"],
  [4_300_000n, "4.3\u202fMB"],
  [2e15, "2000\u202fTB"],
])("%s bytes are %s", (bytes, text) => {
  expect(page.sizeText(bytes)).toBe(text);
});

test.each([
  [3.254, 2, "00:03.25"],
  [3723, 2, "1:02:03.00"],
  [59.999, 2, "01:00.00"],
  [59.4, 0, "00:59"],
  [-1, 2, "00:00.00"],
])("the moment at %f s, with %i decimals, is %s", (seconds, decimals, text) => {
  expect(page.momentText(seconds, decimals)).toBe(text);
});

test("losses are named by topic, and none if there are none", () => {
  expect(
    page.lostText(recording({ topics: [topic("joints", 5, 1200), topic("lease"), topic("events/renderer", 1, 1)] })),
  ).toBe("lost: 1,200 of joints, 1 of events/renderer");
  expect(page.lostText(recording({ topics: [topic("joints")] }))).toBe("");
});

test.each([
  [recording({ open: true }), false],
  [recording(), true],
  [recording({ topics: [topic("joints", 0)] }), true],
  [recording({ topics: [topic("joints", 0), topic("lease", 2)] }), false],
])("a recording of %o is empty: %s", (of, empty) => {
  expect(page.isEmpty(of)).toBe(empty);
});

test.each([
  ["trace", "by the controller's trace"],
  ["flight", "by the flight recorder"],
  ["flight recorder", "by the flight recorder"],
  ["request", "on request"],
  ["li", "li"],
])("%s started it: %s", (startedBy, text) => {
  expect(page.startedText(recording({ startedBy }))).toBe(text);
});

test("a merged file has the robots of its parts, each once", () => {
  expect(page.robotsOf(recording({ robot: "arm", mergedFrom: [{ robot: "b" }] }))).toEqual(["arm"]);
  expect(page.robotsOf(recording({ mergedFrom: [{ robot: "b" }, { robot: "a" }, { robot: "b" }] }))).toEqual([
    "b",
    "a",
  ]);
});

test("a recording's views, times and address", () => {
  const of = recording({
    topics: [topic("video/front"), topic("joints")],
    duration: { seconds: 3n, nanos: 5e8 },
    start: { seconds: 7n },
  });
  expect([page.recordedViews(of), page.durationS(of), page.startMs(of)]).toEqual([["front"], 3.5, 7000]);
  expect(page.durationS(recording())).toBe(0);
  expect(["front", page.recordedView("front"), "mine"].map(page.viewName)).toEqual([
    "Front",
    "Front, recorded",
    "mine",
  ]);
  expect([page.topicOf("robomesh/hall/arm/joints"), page.topicOf("other/a/b/c")]).toEqual(["joints", "other/a/b/c"]);
  expect(page.fileUrl("hall", "a b/1.mcap", "?part=1")).toBe("/recordings/hall/a%20b%2F1.mcap?part=1");
});

const ARM = create(DescriptionSchema, { joints: [{ name: "rail.left", title: "Left rail" }] });
test.each([
  ["payload.mass", "mass", "Payload mass"],
  ["io.digital_in.3", "digital input 3", "digital input 3"],
  ["joint.rail.left.current", "Left rail current", "Left rail current"],
  ["joint.elbow.current", "elbow current", "elbow current"],
  ["joint.count", "count", "count"],
  ["own.some_thing", "some thing", "own some thing"],
  ["lonely", "lonely", "lonely"],
])("the signal %s is %s, and where others would be alike %s", (name, text, full) => {
  expect([signals.signalText(name, ARM), signals.fullSignalText(name, ARM)]).toEqual([text, full]);
});

test("groups are shown in the order in which people look for them, unknown ones last", () => {
  const groups = ["own", "io", "safety", "joint"].sort((a, b) => signals.groupRank(a) - signals.groupRank(b));
  expect(groups.map(signals.groupTitle)).toEqual(["Safety", "Joints", "Inputs and outputs", "own"]);
  expect(signals.groupOf("io.digital_in.3")).toBe("io");
});

test.each([
  [{ case: "on", value: true }, "", "on", ""],
  [{ case: "on", value: false }, "", "off", ""],
  [{ case: "text", value: "protective_stop" }, "", "protective stop", ""],
  [{ case: "text", value: "Weld 3" }, "", "Weld 3", ""],
  [{ case: "number", value: 1.25 }, "kg", "1.250", "kg"],
  [{ case: "number", value: Math.PI }, "rad", "180.00", "°"],
  [{ case: "number", value: 3 }, "", "3", ""],
  [{ case: "number", value: 3 }, "kg", "3.000", "kg"],
  [{ case: "number", value: -0.5 }, "", "−0.500", ""],
  [{ case: undefined }, "V", "–", ""],
] as const)("the value %o in %j is %s %s", async (value, unit, text, shown) => {
  const [signal] = create(SignalsSchema, { signals: [{ name: "a", unit, value }] }).signals;
  expect(signal && signals.signalValue(signal)).toEqual({ text, unit: shown });
  await showFirstLanguage("zh");
  if (value.case === "text" && text === "protective stop")
    expect(signal && signals.signalValue(signal).text).toBe("保护性停止");
});
