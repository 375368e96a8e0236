// What the page shows of a robot, and when it is too old to move the robot by it.

import { beforeEach, expect, test, vi } from "vitest";
import { ControllerStateSchema } from "../../../src/gen/robomesh_pb";
import type { Picture } from "../../../src/mesh/control/display-freshness";
import { connect, newPage, publish } from "../../console";
import { latest } from "../../latest";
import { use } from "../../shown";
import { ROBOT, showState } from "./operator";

let page: typeof import("../../../src/mesh/control/display-freshness");
const SCREEN = { left: 0, right: 100, top: 0, bottom: 100 };
const place = (rectangle: Partial<typeof SCREEN> = {}, visible = true) =>
  ({ checkVisibility: () => visible, getBoundingClientRect: () => ({ ...SCREEN, ...rectangle }) }) as Element;
const picture = (ageS: number | null, sequence = 7n): Picture => ({
  sequence,
  sourceTime: 1_000_000.125,
  newAt: ageS === null ? null : performance.now() - 1000 * ageS,
});

/** Show a view of the robot whose newest picture has an age [s]. */
function showView(drawn: Picture | undefined, view = "front", element: Element | null = place()) {
  const used = use(
    page.useShownView,
    ROBOT,
    view,
    view === page.OWN_DRAWING ? "joints" : `video/${view}`,
    () => element,
  );
  used.result.picture = drawn;
  return used;
}

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/control/display-freshness");
  await connect({
    stale: [
      { topic: "joints", afterS: 1 },
      { topic: "video/*", afterS: 2 },
    ],
  } as never);
});

test("a robot that the page does not show keeps no motion from starting", () => {
  expect([page.whyFrozen(ROBOT), page.pageReport(ROBOT)]).toEqual(["", undefined]);
});

test.each([
  ["an old state", () => showState(5), "the robot's state is 5\u202fs old"],
  ["an old video", () => showView(picture(3)), "the video “Front”, which can be turned off, is 3\u202fs old"],
  ["an old drawing", () => showView(picture(3), "3d"), "the 3-D picture is 3\u202fs old"],
  ["a stored picture", () => showView(null), "the video “Front”, which can be turned off, is not live"],
  [
    "a picture of unknown age",
    () => showView(picture(null)),
    "the video “Front”, which can be turned off, is not live",
  ],
])("%s lets no motion start", async (_, show, why) => {
  await show();
  expect(page.whyFrozen(ROBOT)).toBe(`No new motion: ${why}.`);
});

test.each([
  ["a state and pictures that are new", () => (showView(picture(1.9)), showState(0.9))],
  ["a view without a picture yet", () => showView(undefined)],
  ["a view that is gone", () => showView(picture(9), "front", null)],
  ["an invisible view", () => showView(picture(9), "front", place({}, false))],
  ["a view left of the screen", () => showView(picture(9), "front", place({ right: 0 }))],
  ["a view above the screen", () => showView(picture(9), "front", place({ bottom: 0 }))],
  ["a view right of the screen", () => showView(picture(9), "front", place({ left: innerWidth }))],
  ["a view below the screen", () => showView(picture(9), "front", place({ top: innerHeight }))],
])("%s lets motion start", async (_, show) => {
  await show();
  expect(page.whyFrozen(ROBOT)).toBe("");
});

test("a view or state that is no longer shown counts no more", async () => {
  const view = showView(picture(9));
  const other = showView(picture(9), "top");
  const state = use(page.useShownState, ROBOT, latest({}, 5), undefined);
  state.end();
  view.end();
  expect(page.whyFrozen(ROBOT)).toContain("“Top”");
  other.end();
  expect([page.whyFrozen(ROBOT), page.pageReport(ROBOT)]).toEqual(["", undefined]);
});

test("a report names the rendered picture rather than the drawing, with its number, time and age", async () => {
  await showState(0.25);
  showView(picture(0.1), "3d");
  expect(page.pageReport(ROBOT)?.view).toBe("3d");
  showView(undefined, "top");
  showView(picture(0.5));
  const { pictureAgeS, stateAgeS, ...report } = page.pageReport(ROBOT) ?? {};
  expect(report).toEqual({ view: "front", picture: 7n, pictureTime: { seconds: 1000n, nanos: 125_000 } });
  expect([pictureAgeS, stateAgeS]).toEqual([expect.closeTo(0.5, 2), expect.closeTo(0.25, 2)]);
});

test("a report of a stored picture has no number, and one of a state alone no view", async () => {
  showView(null);
  expect(page.pageReport(ROBOT)).toEqual({ view: "front" });
  const state = use(page.useShownState, "other", latest({}, 0.25), undefined);
  expect(page.pageReport("other")).toEqual({ view: "", stateAgeS: expect.closeTo(0.25, 2) });
  state.draw("other", latest({}, null), undefined);
  expect(page.pageReport("other")).toBeUndefined();
});

test("a state that the gateway only repeats is as old as the controller's last unit", async () => {
  const { useTopic } = await import("../../../src/mesh/state/topics");
  const controller = use(useTopic, ControllerStateSchema, "c");
  publish("c", ControllerStateSchema, { lastUnitAgeS: 4 });
  await vi.advanceTimersByTimeAsync(100);
  use(page.useShownState, ROBOT, latest({}, 0), controller.result as never);
  expect(page.whyFrozen(ROBOT)).toContain("4\u202fs old");
});

test("an open dialog is before the page", () => {
  expect(page.dialogIsOpen()).toBe(false);
  const dialog = document.body.appendChild(document.createElement("dialog"));
  expect(page.dialogIsOpen()).toBe(false);
  dialog.setAttribute("open", "");
  expect(page.dialogIsOpen()).toBe(true);
  dialog.remove();
});
