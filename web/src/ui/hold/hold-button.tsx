// A button that acts while it is held: by one finger, pen, the main mouse button, or Enter. Space requests a stop.
//
// Everything but an uninterrupted hold is a release; hold-pointer.ts has the table.

import { useEffect, useRef } from "preact/hooks";
import { followPress, isEnter, lock } from "./hold";
import type { HoldEnd } from "./hold-pointer";
import "./step-button.css";

export function HoldButton(props: {
  name: string;
  sign: 1 | -1;
  enabled: boolean;
  /** Begin; returns what ends it. */
  hold: () => (why: HoldEnd) => void;
}) {
  const button = useRef<HTMLButtonElement>(null);
  /** The touch has begun to hold: until it is lifted it must not scroll the button away. */
  const hasHeld = useRef(false);
  useEffect(() => {
    const keepInPlace = (event: TouchEvent) => hasHeld.current && event.cancelable && event.preventDefault();
    const element = button.current;
    element?.addEventListener("touchmove", keepInPlace, { passive: false });
    return () => {
      element?.removeEventListener("touchmove", keepInPlace);
      lock(element);
    };
  }, []);
  useEffect(() => {
    if (!props.enabled) lock(button.current);
  }, [props.enabled]);

  const press = (event: PointerEvent | KeyboardEvent) => {
    let release: (why: HoldEnd) => void = () => {};
    hasHeld.current = false;
    const begin = () => {
      hasHeld.current = true;
      release = props.hold();
    };
    if (button.current) followPress(button.current, event, { begin, end: (why) => release(why) });
  };
  return (
    <button
      ref={button}
      class="step hold"
      data-moves
      aria-label={props.name}
      title={props.name}
      disabled={!props.enabled}
      onPointerDown={press}
      onKeyDown={(event) => {
        if (!isEnter(event)) return;
        event.preventDefault();
        if (!event.repeat) press(event);
      }}
      onContextMenu={(event) => event.preventDefault()}
    >
      {props.sign > 0 ? "+" : "−"}
    </button>
  );
}
