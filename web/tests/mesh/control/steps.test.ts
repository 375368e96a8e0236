// Steps by the ± buttons: one for each press that is taken, and at most one waits.

import { beforeEach, expect, test, vi } from "vitest";
import { CommandAnswerSchema, CommandRequestSchema, Description_Joint_Type } from "../../../src/gen/robomesh_pb";
import type { Notice } from "../../../src/mesh/control/control";
import { answer, newPage, read, refuse, requests } from "../../console";
import { use } from "../../shown";
import { nextTo, ROBOT, takeControl } from "./operator";

let page: typeof import("../../../src/mesh/control/joint-steps");
let told: Notice[];
const DEGREE = Math.PI / 180;
const JOINTS = ["waist", "elbow"].map((name) => ({ name, type: Description_Joint_Type.ROTARY })) as never;
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const commands = () => requests.filter(({ key }) => key.includes("/command/"));
const last = () => told.at(-1)?.text;
const buttons = Array.from({ length: 2 }, () => document.createElement("button"));

/** Steps of the joints while the waist is somewhere [degrees]. */
function steps() {
  const props = (degrees: number, more = {}) => ({
    robotKey: ROBOT,
    joints: JOINTS,
    current: [degrees * DEGREE, 0] as (number | undefined)[],
    enabled: true,
    resting: true,
    tell: (notice: Notice) => told.push(notice),
    ...more,
  });
  const used = use(page.useJointSteps, props(0));
  return {
    press: async (degrees = 5, button = buttons[0] as Element, index = 0) => {
      used.result.press({ index, offset: degrees * DEGREE }, button);
      await after(0);
    },
    /** The waist is there now. */
    at: async (degrees: number, more = {}) => {
      used.draw(props(degrees, more));
      await after(0);
    },
    end: () => page.stepEnd(JOINTS, props(0).current, used.result),
    get now() {
      return used.result;
    },
  };
}
async function accept(values = {}): Promise<number[]> {
  const request = await nextTo("/command/");
  answer(request, CommandAnswerSchema, { accepted: true, ...values });
  await after(0);
  return read(request, CommandRequestSchema).jointPositions.map((each) => Math.round(each / DEGREE));
}

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/control/joint-steps");
  told = [];
  document.body.append(...buttons);
  await takeControl();
});

test("a press is one step, which is done when the joint has rested at its end", async () => {
  const used = steps();
  await used.press();
  expect(await accept({ warning: { code: "x", text: "close" } })).toEqual([5, 0]);
  await used.at(4);
  await after(1000);
  expect(last()).toBe("Sent: waist +5.00°");
  await used.at(4.9, { resting: false });
  await after(500);
  expect(used.now.going).not.toBeNull();
  await used.at(5);
  await after(140);
  expect(used.now.going).not.toBeNull();
  await after(20);
  expect(used.now.going).toBeNull();
  expect(told.at(-1)).toEqual({ kind: "done", text: "Done: waist +5.00°", warning: "close" });
});

test("of many quick presses the second waits, and no third is taken", async () => {
  const used = steps();
  for (let i = 0; i < 5; i++) await used.press();
  expect(commands()).toHaveLength(1);
  expect([used.now.waiting, used.end()]).toEqual([{ index: 0, offset: 5 * DEGREE }, "10.00°"]);
  expect(used.now.waitingText(used.end())).toBe("1 step waits; ends at 10.00°. Further presses are not taken.");
  await accept();
  expect(used.end()).toBe("10.00°");
  await used.at(5);
  await after(200);
  await accept();
  await used.at(10);
  await after(200);
  expect([last(), commands(), used.now.waiting, used.end()]).toEqual(["Done: waist +5.00°", [], null, "–"]);
});

test("a new direction or joint replaces the step that waits", async () => {
  const used = steps();
  await used.press();
  await used.press();
  await used.press(-5, buttons[1]);
  expect(used.now.waitingText(used.end())).toBe("1 step waits; ends at 0.00°.");
  await used.press(7, buttons[0], 1);
  expect(used.end()).toBe("7.00°");
  await accept();
  await used.at(5);
  await after(200);
  expect(await accept()).toEqual([0, 7]);
});

