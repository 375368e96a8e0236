// A panel with a heading.

import type { ComponentChildren } from "preact";

/** A panel with a heading; `end` is right of the heading. */
export function Panel(props: { title: string; name: string; end?: ComponentChildren; children: ComponentChildren }) {
  return (
    <section class={`panel ${props.name}`} aria-label={props.title}>
      <div class="panel-head">
        <h2>{props.title}</h2>
        <div class="panel-end">{props.end}</div>
      </div>
      {props.children}
    </section>
  );
}
