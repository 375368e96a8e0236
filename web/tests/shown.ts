// Components and hooks in a document, without a browser.

import type { ComponentChild } from "preact";
import { h, render } from "preact";
import { act } from "preact/test-utils";
import { onTestFinished } from "vitest";

/** Show a component in the document until the test ends; shown in an element that it was in, it is drawn again. */
export function show(vnode: ComponentChild, within?: HTMLElement): HTMLElement {
  const place = within ?? document.body.appendChild(document.createElement("div"));
  act(() => render(vnode, place));
  if (!within) onTestFinished(() => hide(place));
  return place;
}

/** Remove a shown component. */
export function hide(place: HTMLElement): void {
  act(() => render(null, place));
  place.remove();
}

/** Use a hook in a component; `result` is what it returned last, and `draw` draws it again with other arguments. */
export function use<Given extends unknown[], Result>(hook: (...given: Given) => Result, ...first: Given) {
  const Using = ({ given }: { given: Given }) => {
    used.result = hook(...given);
    return null;
  };
  const place = show(null);
  const draw = (...given: Given) => void show(h(Using, { given }), place);
  const used = { result: undefined as Result, draw, end: () => hide(place) };
  draw(...first);
  return used;
}
