// Isolation of texts from outside the page: operators' names and reasons, faults, events, file names. None of them
// can change the order in which the text around it is read (CVE-2021-42574). It applies to every rendered text,
// because some call sites would forget it.

import type { ComponentChildren, VNode } from "preact";
import { h, options } from "preact";

/** Bidirectional control characters; a text between FSI and PDI without others in it is already isolated. */
const CONTROLS =
  /(\u2068[^\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]*\u2069)|[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]/g;
const ANY_CONTROL = /[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]/;
/** Right-to-left letters: Hebrew, Arabic, Syriac, Thaana, NKo, Adlam and others of their blocks. */
const FROM_THE_RIGHT = /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefe\u{10800}-\u{10fff}\u{1e800}-\u{1efff}]/u;
const FSI = "\u2068";
const PDI = "\u2069";
/** Elements that hold only text. */
const PLAIN = new Set(["bdi", "option", "textarea", "title", "style", "script", "text", "tspan"]);
const SPOKEN = ["title", "aria-label", "alt", "placeholder"] as const;

/** Return a text with its bidirectional control characters shown as numbers. */
export function shown(text: string): string {
  if (!ANY_CONTROL.test(text)) return text;
  return text.replace(CONTROLS, (found: string, isolated: string | undefined) => isolated ?? numbered(found));
}

/** Isolate the text of another author for use within a sentence. */
export function isolated(text: string): string {
  const plain = text.replace(/[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]/g, numbered);
  return FROM_THE_RIGHT.test(plain) ? FSI + plain + PDI : plain;
}

/** Isolate every text that is rendered from now on. */
export function isolateTexts(): void {
  const before = options.vnode;
  options.vnode = (vnode) => {
    if (typeof vnode.type === "string") isolate(vnode as VNode<Record<string, unknown>>, vnode.type);
    before?.(vnode);
  };
}

function isolate({ props }: VNode<Record<string, unknown>>, type: string): void {
  for (const name of SPOKEN) {
    const text = props[name];
    if (typeof text === "string") props[name] = shown(text);
  }
  props.children = drawn(props.children as ComponentChildren, !PLAIN.has(type));
}

function drawn(children: ComponentChildren, inElement: boolean): ComponentChildren {
  if (Array.isArray(children)) return children.map((each) => drawn(each, inElement));
  if (typeof children !== "string") return children;
  const mixed = ANY_CONTROL.test(children) || FROM_THE_RIGHT.test(children);
  if (!mixed) return children;
  return inElement ? h("bdi", null, shown(children)) : shown(children);
}

function numbered(control: string): string {
  return `<U+${control.charCodeAt(0).toString(16).toUpperCase().padStart(4, "0")}>`;
}
