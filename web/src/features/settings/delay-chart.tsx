// Delays from a publisher to the watch: a line a hop, on one scale.

import type { MeshState_Hop as Hop } from "../../gen/robomesh_pb";
import { settingsText as s } from "../../i18n/texts";
import { milliseconds } from "./process-row";

export function DelayChart({ hops }: { hops: readonly Hop[] }) {
  const ways = [...Map.groupBy(hops, ({ key }) => key)];
  const longest = Math.max(...hops.map(({ p99S }) => p99S), 1e-6);
  const share = (seconds: number) => `${(100 * Math.max(0, seconds)) / longest}%`;
  return (
    <figure class="hops">
      <figcaption>
        {s("hops")} <span class="dim">{s("hops_words", { value: milliseconds(longest) })}</span>
      </figcaption>
      {ways.map(([key, way]) => (
        <div key={key} class="way">
          <span class="break">{key.replace(/^robomesh\//, "")}</span>
          <ol class="small">
            {way.map((hop, i) => (
              <li key={i}>
                <span>{s("hop", { sender: hop.sender, receiver: hop.receiver })}</span>
                <span class="hop-bar" aria-hidden="true">
                  <span class="hop-most" style={{ width: share(hop.p99S) }} />
                  <span style={{ width: share(hop.p50S) }} />
                </span>
                <span>
                  {s("half")} {milliseconds(hop.p50S)}, {s("most")} {milliseconds(hop.p99S)}
                </span>
              </li>
            ))}
          </ol>
        </div>
      ))}
    </figure>
  );
}