function blur(): void {
  // The window of happy-dom's events is not this one.
  addEventListener("probe", ({ target }) => vi.stubGlobal("window", target), { once: true });
  for (const kind of ["probe", "blur"]) dispatchEvent(new Event(kind));
}
const key = (code: string, target: EventTarget) =>
  target.dispatchEvent(Object.assign(new Event("keydown", { bubbles: true }), { code }));
test.each([
  [
    "another pointer",
    () => document.body.dispatchEvent(new Event("pointerdown", { bubbles: true })),
    "another pointer",
  ],
  ["another key", () => key("Escape", buttons[0] as Element), "another pointer, button or key"],
  ["Enter elsewhere", () => key("Enter", buttons[1] as Element), "another pointer, button or key"],
  ["another window", blur, "another window"],
])("%s drops the step that waits, and not the one that goes", async (_, act, why) => {
  const used = steps();
  await used.press();
  await used.press();
  act();
  await after(0);
  expect(used.now.waiting).toBeNull();
  expect(last()).toContain(`The step that waited is not sent: ${why}`);
  await accept();
  await used.at(5);
  await after(500);
  expect([last(), commands()]).toEqual(["Done: waist +5.00°", []]);
});

test("a hidden browser drops the step that waits", async () => {
  const used = steps();
  await used.press();
  await used.press();
  const hide = (hidden: boolean) => Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
  expect(used.now.waiting).not.toBeNull();
  hide(true);
  document.dispatchEvent(new Event("visibilitychange"));
  hide(false);
  await after(0);
  expect([used.now.waiting, last()]).toEqual([null, "The step that waited is not sent: this browser was hidden."]);
});

test("presses of the same button and the loss of a field's focus drop nothing", async () => {
  const used = steps();
  await used.press();
  await used.press();
  buttons[0]?.dispatchEvent(new Event("pointerdown", { bubbles: true }));
  key("Enter", buttons[0] as Element);
  buttons[1]?.dispatchEvent(new Event("blur"));
  await after(0);
  expect(used.now.waiting).not.toBeNull();
});

test("a dialog that is open when the step would go drops it", async () => {
  const used = steps();
  await used.press();
  await used.press();
  await accept();
  const dialog = document.body.appendChild(document.createElement("dialog"));
  dialog.setAttribute("open", "");
  await used.at(5);
  await after(500);
  dialog.remove();
  expect([used.now.waiting, last(), commands()]).toEqual([
    null,
    "The step that waited is not sent: a dialog opened.",
    [],
  ]);
});

test("a refused step drops the one that waits, which assumed its end, and is marked until the next press", async () => {
  const used = steps();
  await used.press();
  await used.press();
  refuse(await nextTo("/command/"), "elbow at its limit");
  await after(0);
  expect(last()).toBe("Not sent: elbow at its limit. The step that waited is not sent.");
  expect([used.now.waiting, used.now.going, used.now.refused]).toEqual([null, null, { index: 0, offset: 5 * DEGREE }]);
  await used.press();
  expect(used.now.refused).toBeNull();
});

test("a joint that stops advancing has not arrived", async () => {
  const used = steps();
  await used.press();
  await used.press();
  await accept();
  for (const degrees of [1, 2, 3]) {
    await after(2400);
    await used.at(degrees);
  }
  expect(used.now.going).not.toBeNull();
  await after(2600);
  expect([used.now.going, used.now.waiting]).toEqual([null, null]);
  expect(last()).toBe("waist did not arrive where its step leads. The step that waited is not sent.");
});

test("when steps are no longer possible, none waits and none is followed", async () => {
  const used = steps();
  await used.press();
  await used.press();
  await accept();
  await used.at(1, { enabled: false });
  expect([used.now.going, used.now.waiting, last()]).toEqual([null, null, "The step that waited is not sent."]);
});

test("a joint without a known position takes no step", async () => {
  const used = steps();
  await used.at(0, { current: [undefined, 0] });
  await used.press();
  expect([commands(), used.now.going]).toEqual([[], null]);
});
