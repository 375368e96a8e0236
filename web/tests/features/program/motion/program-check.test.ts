// The check of a program's text, its motion at a moment, and the violations that it found.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { beforeEach, expect, test, vi } from "vitest";
import {
  CheckAnswer_PathSchema,
  CheckAnswer_ViolationSchema,
  CheckAnswerSchema,
  CheckRequestSchema,
  ProgramState_Outcome as Outcome,
  ProgramStateSchema,
} from "../../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, refuse, requests } from "../../../console";
import { ARM } from "../../../recorded";

type Violation = MessageInitShape<typeof CheckAnswer_ViolationSchema>;
let c: typeof import("../../../../src/features/program/motion/program-check");
let d: typeof import("../../../../src/features/program/draft/draft");
let m: typeof import("../../../../src/features/program/motion/checked-motion");
let overlay: typeof import("../../../../src/features/program/motion/scene-overlay");
let scene: typeof import("../../../../src/scene/overlays");
let end: () => void;

beforeEach(async () => {
  newPage();
  c = await import("../../../../src/features/program/motion/program-check");
  d = await import("../../../../src/features/program/draft/draft");
  m = await import("../../../../src/features/program/motion/checked-motion");
  overlay = await import("../../../../src/features/program/motion/scene-overlay");
  scene = await import("../../../../src/scene/overlays");
  await connect();
  d.openDraft(ARM);
  end = c.startChecking();
  return () => end();
});

const pass = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const PATH = {
  timesS: [0, 1, 3],
  jointPositions: [0, 10, 1, 20, 3, 20],
  lines: [1, 1, 2],
  clearances: [1, 0.5, Infinity],
};
async function check(
  text: string,
  violations: Violation[] = [],
  path: MessageInitShape<typeof CheckAnswer_PathSchema> = PATH,
) {
  d.startDraft(text);
  const request = await next();
  answer(request, CheckAnswerSchema, { violations, path });
  await pass(0);
  return read(request, CheckRequestSchema);
}

test("the text is checked once typing pauses, as it is then", async () => {
  d.startDraft("home");
  await pass(700);
  d.startDraft("home\n");
  await pass(700);
  expect(requests).toEqual([]);
  const request = await check("home\nend");
  expect([request.program, request.path]).toEqual(["home\nend", true]);
  expect([c.checked.value?.text, c.isCurrent(), c.checking.value]).toEqual(["home\nend", true, false]);
  d.startDraft("home");
  expect(c.isCurrent()).toBe(false);
});

test("while a check is on its way none is sent, then that of the newest text; the old answer is not shown", async () => {
  d.startDraft("one");
  const first = await next();
  for (const text of ["two", "three"]) {
    d.startDraft(text);
    await pass(900);
  }
  expect(requests).toEqual([]);
  answer(first, CheckAnswerSchema, {});
  await pass(0);
  expect([c.checked.value, c.checking.value]).toEqual([null, true]);
  expect(read(await next(), CheckRequestSchema).program).toBe("three");
});

test("a check that failed says why, and removes the one before", async () => {
  await check("one");
  d.startDraft("two");
  refuse(await next(), "kinematics stopped");
  await pass(0);
  expect([c.checked.value, c.checkError.value]).toEqual([null, "kinematics stopped"]);
  await check("three");
  expect(c.checkError.value).toBe("");
});

test("an empty text has no check, and a page that was left asks for none", async () => {
  await check("one");
  d.startDraft("  ");
  await pass(900);
  expect([c.checked.value, requests]).toEqual([null, []]);
  d.startDraft("two");
  end();
  await pass(900);
  expect(requests).toEqual([]);
});

test.each([
  [-1, [0, 10]],
  [0.5, [0.5, 15]],
  [1, [1, 20]],
  [2, [2, 20]],
  [9, [3, 20]],
])("at %s s the checked motion is at %j", (time, positions) => {
  expect(m.positionsAt(create(CheckAnswer_PathSchema, PATH), time)).toEqual(positions);
});

test("a moment shows the ghost, its line and its clearance, and stays within the motion", async () => {
  const stop = overlay.startOverlay();
  await check("home\nend");
  const shown = [0.5, 2, 99, -1].map((time) => {
    overlay.showMoment(time);
    return [m.moment.value, m.lineAtMoment.value, m.clearanceAtMoment.value, scene.ghost.value?.positions];
  });
  expect(shown).toEqual([
    [0.5, 1, 0.5, [0.5, 15]],
    [2, 2, null, [2, 20]],
    [3, 2, null, [3, 20]],
    [0, 1, 1, [0, 10]],
  ]);
  stop();
  expect([m.moment.value, scene.ghost.value, scene.toolPath.value]).toEqual([null, null, null]);
});

