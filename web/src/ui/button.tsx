// A button with a text.

import type { ButtonHTMLAttributes, ComponentChildren } from "preact";

/** A button of an action; or a quiet one, without a border. Outside of a form it submits nothing. */
export function Button(
  props: ButtonHTMLAttributes<HTMLButtonElement> & {
    text: ComponentChildren;
    quiet?: boolean;
    primary?: boolean;
    destructive?: boolean;
  },
) {
  const { text, quiet, primary, destructive, ...attributes } = props;
  const kind = `${quiet ? "quiet" : "action"}${primary ? " primary" : ""}${destructive ? " destructive" : ""}`;
  return (
    <button class={kind} {...attributes}>
      {text}
    </button>
  );
}
