// Messages of a robot's page: they appear and disappear over the 3-D view, so that no control moves.

import type { ComponentChildren } from "preact";

export function Messages({ children }: { children: ComponentChildren }) {
  return <div class="messages">{children}</div>;
}
