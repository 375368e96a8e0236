// Closing of a popup: Escape, or a press or the focus elsewhere.

import type { RefObject } from "preact";
import { useEffect } from "preact/hooks";

/** Call `close` when the operator presses Escape inside, or presses or focuses something outside. */
export function useDismissal(place: RefObject<HTMLElement | null>, close: () => void): void {
  useEffect(() => {
    const ending = new AbortController();
    const { signal } = ending;
    const elsewhere = (event: Event) => {
      if (event.target instanceof Node && !place.current?.contains(event.target)) close();
    };
    const onKey = (event: KeyboardEvent) => {
      if (event.key !== "Escape" || !place.current?.contains(document.activeElement)) return;
      close();
      place.current.querySelector<HTMLElement>("summary, button")?.focus();
    };
    addEventListener("pointerdown", elsewhere, { signal });
    addEventListener("focusin", elsewhere, { signal });
    addEventListener("keydown", onKey, { signal });
    return () => ending.abort();
  }, []);
}
