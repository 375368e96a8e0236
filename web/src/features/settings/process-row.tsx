// One process of the mesh: version, host, age, delay, clock, losses, load.

import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { MeshState, MeshState_Seen as Seen } from "../../gen/robomesh_pb";
import { ageText, count, DASH, fixed, stampFull, whenText } from "../../i18n/format";
import { settingsText as s } from "../../i18n/texts";
import { hello } from "../../mesh/console/connection";
import { isClockOff, isSilent, reportAge } from "../../mesh/state/site-health";
import type { Latest } from "../../mesh/state/topics";
import { Marked } from "./this-console";

export const COLUMNS = [
  "service",
  "age",
  "host",
  "version",
  "round_trip",
  "clock",
  "lost",
  "cpu",
  "memory",
  "started",
] as const;

const MIB = 1024 * 1024;
const LOSS = 0.005; // the watch raises an alarm from here on
const IN_STEP_S = 0.005; // smaller offsets do not matter

export function ProcessRow(props: { of: string; seen: Seen; latest: Latest<MeshState>; goneAt: number | null }) {
  const { seen, latest, goneAt } = props;
  const silent = isSilent(seen, latest);
  const mine = hello.value?.version ?? "";
  const differs = mine !== "" && seen.version !== "" && seen.version !== mine;
  const values = Object.entries(seen.values).sort(([a], [b]) => a.localeCompare(b));
  return (
    <tr class={goneAt !== null || silent ? "gone" : ""}>
      <th scope="row">
        {seen.site !== props.of && <span class="dim">{seen.site}/</span>}
        {seen.service} {seen.robots.length > 0 && <span class="dim small seen-robots">{robotsText(seen.robots)}</span>}
        {values.length > 0 && (
          <details class="seen-values small dim">
            <summary aria-label={s("values", { name: seen.service })}>
              {values.length === 1 ? s("value_one") : s("values_count", { count: values.length })}
            </summary>
            <dl>
              {values.map(([name, value]) => (
                <div key={name} class="flex gap-8">
                  <dt>{name}</dt>
                  <dd>{Number.isInteger(value) ? count(value) : fixed(value, 2)}</dd>
                </div>
              ))}
            </dl>
          </details>
        )}
      </th>
      <td data-column={s("age")}>
        {goneAt !== null ? (
          <Marked wrong>{s("gone", { time: whenText(goneAt) })}</Marked>
        ) : silent ? (
          <Marked wrong>{s("silent", { age: ageText(reportAge(seen, latest)) })}</Marked>
        ) : (
          s("fresh")
        )}
      </td>
      <td data-column={s("host")}>{seen.host || DASH}</td>
      <td data-column={s("version")} title={differs ? s("version_differs", { version: mine }) : ""}>
        <Marked wrong={differs}>{seen.version || DASH}</Marked>
      </td>
      <td data-column={s("round_trip")}>{seen.roundTripS === undefined ? DASH : milliseconds(seen.roundTripS)}</td>
      <td
        data-column={s("clock")}
        title={seen.roundTripS === undefined ? "" : s("give_or_take", { value: milliseconds(seen.roundTripS / 2) })}
      >
        <Marked wrong={isClockOff(seen)}>{clockText(seen)}</Marked>
      </td>
      <td data-column={s("lost")}>
        <Marked wrong={Number(seen.lost) > LOSS * Number(seen.lost + seen.received)}>{lossText(seen)}</Marked>
      </td>
      <td data-column={s("cpu")}>{fixed(seen.cpu * 100, 0)} %</td>
      <td data-column={s("memory")}>{count(Math.round(Number(seen.memoryBytes) / MIB))} MiB</td>
      <td data-column={s("started")} title={stampFull(seen.started)}>
        {seen.started ? forText(timestampMs(seen.started)) : DASH}
      </td>
    </tr>
  );
}

const MOST_NAMED = 3;

function robotsText(robots: readonly string[]): string {
  const named = robots.slice(0, MOST_NAMED).join(", ");
  return robots.length > MOST_NAMED ? `${named} +${robots.length - MOST_NAMED}` : named;
}

export function milliseconds(seconds: number): string {
  return `${fixed(seconds * 1000, seconds < 0.01 ? 2 : seconds < 1 ? 1 : 0)}\u202fms`;
}

function clockText({ clockOffsetS, roundTripS }: Seen): string {
  if (clockOffsetS === undefined) return DASH;
  const off = Math.abs(clockOffsetS);
  if (off < IN_STEP_S || off < (roundTripS ?? 0) / 2) return s("clock_same");
  const value = off < 1 ? milliseconds(off) : off < 100 ? `${fixed(off, 1)}\u202fs` : ageText(off);
  return s(clockOffsetS > 0 ? "clock_ahead" : "clock_behind", { value });
}

function lossText({ lost, received }: Seen): string {
  const all = lost + received;
  if (all === 0n) return DASH;
  if (lost === 0n) return "0";
  const share = (Number(lost) / Number(all)) * 100;
  return `${count(lost)} (${share < 0.01 ? "<0.01" : fixed(share, 2)} %)`;
}

/** Return how long it has been running. */
function forText(startedMs: number): string {
  return ageText(Math.max(0, (Date.now() - startedMs) / 1000));
}
