// The states of a press that moves a robot while it is held: by mouse, touch, pen or a key. No DOM: hold.ts has it.
//
//   state    input                                             next
//   idle     pressed: mouse or key                             held      begin
//   idle     pressed: touch or pen                             resting
//   resting  rested: 120 ms without moving by 8 px             held      begin
//   resting  strayed: moved by 8 px before, as a scroll does   spent
//   resting  released                                          idle
//   resting  any other end                                     spent
//   held     released                                          idle      end
//   held     any other end                                     spent     end
//   spent    lifted: no pointer is down any more               idle
//
// What the table does not have changes nothing. The page has one press at a time: a second one is an end ("other").

export type HoldState = "idle" | "resting" | "held" | "spent";

const INTERRUPTIONS = [
  "left", // the pointer is 16 px outside of the control
  "other", // another pointer, button or key was pressed
  "cancelled", // pointercancel, or capture was lost
  "blur", // another window has the focus
  "focus", // another control has the focus
  "hidden",
  "dialog",
  "covered", // the control is no longer in sight where it is
  "locked", // the control was disabled or removed
] as const;
/** Why a hold ended. */
export type HoldEnd = "released" | (typeof INTERRUPTIONS)[number];
export type HoldInput = "pressed" | "touched" | "rested" | "strayed" | "lifted" | HoldEnd;

export const REST_MS = 120;
const REST_PX = 8;
const OUTSIDE_PX = 16;

const interrupted = Object.fromEntries(INTERRUPTIONS.map((each) => [each, "spent"])) as Record<HoldEnd, "spent">;
const TABLE: Record<HoldState, Partial<Record<HoldInput, HoldState>>> = {
  idle: { pressed: "held", touched: "resting" },
  resting: { ...interrupted, rested: "held", strayed: "spent", released: "idle" },
  held: { ...interrupted, released: "idle" },
  spent: { lifted: "idle" },
};

/** Return the state after an input; the same state if the table does not have it. */
export const nextState = (state: HoldState, input: HoldInput): HoldState => TABLE[state][input] ?? state;

interface Point {
  x: number;
  y: number;
}

/** Return what a move to a point [px] means: the press began at `from`, on a control with this box. */
export function moveInput(
  state: HoldState,
  from: Point,
  to: Point,
  box: { left: number; right: number; top: number; bottom: number },
): "strayed" | "left" | null {
  if (state === "resting" && Math.hypot(to.x - from.x, to.y - from.y) >= REST_PX) return "strayed";
  const outside = Math.max(box.left - to.x, to.x - box.right, box.top - to.y, to.y - box.bottom);
  return state === "held" && outside >= OUTSIDE_PX ? "left" : null;
}

/** Return whether pressed buttons end a press that holds the main one, and why. */
export function buttonsInput(buttons: number): "released" | "other" | null {
  if (buttons === 1) return null;
  return buttons & 1 ? "other" : "released";
}