test("a shorter motion moves the moment to its end; without one no moment is shown", async () => {
  const stop = overlay.startOverlay();
  await check("home\nend");
  overlay.showMoment(2.5);
  await check("home", [], { timesS: [0, 2], jointPositions: [0, 1], toolPositions: [1, 2, 3, 4, 5, 6] });
  expect([m.moment.value, scene.toolPath.value]).toEqual([
    2,
    [
      [1, 2, 3],
      [4, 5, 6],
    ],
  ]);
  await check("x", [], {});
  expect([m.moment.value, m.duration.value, scene.ghost.value]).toEqual([null, 0, null]);
  stop();
});

test("a pose that is taught hides the moment, and the moment hides it", async () => {
  const stop = overlay.startOverlay();
  await check("home\nend");
  overlay.showMoment(1);
  overlay.teach([7, 8]);
  expect([m.moment.value, scene.ghost.value?.positions]).toEqual([null, [7, 8]]);
  overlay.showMoment(1);
  expect(scene.ghost.value?.positions).toEqual([1, 20]);
  stop();
});

test("links are red while their violation lasts", async () => {
  await check("home\nend", [
    { pair: ["arm/hand", "table"], timeS: 1, untilS: 2 },
    { pair: ["arm/elbow"], timeS: 2, untilS: 0 },
  ]);
  const red = [null, 0.9, 1, 2, 2.1].map((time) => {
    m.moment.value = time;
    return [...m.violatingLinks.value];
  });
  expect(red).toEqual([[], [], ["arm/hand", "table"], ["arm/hand", "table", "arm/elbow"], []]);
});

test.each([
  [0, "0.0\u202fs"],
  [99.94, "99.9\u202fs"],
  [100, "1:40.0\u202fmin"],
  [185.04, "3:05.0\u202fmin"],
])("%s s is shown as %s", async (value, text) => {
  const { seconds } = await import("../../../../src/features/program/motion/number-format");
  expect(seconds(value)).toBe(text);
});

const TEXT = "move_joints a\nwait 1\n# note\nmove_line b\nmove_line c\nhome";
test.each<[string, Violation[], string[]]>([
  ["of one cause on neighbouring lines share a row", [{ line: 1 }, { line: 4 }], ["1-4"]],
  ["with a motion between them do not", [{ line: 1 }, { line: 5 }], ["1-1", "5-5"]],
  [
    "of other links do not",
    [
      { line: 1, pair: ["a"] },
      { line: 1, pair: ["b"] },
    ],
    ["1-1", "1-1"],
  ],
  ["that refuse are not hidden among warnings", [{ line: 1 }, { line: 1, refuses: true }], ["1-1", "1-1"]],
  [
    "of the text share a row if they are equal",
    [
      { line: 2, kind: "program", text: "x" },
      { line: 3, kind: "program", text: "y" },
      { line: 3, kind: "program", text: "x" },
    ],
    ["2-3", "3-3"],
  ],
])("violations %s", async (_, violations, rows) => {
  const { groupViolations } = await import("../../../../src/features/program/motion/violations");
  const all = violations.map((each) => create(CheckAnswer_ViolationSchema, each));
  expect(groupViolations(all, TEXT).map(({ first, last }) => `${first}-${last}`)).toEqual(rows);
});

test("a row of violations is about the nearest one, for the whole time", async () => {
  const { groupViolations } = await import("../../../../src/features/program/motion/violations");
  const all = [
    { line: 4, distance: 0.02, timeS: 1, untilS: 2 },
    { line: 4, distance: -0.01, timeS: 3, untilS: 5 },
    { line: 4, distance: 0.01, timeS: 4, untilS: 4 },
  ].map((each) => create(CheckAnswer_ViolationSchema, each));
  expect(groupViolations(all, TEXT)).toEqual([{ worst: all[1], first: 4, last: 4, fromS: 1, untilS: 5 }]);
});

test.each([
  [{ outcome: Outcome.RUNNING, line: 2, statement: "wait 1" }, 2],
  [{ outcome: Outcome.RUNNING, line: 2, statement: "wait 2" }, null],
  [{ outcome: Outcome.RUNNING, line: 3, statement: "" }, null],
  [{ outcome: Outcome.DONE, line: 2, statement: "wait 1" }, null],
])("a line is marked as running only if the text still has it: %j", async (state, line) => {
  const running = await import("../../../../src/features/program/motion/running-program");
  running.program.value = create(ProgramStateSchema, state);
  expect(running.runningLine(["home", "  wait 1 # s", ""])).toBe(line);
});
