// Signals of the robot: what its controller reports in addition to joints, by the first word of their names.

import { useState } from "preact/hooks";
import type { Description, Signal, Signals } from "../../../gen/robomesh_pb";
import { ageText } from "../../../i18n/format";
import { groupOf, groupRank, groupTitle, signalText, signalValue } from "../../../i18n/signals";
import { signalsText as sg } from "../../../i18n/texts";
import { ageOf, isStale } from "../../../mesh/state/staleness";
import type { Latest } from "../../../mesh/state/topics";
import { Age } from "../../../ui/marks/state";
import { Unit } from "../../../ui/marks/unit";
import "./signal-list.css";

/** Groups with more signals are closed at first. */
const MOST_OPEN = 8;

export function SignalList(props: { signals: Latest<Signals>; description: Description | undefined }) {
  const { signals, description } = props;
  const [turned, setTurned] = useState<ReadonlySet<string>>(new Set());
  const age = ageOf(signals);
  const stale = isStale("signals", age);
  const groups = [...Map.groupBy(signals.message.signals, ({ name }) => groupOf(name))].sort(
    ([a], [b]) => groupRank(a) - groupRank(b) || a.localeCompare(b),
  );
  const turn = (group: string) => {
    const next = new Set(turned);
    if (!next.delete(group)) next.add(group);
    setTurned(next);
  };
  return (
    <div
      class={`signal-list grow scroll small pad-0-16-8 ${stale ? "stale" : ""}`}
      tabIndex={0}
      role="group"
      aria-label={sg("signals")}
    >
      <p class="signal-age">
        <Age stale={stale} age={age} />
      </p>
      {groups.map(([group, some]) => {
        const open = some.length <= MOST_OPEN !== turned.has(group);
        return (
          <section key={group}>
            <button
              type="button"
              class="quiet signal-group row wide bold left gap-8"
              aria-expanded={open}
              onClick={() => turn(group)}
            >
              <span aria-hidden="true">{open ? "▾" : "▸"}</span>
              {sg("group", { group: groupTitle(group), count: some.length })}
            </button>
            {open && (
              <dl>
                {some.map((each) => (
                  <Row key={each.name} signal={each} age={age} description={description} />
                ))}
              </dl>
            )}
          </section>
        );
      })}
    </div>
  );
}

function Row(props: { signal: Signal; age: number | null; description: Description | undefined }) {
  const { signal, age, description } = props;
  const { text, unit } = signalValue(signal);
  // A value that the controller reports less often is older than its message.
  const own = age === null ? null : age + (signal.ageS ?? 0);
  const stale = isStale("signals", own);
  const on = signal.value.case === "on" && signal.value.value;
  return (
    <div
      class="flex spread narrow gap-8"
      title={own === null || !stale ? signal.name : `${signal.name}: ${ageText(own)}`}
    >
      <dt class="dim break">{signalText(signal.name, description)}</dt>
      <dd class={`break right ${stale ? "stale" : ""} ${on ? "bold" : ""}`}>
        {text}
        {unit && <Unit of={unit} />}
      </dd>
    </div>
  );
}
