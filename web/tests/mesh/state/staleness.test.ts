// Ages, and from when the page must not show a message as live.

import { create } from "@bufbuild/protobuf";
import { beforeEach, expect, test } from "vitest";
import {
  ControllerStateSchema,
  DescriptionSchema,
  MeshStateSchema,
  ToPage_HelloSchema,
} from "../../../src/gen/robomesh_pb";
import { hello } from "../../../src/mesh/console/connection";
import * as health from "../../../src/mesh/state/site-health";
import * as page from "../../../src/mesh/state/staleness";
import { now } from "../../../src/mesh/state/topics";
import { latest } from "../../latest";

const at = 1e6;
const aged = <M>(message: M, ageS: number | null, arrived = 0) => {
  const made = latest(message, 0, arrived);
  return { ...made, sample: { ...made.sample, newAt: ageS === null ? null : at - 1000 * ageS } };
};
const controller = (ageS: number | null, lastUnitAgeS?: number, arrived = 1) =>
  aged(create(ControllerStateSchema, { ...(lastUnitAgeS !== undefined && { lastUnitAgeS }) }), ageS, arrived);

beforeEach(() => {
  now.value = at;
  const stale = { joints: 1, video: 2, "video/*": 3, "health/*": 5, mesh: 4 };
  const rows = Object.entries(stale).map(([topic, afterS]) => ({ topic, afterS }));
  hello.value = create(ToPage_HelloSchema, { stale: rows });
});

test.each([
  ["joints", 1],
  ["video/front", 3],
  ["description", Number.POSITIVE_INFINITY],
])("%s is stale after %s s, by the console's table", (topic, afterS) => {
  expect(page.staleAfter(topic)).toBe(afterS);
  expect(page.isStale(topic, afterS)).toBe(false);
  expect(page.isStale(topic, afterS + 0.01)).toBe(afterS < 9);
  expect(page.isStale(topic, null)).toBe(true);
});

test("a robot's own stale time counts for topics with its joints only", () => {
  const description = create(DescriptionSchema, { staleAfterS: 8 });
  const own = ["joints", "frames", "kinematics", "joints/slow", "video/front"];
  expect(own.map((topic) => page.staleAfter(topic, description))).toEqual([8, 8, 8, 8, 3]);
  expect(page.staleAfter("joints", create(DescriptionSchema))).toBe(1);
  hello.value = null;
  expect(page.staleAfter("joints")).toBe(Number.POSITIVE_INFINITY);
});

test.each([
  [1.5, aged({}, 1.5)],
  [0, aged({}, -1)],
  [null, aged({}, null)],
  [null, undefined],
])("an age is %s s, never negative, or not known", (age, of) => {
  expect(page.ageOf(of)).toBe(age);
});

test.each([
  ["their own without a report", 1, undefined, 1],
  ["their own if the gateway reported no unit", 1, controller(0), 1],
  ["their own if the report's age is not known", 1, controller(null, 9), 1],
  ["the last unit's, if the gateway repeats an old one", 1, controller(1, 5), 6],
  ["their own, if it is larger", 8, controller(1, 5), 8],
  ["their own, if the report is from before them", 1, controller(1, 5, -1), 1],
  ["the last unit's, if their own is not known", null, controller(1, 5, -1), 6],
  ["not known, if nothing is", null, controller(null, 5), null],
] as const)("joints are as old as %s", (_, ageS, report, expected) => {
  expect(page.jointsAge(aged({}, ageS), report)).toBe(expected);
});

test("the age of joints that never came is not known", () => {
  expect(page.jointsAge(undefined, controller(0, 0))).toBeNull();
});

const seen = (values: object) => ({ ageS: 0, ...create(MeshStateSchema, { services: [values] }).services[0] }) as never;

test("a process is silent by its report's age and the watch's together", () => {
  const mesh = aged(create(MeshStateSchema), 2);
  expect(health.reportAge(seen({ ageS: 1 }), mesh)).toBe(3);
  expect([3, 3.1].map((ageS) => health.isSilent(seen({ ageS }), mesh))).toEqual([false, true]);
  expect([undefined, aged(create(MeshStateSchema), null), mesh].map(health.isMeshStale)).toEqual([true, true, false]);
});

test.each([
  [{}, false],
  [{ clockOffsetS: -0.6 }, true],
  [{ clockOffsetS: 0.6, roundTripS: 0.3 }, false],
  [{ clockOffsetS: 0.4 }, false],
])("a clock %o is off: %s, by more than its measurement can be wrong", (values, off) => {
  expect(health.isClockOff(seen(values))).toBe(off);
});
