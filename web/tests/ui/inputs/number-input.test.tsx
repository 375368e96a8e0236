// A field for a number.

import type { ComponentProps } from "preact";
import { beforeEach, expect, test, vi } from "vitest";
import { NumberInput } from "../../../src/ui/inputs/number-input";
import { numberText, readNumber } from "../../../src/ui/inputs/number-text";
import { find, key, send, type } from "../../hands";
import { show } from "../../shown";

test.each([
  ["1.5", 1.5],
  [" −2 ", -2],
  ["-.5", -0.5],
  ["+3.", 3],
  ["1e-3", 0.001],
  ["1,5", null],
  ["1 2", null],
  ["", null],
  ["e3", null],
  ["1e999", null],
])("the text %o is the number %s", (text, number) => expect(readNumber(text)).toBe(number));

test.each([
  [0.1 + 0.2, "0.3"],
  [-1.5, "−1.5"],
  [1e-7, "0"],
])("the number %s is written as %o", (value, text) => expect(numberText(value)).toBe(text));

const set = vi.fn<(value: number) => void>();
const end = vi.fn();
let value: number;
let draw: (more?: Partial<ComponentProps<typeof NumberInput>>) => void;

beforeEach(() => {
  set.mockReset();
  end.mockReset();
  value = 10;
  const place = show(null);
  draw = (more = {}) => {
    const redraw = (next: number) => (set(next), (value = next), draw(more));
    show(<NumberInput id="x" value={value} set={redraw} end={end} {...more} />, place);
  };
});
const field = () => find<HTMLInputElement>("input");
const state = () => [field().value, field().getAttribute("aria-invalid")];

test("what is typed is set at once, and stays as it was typed", () => {
  draw();
  type("input", "2.50");
  expect([set.mock.calls, state()]).toEqual([[[2.5]], ["2.50", "false"]]);
  key("input", "Enter");
  expect([state(), end.mock.calls.length]).toEqual([["2.5", "false"], 1]);
});

test("an invalid text sets nothing and stays marked until Escape gives it up", () => {
  draw();
  type("input", "2,5");
  key("input", "Enter");
  send("input", new Event("blur"));
  expect([set.mock.calls, state()]).toEqual([[], ["2,5", "true"]]);
  key("input", "Escape");
  expect(state()).toEqual(["10", "false"]);
});

test("a value that another changes is shown in the place of the typed one", () => {
  draw();
  type("input", "2.50");
  value = 3;
  draw();
  expect(state()).toEqual(["3", "false"]);
});

test("a value that was converted and back is still what was typed", () => {
  draw();
  type("input", "0.30");
  value = 0.1 + 0.2;
  draw();
  expect(state()).toEqual(["0.30", "false"]);
  send("input", new Event("blur"));
  expect(state()).toEqual(["0.3", "false"]);
});

test("the arrow keys step, with Shift ten times", () => {
  draw({ step: 0.1 });
  for (const [name, shiftKey] of [
    ["ArrowUp", false],
    ["ArrowUp", true],
    ["ArrowDown", false],
    ["Home", false],
  ] as const)
    key("input", name, { shiftKey });
  expect(set.mock.calls.flat()).toEqual([10.1, 11.1, 11]);
  draw();
  key("input", "ArrowUp");
  expect(set).toHaveBeenLastCalledWith(12);
});

test("a number that must be positive is neither typed nor stepped to 0", () => {
  value = 1;
  draw({ positive: true });
  type("input", "0");
  expect([set.mock.calls, state()]).toEqual([[], ["0", "true"]]);
  key("input", "ArrowDown");
  expect([set.mock.calls, state()]).toEqual([[], ["1", "false"]]);
  type("input", "0.5");
  expect(set.mock.calls).toEqual([[0.5]]);
});

test("an invalid text may outlive its field", () => {
  const setInvalid = vi.fn();
  draw({ setInvalid });
  type("input", "x");
  type("input", "4");
  expect(setInvalid.mock.calls).toEqual([["x"], [null]]);
  draw({ setInvalid, invalid: "y" });
  expect(state()).toEqual(["y", "true"]);
});

test("a number has the format of its place", () => {
  draw({ format: (each) => each.toFixed(2), title: "x of the hand" });
  expect([field().value, field().title]).toEqual(["10.00", "x of the hand"]);
});
