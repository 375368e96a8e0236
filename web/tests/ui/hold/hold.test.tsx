// Presses that move a robot: held by one pointer or Enter, and ended by everything else.

import { beforeEach, expect, test, vi } from "vitest";
import { connect, newPage } from "../../console";
import { find, key, pass, send } from "../../hands";
import { hide, show } from "../../shown";

const begun = vi.fn();
const ended = vi.fn();
let captured: Set<number>;
let focused: boolean;
let draw: (enabled?: boolean) => void;
let place: HTMLElement;

beforeEach(async () => {
  newPage();
  await connect();
  begun.mockReset();
  ended.mockReset();
  captured = new Set();
  focused = true;
  vi.spyOn(document, "hasFocus").mockImplementation(() => focused);
  document.elementFromPoint = () => document.querySelector(".step");
  Object.assign(HTMLElement.prototype, {
    setPointerCapture: (id: number) => captured.add(id),
    hasPointerCapture: (id: number) => captured.has(id),
  });
  const { HoldButton } = await import("../../../src/ui/hold/hold-button");
  place = show(null);
  draw = (enabled = true) =>
    show(<HoldButton name="Waist +" sign={1} enabled={enabled} hold={() => (begun(), ended)} />, place);
  draw();
  vi.spyOn(find(".step"), "getBoundingClientRect").mockReturnValue({
    left: 0,
    right: 30,
    top: 0,
    bottom: 30,
  } as DOMRect);
});

function pointer(kind: string, more: PointerEventInit = {}): void {
  const of = { pointerId: 1, pointerType: "mouse", isPrimary: true, button: 0, buttons: 1, clientX: 15, clientY: 15 };
  send(".step", new PointerEvent(`pointer${kind}`, { ...of, bubbles: true, cancelable: true, ...more }));
}
const lift = (more: PointerEventInit = {}) => pointer("up", { buttons: 0, ...more });
const ends = () => ended.mock.calls.flat();

test("a mouse holds at once, and its release ends the hold", () => {
  pointer("down");
  expect([begun.mock.calls.length, ends()]).toEqual([1, []]);
  lift();
  expect(ends()).toEqual(["released"]);
  pointer("down");
  expect(begun).toHaveBeenCalledTimes(2);
  lift();
});

test("a touch holds after a rest, in which it may begin to scroll", async () => {
  const touch = { pointerType: "touch" };
  pointer("down", touch);
  await pass(100);
  expect(begun).not.toHaveBeenCalled();
  await pass(60);
  expect(begun).toHaveBeenCalledOnce();
  lift(touch);
  pointer("down", touch);
  pointer("move", { ...touch, clientY: 24 });
  await pass(300);
  expect(begun).toHaveBeenCalledOnce();
  lift(touch);
});

const touchMoves = () => {
  const event = new Event("touchmove", { bubbles: true, cancelable: true });
  send(".step", event);
  return !event.defaultPrevented;
};
test("a touch that holds scrolls no page away", async () => {
  pointer("down", { pointerType: "touch" });
  expect(touchMoves()).toBe(true);
  await pass(200);
  expect(touchMoves()).toBe(false);
  lift({ pointerType: "touch" });
});

test.each<[string, string, () => unknown]>([
  ["leaves the button", "left", () => pointer("move", { clientX: 46 })],
  ["has another button pressed", "other", () => pointer("move", { buttons: 3 })],
  ["has no button pressed any more", "released", () => pointer("move", { buttons: 0 })],
  ["is joined by another", "other", () => pointer("down", { pointerId: 2, isPrimary: false, pointerType: "touch" })],
  ["is joined by a key", "other", () => key(".step", "a")],
  ["is cancelled", "cancelled", () => pointer("cancel")],
  ["loses its capture", "cancelled", () => send(".step", new Event("lostpointercapture"))],
  ["loses its capture unseen", "cancelled", () => captured.clear()],
  ["is behind a dialog", "dialog", () => document.body.insertAdjacentHTML("beforeend", "<dialog open></dialog>")],
  ["has its button covered", "covered", () => (document.elementFromPoint = () => document.body)],
  ["has its button locked", "locked", () => draw(false)],
  ["has its button removed", "locked", () => hide(place)],
  ["is on a page that is left", "hidden", () => dispatchEvent(new Event("pagehide"))],
  ["is in a window behind another", "blur", () => dispatchEvent(new Event("blur"))],
  ["is on a button without the focus", "focus", () => send(".step", new Event("blur"))],
])("a hold whose pointer %s ends once: %s", async (_, why, interrupt) => {
  pointer("down");
  interrupt();
  await pass(100);
  document.querySelector("dialog")?.remove();
  expect([begun.mock.calls.length, ends()]).toEqual([1, [why]]);
});

