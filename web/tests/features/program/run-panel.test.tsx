// Running a program, and teaching its points.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  type CheckAnswer_ViolationSchema,
  CheckAnswerSchema,
  CommandAnswerSchema,
  CommandRequestSchema,
  ControllerStateSchema,
  DescriptionSchema,
  InverseAnswerSchema,
  InverseRequestSchema,
  LeaseAnswerSchema,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
  ProgramState_Outcome as Outcome,
  ProgramStateSchema,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, refuse, requests } from "../../console";
import { button, find, key, pass, press, texts, type } from "../../hands";
import { ARM } from "../../recorded";
import { show } from "../../shown";

const at = timestampFromMs;
const READY = create(ControllerStateSchema, { link: Link.UP, mode: Mode.REMOTE });
let d: typeof import("../../../src/features/program/draft/draft");
let run: typeof import("../../../src/features/program/run-panel");
let check: typeof import("../../../src/features/program/motion/program-check");
let running: typeof import("../../../src/features/program/motion/running-program");
let robot: typeof import("../../../src/features/program/motion/program-robot");
let taught: typeof import("../../../src/features/program/motion/taught-pose");
let field: HTMLTextAreaElement;

beforeEach(async () => {
  newPage();
  const program = "../../../src/features/program";
  [d, run, check, running, robot, taught] = await Promise.all([
    import(`${program}/draft/draft`),
    import(`${program}/run-panel`),
    import(`${program}/motion/program-check`),
    import(`${program}/motion/running-program`),
    import(`${program}/motion/program-robot`),
    import(`${program}/motion/taught-pose`),
  ]);
  const freshness = await import("../../../src/mesh/control/display-freshness");
  vi.spyOn(freshness, "whyFrozen").mockReturnValue("");
  await connect();
  field = document.body.appendChild(document.createElement("textarea"));
  d.openDraft(ARM);
  d.setField(field);
  d.startDraft("home\n");
  return () => field.remove();
});

async function hold(): Promise<void> {
  const control = await import("../../../src/mesh/control/control");
  control.setOperator("li");
  const taken = control.take(ARM);
  answer(await next(), LeaseAnswerSchema, { lease: "l", since: at(0), now: at(0), until: at(600_000) });
  await taken;
}
async function draw(controller = READY): Promise<void> {
  show(<run.RunPanel robotKey={ARM} controller={controller} />);
  await pass();
}
const shown = () => [find<HTMLButtonElement>("[data-moves]").disabled, find(".notice").textContent.trim()];
async function violation(each: MessageInitShape<typeof CheckAnswer_ViolationSchema>, text = "home\n"): Promise<void> {
  check.checked.value = { text, answer: create(CheckAnswerSchema, { violations: [each] }), at: 0 };
}

test("a program is run by the operator in control only", async () => {
  await draw();
  expect(shown()).toEqual([true, expect.stringMatching(/control/i)]);
  await hold();
  await pass();
  expect(shown()).toEqual([false, expect.not.stringMatching(/control/i)]);
});

test.each<[string, () => unknown, boolean, RegExp]>([
  ["nothing runs without a text", () => d.startDraft(" \n"), true, /./],
  [
    "nothing runs with an error in the text",
    () => violation({ kind: "program", line: 1, text: "what?" }),
    true,
    /line 1.*what\?/i,
  ],
  ["an error of an older text stops no run", () => violation({ kind: "program", text: "what?" }, "old"), false, /./],
  [
    "whether a collision stops a run is the gateway's decision",
    () => violation({ kind: "collision", refuses: true }),
    false,
    /./,
  ],
  [
    "nothing runs beside another program",
    () => (running.program.value = create(ProgramStateSchema, { outcome: Outcome.RUNNING })),
    true,
    /./,
  ],
])("%s", async (_, change, disabled, text) => {
  await hold();
  change();
  await draw();
  expect(shown()).toEqual([disabled, expect.stringMatching(text)]);
});

test("nothing runs while the controller is not in remote mode", async () => {
  await hold();
  await draw(create(ControllerStateSchema, { link: Link.UP, mode: Mode.LOCAL }));
  expect(shown()[0]).toBe(true);
});

test("the text is sent as it is shown; a refusal is told until the text is another", async () => {
  await hold();
  d.rename("  weld ");
  await draw();
  await press("Run “weld”");
  expect(find<HTMLButtonElement>("[data-moves]").disabled).toBe(true);
  let request = await next();
  while (!request.key.includes("/command/")) request = await next();
  const { program, programName, lease } = read(request, CommandRequestSchema);
  expect([program, programName, lease]).toEqual(["home\n", "weld", "l"]);
  answer(request, CommandAnswerSchema, { accepted: false, text: "it would hit the table" });
  await pass();
  expect(shown()).toEqual([false, expect.stringContaining("it would hit the table")]);
  d.replace("home\nend");
  await pass();
  expect(shown()[1]).not.toContain("table");
});

