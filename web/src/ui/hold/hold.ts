// The one press that is held on this page: events of the browser as inputs of the table in hold-pointer.ts.

import { dialogIsOpen } from "../../mesh/control/display-freshness";
import type { HoldEnd, HoldInput, HoldState } from "./hold-pointer";
import { buttonsInput, moveInput, nextState, REST_MS } from "./hold-pointer";

/** What a control does with a press. */
export interface Press {
  begin: () => void;
  /** Called once for each `begin`. */
  end: (why: HoldEnd) => void;
  /** A drag: a touch begins it without a rest, and its pointer may leave the control. */
  isDrag?: boolean;
}

interface Followed extends Press {
  element: HTMLElement;
  id: number;
  from: { x: number; y: number };
  at: { x: number; y: number };
  stop: AbortController;
}

const KEY = -1; // instead of a pointer's id
const LOOK_MS = 40; // the layout may move or cover a control without an event

let state: HoldState = "idle";
let followed: Followed | null = null;
/** Kinds of the pointers that are down, by id. */
const down = new Map<number, string>();

export const isEnter = (event: KeyboardEvent) => event.code === "Enter" || event.code === "NumpadEnter";

/** Follow a press of the main button, a primary touch or pen, or Enter, unless something else is down already. */
export function followPress(element: HTMLElement, event: PointerEvent | KeyboardEvent, press: Press): void {
  const pointer = "pointerId" in event ? event : null;
  const isAlone = down.size === (pointer ? 1 : 0);
  if (state !== "idle" || !isAlone || !document.hasFocus() || (pointer && pointer.button !== 0)) return;
  const from = { x: pointer?.clientX ?? 0, y: pointer?.clientY ?? 0 };
  const stop = new AbortController();
  const mine: Followed = { ...press, element, id: pointer?.pointerId ?? KEY, from, at: from, stop };
  const { signal } = stop;
  followed = mine;
  if (!press.isDrag) element.focus();
  element.addEventListener("blur", () => feed(lostFocus()), { signal });
  element.addEventListener("lostpointercapture", () => feed("cancelled"), { signal });
  // A busy page's timer may come before moves that wait; the browser delivers these before it draws.
  const rested = () => requestAnimationFrame(() => followed === mine && feed("rested"));
  const timers = [setInterval(look, LOOK_MS), setTimeout(rested, REST_MS)];
  signal.addEventListener("abort", () => timers.forEach(clearTimeout));
  const rests = pointer !== null && pointer.pointerType !== "mouse" && !press.isDrag;
  feed(rests ? "touched" : "pressed");
  try {
    if (pointer) element.setPointerCapture(pointer.pointerId);
  } catch {
    feed("cancelled"); // the pointer is already gone
  }
}

/** End the press of a control that is disabled or removed. */
export function lock(element: HTMLElement | null): void {
  if (followed?.element === element) feed("locked");
}

function feed(input: HoldInput): void {
  const before = state;
  state = nextState(before, input);
  if (state === before || state === "resting" || !followed) return;
  const press = followed;
  if (state === "held") press.begin();
  else {
    followed = null;
    press.stop.abort();
    if (before === "held") press.end(input as HoldEnd);
    if (down.size === 0) feed("lifted");
  }
}

function lostFocus(): HoldEnd {
  if (document.hidden) return "hidden";
  if (!document.hasFocus()) return "blur";
  return dialogIsOpen() ? "dialog" : "focus";
}

/** Notice what may have no event: a dialog, capture that was taken, a control that moved away or is covered. */
function look(): void {
  if (!followed) return;
  const { element, id, isDrag } = followed;
  const box = element.getBoundingClientRect();
  const seen = document.elementFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
  if (dialogIsOpen()) feed("dialog");
  else if (!element.isConnected) feed("locked");
  else if (id !== KEY && !element.hasPointerCapture(id)) feed("cancelled");
  else if (!isDrag && !element.contains(seen)) feed("covered");
  else moved(box);
}

function moved(box: DOMRect): void {
  if (!followed || followed.isDrag || followed.id === KEY) return;
  const input = moveInput(state, followed.from, followed.at, box);
  if (input) feed(input);
}

function onDown(event: PointerEvent): void {
  feed("other");
  // A new first pointer: the end of an earlier one of its kind was not delivered.
  if (event.isPrimary) for (const [id, kind] of down) if (kind === event.pointerType) lift(id);
  down.set(event.pointerId, event.pointerType);
}

function onMove(event: PointerEvent): void {
  if (event.pointerId !== followed?.id) return;
  const input = buttonsInput(event.buttons);
  if (input) feed(input);
  else {
    followed.at = { x: event.clientX, y: event.clientY };
    moved(followed.element.getBoundingClientRect());
  }
}

function onEnd({ pointerId }: PointerEvent, why: HoldEnd): void {
  if (pointerId === followed?.id) feed(why);
  lift(pointerId);
}

function lift(id: number): void {
  down.delete(id);
  if (down.size === 0) feed("lifted");
}

addEventListener("pointerdown", onDown, true);
addEventListener("pointermove", onMove, true);
addEventListener("pointerup", (event) => onEnd(event, "released"), true);
addEventListener("pointercancel", (event) => onEnd(event, "cancelled"), true);
addEventListener("keydown", (event) => event.repeat || feed("other"), true);
addEventListener("keyup", () => followed?.id === KEY && feed("released"), true);
addEventListener("pagehide", () => feed("hidden"));
document.addEventListener("visibilitychange", () => document.hidden && feed("hidden"));
addEventListener("blur", () => {
  feed("blur");
  // The browser does not deliver what is lifted elsewhere.
  for (const id of [...down.keys()]) lift(id);
});
