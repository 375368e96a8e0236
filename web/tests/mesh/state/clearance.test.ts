// Distances to fixtures, robots and the own links, as the page says and colours them.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { ClearanceSchema, DescriptionSchema } from "../../../src/gen/robomesh_pb";
import * as page from "../../../src/mesh/state/clearance";
import { connect, newPage, publish } from "../../console";
import { use } from "../../shown";

const ARM = "robomesh/hall/arm";
const near = (second: string, distance = 0.01, first = "hall/arm/flange") =>
  create(ClearanceSchema, { first, second, distance });

test.each([
  ["hall/table", "flange – table"],
  ["hall/other/wrist", "flange – other wrist"],
  ["hall/arm/forearm", "flange – forearm"],
  ["hall/the floor", "flange – the floor"],
  ["far/arm/wrist", "flange – far arm wrist"],
])("the parts of a pair with %s are named without what the page says already", (second, text) => {
  expect(page.pairText(near(second), ARM)).toBe(text);
});

test.each([
  [0.01234, "12.3\u202fmm", "normal"],
  [0, "they touch", "alarm"],
  [-0.001, "they touch", "alarm"],
])("own links at %f m: %s", (distance, text, level) => {
  expect(page.distanceText(near("", distance))).toBe(text);
  expect(page.ownLevel(near("", distance))).toBe(level);
});

test.each([
  [{ floor: { height: -0.5 } }, -0.5],
  [{ floor: {} }, null],
  [{ baseToSite: Array.from({ length: 16 }, (_, i) => i / 10) }, 1.1],
  [{}, 0],
])("the floor of %o is at %s m", (values: MessageInitShape<typeof DescriptionSchema>, height) => {
  expect(page.floorOf(create(DescriptionSchema, values))).toBe(height);
});

test.each([
  ["hall/table", 0.04, "warning"],
  ["hall/table", 0.06, "normal"],
  ["hall/table", 0.01, "alarm"],
  ["hall/other/wrist", 0.06, "warning"],
  ["hall/other/wrist", 0.03, "alarm"],
  ["hall/other/wrist", 0.09, "normal"],
  ["hall/the floor", 0.01, "normal"],
  ["hall/the floor", 0.003, "alarm"],
  ["hall/table", 0, "alarm"],
])("to %s, %f m are %s: of two robots' limits, the larger counts", async (second, distance, level) => {
  newPage();
  const { useClearanceLevel } = await import("../../../src/mesh/state/clearance");
  await connect();
  const used = use(useClearanceLevel, ARM, near(second, distance));
  expect(used.result).toBe(distance ? "normal" : "alarm");
  const own = { stopDistance: 0.02, warningDistance: 0.05, floor: { height: 0, stopDistance: 0.005 } };
  publish(`${ARM}/description`, DescriptionSchema, own);
  publish("robomesh/hall/other/description", DescriptionSchema, { stopDistance: 0.04, warningDistance: 0.08 });
  await vi.advanceTimersByTimeAsync(100);
  expect(used.result).toBe(level);
  used.draw(ARM, undefined as never);
  expect(used.result).toBe("normal");
});
