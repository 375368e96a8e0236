// The check of a target while it is chosen.

import { beforeEach, expect, test, vi } from "vitest";
import { CheckAnswerSchema, CheckRequestSchema, Description_Joint_Type as Type } from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, refuse, requests } from "../../console";

let page: typeof import("../../../src/mesh/control/target-check");
const ROBOT = "robomesh/hall/arm";
const JOINTS = [{ type: Type.ROTARY }, { type: Type.PRISMATIC }] as never;
const choose = (...positions: number[]) => page.checkTarget(ROBOT, JOINTS, positions);
const asked = async () => {
  const request = await next();
  return { request, program: read(request, CheckRequestSchema).program };
};
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const NEAR = { text: "near the table", pair: ["arm/flange", "table"] };
const HIT = { text: "hits the post", pair: ["arm/flange", "post"], refuses: true };

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/control/target-check");
  await connect();
});

test("a target is checked as a motion in degrees and millimetres, and what refuses it is said first", async () => {
  choose(Math.PI / 2, 0.25);
  const { request, program } = await asked();
  expect([request.key, program]).toEqual([`${ROBOT}/kinematics/check/page1`, "move_joints 90.000000 250.000000"]);
  answer(request, CheckAnswerSchema, { violations: [NEAR, HIT] });
  await after(0);
  expect(page.targetProblem.value).toBe("hits the post");
  expect([...page.targetParts.value]).toEqual(["arm/flange", "table", "post"]);
  page.checkTarget(ROBOT, JOINTS, null);
  expect([page.targetProblem.value, page.targetParts.value.size]).toEqual(["", 0]);
});

test("while one target is checked only the newest waits, and is checked after a rest", async () => {
  choose(0, 0.001);
  const { request } = await asked();
  for (const mm of [2, 3, 4]) choose(0, mm / 1000);
  await after(500);
  expect(requests).toEqual([]);
  answer(request, CheckAnswerSchema, { violations: [NEAR] });
  await after(90);
  expect(requests).toEqual([]);
  expect(page.targetProblem.value).toBe("near the table");
  await after(20);
  const second = await asked();
  expect(second.program).toContain("4.000000");
  answer(second.request, CheckAnswerSchema, {});
  await after(5000);
  expect([requests, page.targetProblem.value]).toEqual([[], ""]);
});

test("a target without a position of a joint is checked at 0", async () => {
  choose(0.5);
  expect((await asked()).program).toMatch(/ 0\.000000$/);
});

test("without an answer nothing is known of a target, and it is checked again a second later", async () => {
  choose(0, 0.001);
  answer((await asked()).request, CheckAnswerSchema, { violations: [HIT] });
  choose(0, 0.002);
  refuse((await asked()).request);
  await after(0);
  expect(page.targetProblem.value).toBe("");
  await after(980);
  expect(requests).toEqual([]);
  await after(30);
  expect((await asked()).program).toContain("2.000000");
});

test("what is found of a target that is no longer chosen is not said", async () => {
  choose(0, 0.001);
  const { request } = await asked();
  page.checkTarget(ROBOT, JOINTS, null);
  answer(request, CheckAnswerSchema, { violations: [HIT] });
  await after(2000);
  expect([page.targetProblem.value, requests]).toEqual(["", []]);
});
