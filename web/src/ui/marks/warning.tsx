// A warning: its shape, then its words.

import type { ComponentChildren } from "preact";

export function Warning(props: {
  as?: "p" | "span" | "div" | "strong" | "li";
  class: string;
  role?: "alert" | "status";
  text: ComponentChildren;
}) {
  const { as: Element = "p", text, ...attributes } = props;
  return (
    <Element {...attributes}>
      <span class="shape warning" aria-hidden="true" />
      {text}
    </Element>
  );
}