test.each([
  [Outcome.RUNNING, "motion", "2", /00:05/],
  [Outcome.DONE, "normal", "4", /^(?!.*00:05)/],
  [Outcome.ENDED, "alarm", "2", /^(?!.*00:05)/],
])("all see how far a program is: outcome %i", async (outcome, level, value, left) => {
  running.program.value = create(ProgramStateSchema, {
    ...{ outcome, name: "weld", operator: "wang", line: 3, statement: "wait 1" },
    ...{ step: 3, steps: 4, leftS: 4.2, durationS: 20 },
  });
  await draw();
  expect(find(".progress .state").className).toContain(level);
  expect(find("progress").getAttribute("value")).toBe(value);
  expect(find(".progress-head").textContent).toMatch(/weld.*wang/);
  expect(find(".progress-line").textContent).toMatch(left);
});

const ROBOT = create(DescriptionSchema, {
  joints: [
    { name: "waist", lower: -2, upper: 2 },
    { name: "elbow", lower: -2, upper: 2 },
  ],
});
async function teach(text: string): Promise<void> {
  const { TeachPanel } = await import("../../../src/features/program/teach/teach-panel");
  robot.robotKey.value = ARM;
  robot.description.value = ROBOT;
  d.startDraft(text);
  show(<TeachPanel />);
  await pass();
}
const POINTS = "point p1 = joints 10 20\npoint far = pose 100 200 300 0 0 90\nhome\nmove_joints p1";
const text = () => d.draft.value?.text;
const notice = () => texts("p.notice").at(-1);

test("the robot's position becomes a point and a motion to it, once it is known", async () => {
  await teach("home");
  expect(button("Add where the robot is").disabled).toBe(true);
  robot.livePositions.value = [Math.PI / 2, -0.5];
  await pass();
  await press("Add where the robot is");
  expect(text()).toBe("point p1 = joints 90 -28.648\nhome\nmove_joints p1");
  d.undo();
  expect(text()).toBe("home");
});

test.each([
  ["a free name", "near", "near", /^\u00a0?$/],
  ["a taken name", "far", "p1", /far/],
  ["no name", "Über all", "p1", /Über all/],
])("a point is renamed to %s", async (_, to, name, told) => {
  await teach(POINTS);
  await press("Rename p1");
  type("input.point-name", to);
  key("input.point-name", "Enter");
  await pass();
  expect([text()?.split("\n")[0], text()?.split("\n")[3]]).toEqual([
    `point ${name} = joints 10 20`,
    `move_joints ${name}`,
  ]);
  expect(notice()).toMatch(told);
});

test("a renaming that is left with Escape changes nothing", async () => {
  await teach(POINTS);
  await press("Rename p1");
  type("input.point-name", "near");
  key("input.point-name", "Escape");
  await pass();
  expect(text()).toBe(POINTS);
});

test("a deleted point that is used names the lines that used it, as they are now", async () => {
  await teach(POINTS);
  await press("Delete p1");
  expect(text()).toBe(POINTS.split("\n").slice(1).join("\n"));
  expect(notice()).toMatch(/p1.*\b3\b/);
});

test("a point of joints is shown with the ghost; one of another robot is not", async () => {
  await teach(`${POINTS}\npoint bad = joints 1`);
  await press("Show p1 with the ghost");
  expect(taught.taughtPositions.value?.map((each) => Math.round((each * 180) / Math.PI))).toEqual([10, 20]);
  await press("Show bad with the ghost");
  expect(notice()).toMatch(/bad.*2/);
});

test("a pose is solved near the ghost, one request at a time and the newest next", async () => {
  await teach("");
  taught.teachPositions([0, 0]);
  taught.teachPose(taught.poseOf([100, 0, 0, 0, 0, 0]));
  const first = await next();
  taught.teachPose(taught.poseOf([200, 0, 0, 0, 0, 0]));
  taught.teachPose(taught.poseOf([300, 0, 0, 0, 0, 0]));
  expect(requests).toEqual([]);
  answer(first, InverseAnswerSchema, { solutions: [{ jointPositions: [1, 1] }] });
  const second = await next();
  expect([read(second, InverseRequestSchema).pose[3], read(second, InverseRequestSchema).near]).toEqual([0.3, [1, 1]]);
  answer(second, InverseAnswerSchema, { reason: "out of reach" });
  await pass();
  expect([taught.taughtPositions.value, taught.taughtProblem.value, requests]).toEqual([[1, 1], "out of reach", []]);
  taught.teachPositions([0, 0]);
  expect(taught.taughtProblem.value).toBe("");
});

test("an answer to a pose that is no longer wanted changes nothing", async () => {
  await teach("");
  taught.teachPositions([0, 0]);
  taught.teachPose(taught.poseOf([100, 0, 0, 0, 0, 0]));
  const request = await next();
  taught.teachPositions([2, 2]);
  refuse(request, "late");
  await pass();
  expect([taught.taughtPositions.value, taught.taughtProblem.value]).toEqual([[2, 2], ""]);
});

test.each([[[100, -200, 300, 10, 20, 30]], [[0, 0, 0, -170, 80, 179]], [[1, 2, 3, 40, 90, 0]]])(
  "a pose in numbers %j is the same after it was a placement",
  (numbers) => {
    const pose = taught.poseOf(numbers);
    expect(taught.poseNumbers(pose)).toEqual(numbers.map((each) => expect.closeTo(each, 6)));
  },
);

test("a placement turns about fixed x, then y, then z", () => {
  const turned = taught.poseOf([0, 0, 0, 90, 0, 90]);
  expect(turned.map((each) => Math.round(each) + 0)).toEqual([0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1]);
});
