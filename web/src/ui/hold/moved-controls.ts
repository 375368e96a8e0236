// A press just after a control has moved is probably meant for what was there before: it is ignored.
//
// Controls that move a robot have the attribute `data-moves`. With the value "new" a control also counts as
// moved when it appears. STOP never has it. Scrolling is no movement: the user does it.

const QUIET_MS = 500;
const SAMPLE_MS = 100;
const UNCHANGED_SAMPLE_MS = 1000; // for shifts without a change of the document
const MOVED_PX = 1;

interface Place {
  left: number;
  top: number;
  movedAt: number;
}

const places = new WeakMap<Element, Place>();
let sampledAt = -Infinity;

/** Watch the controls; call `ignored` for each ignored press. Returns a function that ends it. */
export function guardMovedControls(ignored: () => void): () => void {
  let blocked: Element | null = null;
  const onPress = (event: Event) => {
    const control = event.target instanceof Element ? event.target.closest("[data-moves]") : null;
    if (event.type === "pointerdown") {
      blocked = null;
      if (!control || control.matches(":disabled")) return;
      sample();
      if (performance.now() - (places.get(control)?.movedAt ?? -Infinity) >= QUIET_MS) return;
      blocked = control;
      ignored();
    } else if (!control || control !== blocked || (event as MouseEvent).detail === 0) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  };
  let changed = true;
  const observer = new MutationObserver(() => (changed = true));
  const attributeFilter = ["class", "hidden", "open", "style"];
  observer.observe(document.body, { subtree: true, childList: true, characterData: true, attributeFilter });
  const onResize = () => (changed = true);
  addEventListener("resize", onResize);
  const timer = setInterval(() => {
    if (!changed && performance.now() - sampledAt < UNCHANGED_SAMPLE_MS) return;
    changed = false;
    sample();
  }, SAMPLE_MS);
  sample();
  for (const kind of ["pointerdown", "click"]) addEventListener(kind, onPress, true);
  return () => {
    clearInterval(timer);
    observer.disconnect();
    removeEventListener("resize", onResize);
    for (const kind of ["pointerdown", "click"]) removeEventListener(kind, onPress, true);
  };
}

function sample(): void {
  const now = (sampledAt = performance.now());
  for (const control of document.querySelectorAll("[data-moves]")) {
    const before = places.get(control);
    let { left, top } = control.getBoundingClientRect();
    for (let parent = control.parentElement; parent; parent = parent.parentElement) {
      left += parent.scrollLeft;
      top += parent.scrollTop;
    }
    const moved = before
      ? Math.abs(left - before.left) > MOVED_PX || Math.abs(top - before.top) > MOVED_PX
      : control.getAttribute("data-moves") === "new";
    places.set(control, { left, top, movedAt: moved ? now : (before?.movedAt ?? -Infinity) });
  }
}
