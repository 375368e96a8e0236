// A button that acts while it is held: by one finger, the main mouse button, or Enter. Space requests a stop.
//
// Everything but an uninterrupted hold is a release: letting go, a second touch, lost capture or focus, another window,
// a hidden tab, a dialog (which takes the focus), a button that disappears or is disabled.

import { useEffect, useRef } from "preact/hooks";
import "./step-button.css";

export function HoldButton(props: {
  name: string;
  sign: 1 | -1;
  enabled: boolean;
  /** Begin; returns what ends it. */
  hold: () => () => void;
}) {
  const held = useRef<{ end: () => void } | null>(null);
  const release = () => held.current?.end();
  useEffect(() => release, []);
  useEffect(() => {
    if (!props.enabled) release();
  }, [props.enabled]);

  const begin = (button: HTMLButtonElement, pointer: number | null) => {
    if (held.current || !document.hasFocus()) return;
    button.focus();
    const listening = new AbortController();
    const { signal } = listening;
    const letGo = props.hold();
    const end = () => {
      if (held.current?.end !== end) return;
      held.current = null;
      listening.abort();
      letGo();
    };
    held.current = { end };
    const isOther = (event: PointerEvent) => pointer === null || event.pointerId !== pointer;
    addEventListener("blur", end, { signal });
    addEventListener("pagehide", end, { signal });
    addEventListener("pointerdown", (event) => isOther(event) && end(), { signal, capture: true });
    addEventListener("keydown", (event) => (pointer !== null || !isEnter(event)) && end(), {
      signal,
      capture: true,
    });
    document.addEventListener("visibilitychange", end, { signal });
    button.addEventListener("blur", end, { signal });
    button.addEventListener("keyup", end, { signal });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      button.addEventListener(kind, end, { signal });
    if (pointer === null) return;
    try {
      button.setPointerCapture(pointer);
    } catch {
      end(); // the pointer is already gone
    }
  };
  return (
    <button
      class="step hold"
      data-moves
      aria-label={props.name}
      title={props.name}
      disabled={!props.enabled}
      onPointerDown={(event) => {
        if (event.button === 0 && event.isPrimary) begin(event.currentTarget, event.pointerId);
      }}
      onKeyDown={(event) => {
        if (!isEnter(event)) return;
        event.preventDefault();
        if (!event.repeat) begin(event.currentTarget, null);
      }}
      onContextMenu={(event) => event.preventDefault()}
    >
      {props.sign > 0 ? "+" : "−"}
    </button>
  );
}

const isEnter = (event: KeyboardEvent) => event.code === "Enter" || event.code === "NumpadEnter";