test("after an interruption nothing holds before every pointer is lifted", () => {
  pointer("down");
  pointer("move", { clientX: 90 });
  pointer("move", { clientX: 15 });
  pointer("down", { pointerId: 2, pointerType: "touch" });
  expect(begun).toHaveBeenCalledOnce();
  lift({ pointerId: 2 });
  lift();
  pointer("down");
  expect(begun).toHaveBeenCalledTimes(2);
  lift();
});

test.each<[string, () => void]>([
  ["another mouse button", () => pointer("down", { button: 2, buttons: 2 })],
  ["a page without the focus", () => ((focused = false), pointer("down"))],
  ["another key", () => key(".step", " ", { code: "Space" })],
  ["Enter's repeat", () => key(".step", "Enter", { code: "Enter", repeat: true })],
])("%s holds nothing", async (_, press) => {
  press();
  await pass(300);
  expect(begun).not.toHaveBeenCalled();
  lift();
});

test.each(["Enter", "NumpadEnter"])(
  "%s holds until it is released, without a second hold by its repeats",
  async (code) => {
    key(".step", "Enter", { code });
    key(".step", "Enter", { code, repeat: true });
    await pass(300);
    expect([begun.mock.calls.length, ends()]).toEqual([1, []]);
    send(".step", new KeyboardEvent("keyup", { code, bubbles: true }));
    expect(ends()).toEqual(["released"]);
  },
);

test("a pointer that is already gone holds nothing on", () => {
  Object.assign(HTMLElement.prototype, {
    setPointerCapture: () => {
      throw new Error("NotFoundError");
    },
  });
  pointer("down");
  expect(ends()).toEqual(["cancelled"]);
  lift();
});

test("a press is one step, and its key's repeat none", async () => {
  const { StepButton } = await import("../../../src/ui/hold/step-button");
  const pressed = vi.fn();
  show(<StepButton name="Waist −" sign={-1} enabled press={pressed} />, place);
  expect(find(".step").textContent).toBe("−");
  find(".step").click();
  expect(pressed.mock.calls).toEqual([[find(".step")]]);
  const repeated = (repeat: boolean) => {
    const event = new KeyboardEvent("keydown", { key: "Enter", repeat, bubbles: true, cancelable: true });
    send(".step", event);
    return event.defaultPrevented;
  };
  expect([repeated(false), repeated(true)]).toEqual([false, true]);
});

test("a drag of a joint's handle sends its target when it is let go, and nothing when it is interrupted", async () => {
  const { JointTrack } = await import("../../../src/ui/joints/joint-track");
  const [preview, sent] = [vi.fn(), vi.fn()];
  const props = { label: "Waist", lower: 0, upper: 10, position: 5, target: undefined, stale: false, step: 1 };
  show(<JointTrack {...props} enabled text={String} preview={preview} send={sent} />, place);
  vi.spyOn(find(".track"), "getBoundingClientRect").mockReturnValue({ left: 0, width: 100 } as DOMRect);
  const drag = (kind: string, clientX: number, more: PointerEventInit = {}) =>
    send(
      ".track-handle",
      new PointerEvent(`pointer${kind}`, {
        pointerId: 1,
        isPrimary: true,
        buttons: 1,
        bubbles: true,
        clientX,
        ...more,
      }),
    );
  drag("down", 52);
  drag("up", 52, { buttons: 0 });
  expect([sent.mock.calls, preview.mock.lastCall]).toEqual([[], [undefined]]); // a tap
  drag("down", 52);
  drag("move", 72);
  drag("move", 90, { pointerId: 2 });
  expect([preview.mock.lastCall?.[0], sent.mock.calls]).toEqual([expect.closeTo(7), []]);
  drag("up", 72, { buttons: 0 });
  expect(sent.mock.calls).toEqual([[expect.closeTo(7)]]);
  drag("down", 50);
  drag("move", 999);
  expect(preview.mock.lastCall).toEqual([10]);
  drag("cancel", 999);
  expect([sent.mock.calls.length, preview.mock.lastCall]).toEqual([1, [undefined]]);
});
