// Choice of plotted values by topic.

import { useState } from "preact/hooks";
import type { RecordingsText } from "../../i18n/recordings";
import { r } from "../../i18n/recordings";
import { labelOf } from "./units";

/** The most wanted values, by topic. */
const GROUPS: Partial<Record<string, RecordingsText>> = {
  joints: "joints",
  kinematics: "tool_and_margins",
  controller: "controller",
};
const rank = (topic: string) => Object.keys(GROUPS).indexOf(topic) + 1 || 99;
const topicOfValue = (value: string) => value.split("/")[0] ?? "";

export function ValueChoice(props: {
  known: readonly string[];
  chosen: readonly string[];
  most: number;
  choose: (chosen: readonly string[]) => void;
}) {
  const { known, chosen, most } = props;
  const [filter, setFilter] = useState("");
  const searchText = filter.trim().toLowerCase();
  const shown = known.filter((value) => value.toLowerCase().includes(searchText));
  const full = chosen.length >= most;
  const turn = (value: string) =>
    props.choose(chosen.includes(value) ? chosen.filter((each) => each !== value) : [...chosen, value]);
  return (
    <div class="values">
      <div class="values-head">
        <input
          type="search"
          placeholder={r("values_filter")}
          aria-label={r("values_filter")}
          value={filter}
          onInput={(event) => setFilter(event.currentTarget.value)}
        />
        {full && <span class="dim small">{r("values_many", { count: most })}</span>}
      </div>
      <div class="values-groups">
        {[...Map.groupBy(shown, topicOfValue)]
          .sort(([a], [b]) => rank(a) - rank(b))
          .map(([topic, values]) => (
            <fieldset key={topic}>
              <legend>{GROUPS[topic] ? r(GROUPS[topic]) : topic}</legend>
              {values.map((value) => {
                const on = chosen.includes(value);
                return (
                  <label key={value} title={value}>
                    <input type="checkbox" checked={on} disabled={!on && full} onChange={() => turn(value)} />
                    {labelOf(value, "").replaceAll("_", " ")}
                  </label>
                );
              })}
            </fieldset>
          ))}
      </div>
    </div>
  );
}
