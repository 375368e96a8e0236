// A press on a control that has just moved is ignored.

import { beforeEach, expect, test, vi } from "vitest";

const ignored = vi.fn();
const pressed = vi.fn();
let left: number;
let stop: () => void;

beforeEach(async () => {
  vi.resetModules();
  vi.useFakeTimers();
  document.body.innerHTML = `<div><button data-moves>Home</button><button id="free">STOP</button></div>`;
  left = 10;
  for (const button of document.querySelectorAll("button")) {
    button.addEventListener("click", pressed);
    vi.spyOn(button, "getBoundingClientRect").mockImplementation(() => ({ left, top: 0 }) as DOMRect);
  }
  ignored.mockReset();
  pressed.mockReset();
  const { guardMovedControls } = await import("../../../src/ui/hold/moved-controls");
  stop = guardMovedControls(ignored);
  vi.advanceTimersByTime(2000);
  return () => stop();
});

/** Press a control as a pointer does; return whether it acted. */
function press(selector = "[data-moves]", detail = 1): boolean {
  pressed.mockReset();
  const control = document.querySelector(selector);
  if (detail) control?.dispatchEvent(new Event("pointerdown", { bubbles: true, cancelable: true }));
  control?.dispatchEvent(new MouseEvent("click", { bubbles: true, cancelable: true, detail }));
  return pressed.mock.calls.length > 0;
}

test("a control that stays where it is can be pressed", () => {
  expect([press(), ignored.mock.calls.length]).toEqual([true, 0]);
  left += 1; // a rounding
  expect(press()).toBe(true);
});

test("for half a second after it moved a press is ignored, and said to be", () => {
  left += 2;
  expect([press(), ignored.mock.calls.length]).toEqual([false, 1]);
  vi.advanceTimersByTime(499);
  expect(press()).toBe(false);
  vi.advanceTimersByTime(2);
  expect(press()).toBe(true);
});

test("a shift is noticed without a press, within a second also without a change of the document", async () => {
  left += 50;
  vi.advanceTimersByTime(1600);
  expect(press()).toBe(true);
  left += 50;
  document.body.firstElementChild?.classList.add("changed");
  await vi.advanceTimersByTimeAsync(200);
  await vi.advanceTimersByTimeAsync(450);
  expect(press()).toBe(true); // it moved 500 ms before, and that was seen
});

test("the keyboard, STOP and disabled controls are never held up", () => {
  left += 50;
  expect([press("[data-moves]", 0), press("#free"), ignored.mock.calls.length]).toEqual([true, true, 0]);
  document.querySelector("button")?.setAttribute("disabled", "");
  document.querySelector("button")?.dispatchEvent(new Event("pointerdown", { bubbles: true }));
  expect(ignored).not.toHaveBeenCalled();
});

test("scrolling is no movement", () => {
  const parent = document.querySelector("div") as HTMLElement;
  Object.defineProperty(parent, "scrollLeft", { value: 40 });
  left -= 40;
  expect(press()).toBe(true);
});

test.each([
  ["new", false],
  ["", true],
])('a control that appears with the value "%s" can be pressed at once: %s', (value, acts) => {
  document.body.innerHTML = `<button data-moves="${value}">Accept</button>`;
  document.querySelector("button")?.addEventListener("click", pressed);
  expect(press()).toBe(acts);
  vi.advanceTimersByTime(501);
  expect(press()).toBe(true);
});

test("after its end nothing is ignored", () => {
  stop();
  left += 50;
  expect([press(), vi.getTimerCount()]).toEqual([true, 0]);
});
