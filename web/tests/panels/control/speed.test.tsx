// The slider of the requested speed.

import { beforeEach, expect, test, vi } from "vitest";
import { newPage } from "../../console";
import { find, key, pass, send, type } from "../../hands";
import { show } from "../../shown";

const SLIDER = "input[type=range]";
const ask = vi.fn<(percent: number) => Promise<boolean>>();
let shown: (percent: number | undefined, enabled?: boolean) => void;

beforeEach(async () => {
  newPage();
  const { Speed } = await import("../../../src/panels/control/speed");
  const place = show(null);
  shown = (percent, enabled = true) => show(<Speed percent={percent} enabled={enabled} send={ask} />, place);
  ask.mockReset().mockResolvedValue(true);
});

const pointer = (kind: string) => send(SLIDER, new Event(`pointer${kind}`, { bubbles: true }));
const state = () => [find(".speed").className.slice("speed ".length), find(".value").textContent];
const hint = () => find(".speed-hint").textContent;

test.each([
  [undefined, "unset", "not known", "100", "Nobody has set it since the link came up."],
  [9, "low", "9\u202f%", "9", "Low: the arm moves slowly."],
  [10, "", "10\u202f%", "10", "\u00a0"],
])("a speed of %s %% is shown as what it is", (percent, mark, text, value, says) => {
  shown(percent);
  expect([...state(), hint()]).toEqual([mark, text, says]);
  expect(document.querySelectorAll(".shape.warning")).toHaveLength(mark === "low" ? 1 : 0);
  const slider = find<HTMLInputElement>(SLIDER);
  expect([slider.value, slider.min, slider.max, slider.getAttribute("aria-valuetext")]).toEqual([
    value,
    "1",
    "100",
    text,
  ]);
});

test("a speed is sent once, when the slider is let go, and shown until the gateway has published it", async () => {
  shown(50);
  pointer("down");
  for (const percent of ["40", "30"]) type(SLIDER, percent);
  expect([...state(), hint()]).toEqual(["unsent", "30\u202f%", "Not sent yet: let go to send 30\u202f%."]);
  expect(ask).not.toHaveBeenCalled();
  pointer("up");
  expect(ask.mock.calls).toEqual([[30]]);
  await pass(490);
  expect(state()).toEqual(["", "30\u202f%"]);
  await pass(20);
  expect(state()).toEqual(["", "50\u202f%"]);
});

test("the keys set a speed, and Enter sends it", () => {
  shown(50);
  type(SLIDER, "5");
  expect(document.querySelector(".shape.warning")).toBeNull();
  expect([...state(), hint()]).toEqual([
    "unsent",
    "5\u202f%",
    "Not sent yet: Enter sends 5\u202f%, Escape takes it back.",
  ]);
  key(SLIDER, "ArrowLeft");
  expect(ask).not.toHaveBeenCalled();
  key(SLIDER, "Enter");
  expect(ask.mock.calls).toEqual([[5]]);
});

test.each([
  ["Escape", () => key(SLIDER, "Escape")],
  ["another focus", () => send(SLIDER, new Event("blur"))],
  ["a cancelled touch", () => pointer("cancel")],
])("%s takes a speed back, and nothing is sent", (_, takeBack) => {
  shown(50);
  pointer("down");
  type(SLIDER, "80");
  takeBack();
  expect(state()).toEqual(["", "50\u202f%"]);
  pointer("up");
  expect(ask).not.toHaveBeenCalled();
});

test("a slider that was disabled meanwhile sends nothing", () => {
  shown(50);
  pointer("down");
  type(SLIDER, "80");
  shown(50, false);
  pointer("up");
  expect(ask).not.toHaveBeenCalled();
});
