// Names and values in two columns.

import type { ComponentChildren } from "preact";

export type Fact = [name: string, value: ComponentChildren];

export function Facts({ of: facts }: { of: readonly Fact[] }) {
  return (
    <dl class="setting-facts pad-0-16-12">
      {facts.map(([name, value]) => (
        <div key={name}>
          <dt class="dim">{name}</dt>
          <dd class="break">{value}</dd>
        </div>
      ))}
    </dl>
  );
}
