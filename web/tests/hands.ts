// A person's eyes and hands on what a page shows.

import { act } from "preact/test-utils";
import { vi } from "vitest";

/** Let time pass, for timers, answers and what they draw. */
export const pass = (ms = 50) => act(async () => void (await vi.advanceTimersByTimeAsync(ms)));

/** Return the element that a selector finds. */
export function find<E extends Element = HTMLElement>(selector: string): E {
  const found = document.querySelector<E>(selector);
  if (!found) throw new Error(`no ${selector} in ${document.body.innerHTML}`);
  return found;
}

/** Return the texts of all elements that a selector finds. */
export const texts = (selector: string): string[] =>
  [...document.querySelectorAll(selector)].map((each) => each.textContent.trim());

/** Return the button with a text or name. */
export function button(text: string): HTMLButtonElement {
  const all = [...document.querySelectorAll("button")];
  const found = all.find((each) => each.textContent.trim() === text || each.getAttribute("aria-label") === text);
  if (!found) throw new Error(`no button "${text}" among "${texts("button").join('", "')}"`);
  return found;
}

/** Return the texts of the buttons that can be pressed. */
export const pressable = (): string[] => texts("button:not(:disabled)");

/** Press a button, as a person can: a disabled one does nothing. */
export const press = (text: string) => act(() => button(text).click());

/** Send an event to what a selector finds. */
export const send = (selector: string, event: Event) => act(() => void find(selector).dispatchEvent(event));

/** Replace the text of a field. */
export function type(selector: string, text: string): void {
  find<HTMLInputElement>(selector).value = text;
  send(selector, new Event("input", { bubbles: true }));
}

/** Press a key on what a selector finds. */
export const key = (selector: string, name: string, more: KeyboardEventInit = {}) =>
  send(selector, new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true, ...more }));

/** Submit the shown form, as Enter in one of its fields does. */
export const submit = () => send("form", new Event("submit", { bubbles: true, cancelable: true }));
