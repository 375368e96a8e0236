// A tag: one or two words in a coloured border.

import type { ComponentChildren } from "preact";

export function Tag({ kind, children }: { kind: string; children: ComponentChildren }) {
  return <span class={`tag ${kind}`}>{children}</span>;
}
