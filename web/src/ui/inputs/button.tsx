// A button with a text.

import type { ButtonHTMLAttributes } from "preact";

/** A button of an action; or a quiet one, without a border. In a form, name its `type`: by default it submits. */
export function Button(
  props: ButtonHTMLAttributes<HTMLButtonElement> & {
    text: string;
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
