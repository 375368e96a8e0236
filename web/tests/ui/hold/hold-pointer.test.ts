// The table of a press that moves a robot while it is held.

import { expect, test } from "vitest";
import type { HoldEnd, HoldInput, HoldState } from "../../../src/ui/hold/hold-pointer";
import { buttonsInput, moveInput, nextState } from "../../../src/ui/hold/hold-pointer";

const ENDS: HoldEnd[] = ["left", "other", "cancelled", "blur", "focus", "hidden", "dialog", "covered", "locked"];
const INPUTS: HoldInput[] = ["pressed", "touched", "rested", "strayed", "released", "lifted", ...ENDS];
// Everything else changes nothing.
const TABLE: Record<HoldState, Partial<Record<HoldInput, HoldState>>> = {
  idle: { pressed: "held", touched: "resting" },
  resting: { rested: "held", strayed: "spent", released: "idle", ...all("spent") },
  held: { released: "idle", ...all("spent") },
  spent: { lifted: "idle" },
};
function all(next: HoldState) {
  return Object.fromEntries(ENDS.map((end) => [end, next]));
}

test.each(Object.keys(TABLE) as HoldState[])(
  "every input of a press that is %s leads where the table says",
  (state) => {
    const next = Object.fromEntries(INPUTS.map((input) => [input, nextState(state, input)]));
    expect(next).toEqual(Object.fromEntries(INPUTS.map((input) => [input, TABLE[state][input] ?? state])));
  },
);

const BOX = { left: 100, right: 136, top: 50, bottom: 82 };
test.each<[HoldState, number, number, HoldInput | null]>([
  ["resting", 117, 66, null],
  ["resting", 110 + 7.9, 66, null],
  ["resting", 110, 66 + 8, "strayed"],
  ["resting", 110 - 6, 66 - 6, "strayed"],
  ["held", 110, 82, null],
  ["held", 136 + 15.9, 82 + 15.9, null],
  ["held", 136 + 16, 66, "left"],
  ["held", 100 - 16, 66, "left"],
  ["held", 110, 50 - 16, "left"],
  ["held", 110, 82 + 16, "left"],
  ["idle", 500, 500, null],
  ["spent", 500, 500, null],
])("a touch strays by 8 px and a held pointer leaves by 16 (%s, %s, %s: %s)", (state, x, y, input) => {
  expect(moveInput(state, { x: 110, y: 66 }, { x, y }, BOX)).toBe(input);
});

test("only the main button alone goes on", () => {
  expect([0, 1, 2, 3, 4].map(buttonsInput)).toEqual(["released", null, "released", "other", "released"]);
});
