// Choice of plotted values by topic.

import { useState } from "preact/hooks";
import type { NameIn } from "../i18n/texts";
import { recordingsText as r } from "../i18n/texts";
import { labelOf } from "../i18n/units";
import { TextInput } from "../ui/inputs/text-input";
import "./value-choice.css";

/** The most wanted values, by topic. */
const GROUPS: Partial<Record<string, NameIn<"recordings">>> = {
  joints: "joints",
  kinematics: "tool_and_margins",
  signals: "signals",
  controller: "controller",
  lease: "control",
  program: "program",
};
const rank = (topic: string) => Object.keys(GROUPS).indexOf(topic) + 1 || 99;
const topicOfValue = (value: string) => value.split("/")[0] ?? "";

export function ValueChoice(props: {
  known: readonly string[];
  chosen: readonly string[];
  most: number;
  choose: (chosen: readonly string[]) => void;
  /** A value's words, without its topic. */
  text?: (value: string) => string;
  unit?: (value: string) => string;
}) {
  const { known, chosen, most } = props;
  const [filter, setFilter] = useState("");
  const searchText = filter.trim().toLowerCase();
  const textOf = props.text ?? ((value: string) => labelOf(value, "").replaceAll("_", " "));
  const words = searchText.split(/\s+/);
  const shown = known.filter((value) => {
    const text = `${value} ${textOf(value)}`.toLowerCase();
    return words.every((word) => text.includes(word));
  });
  const full = chosen.length >= most;
  const turn = (value: string) =>
    props.choose(chosen.includes(value) ? chosen.filter((each) => each !== value) : [...chosen, value]);
  return (
    <div class="values pad-0-16-8">
      <div class="values-head row gap-16">
        <TextInput type="search" hint={r("values_filter")} value={filter} set={setFilter} />
        {full && <span class="dim small">{r("values_many", { count: most })}</span>}
      </div>
      <div class="values-groups flex wrap scroll gap-8-24">
        {[...Map.groupBy(shown, topicOfValue)]
          .sort(([a], [b]) => rank(a) - rank(b))
          .map(([topic, values]) => (
            <fieldset key={topic}>
              <legend class="dim small">{GROUPS[topic] ? r(GROUPS[topic]) : topic}</legend>
              {values.map((value) => {
                const on = chosen.includes(value);
                return (
                  <label key={value} title={value}>
                    <input type="checkbox" checked={on} disabled={!on && full} onChange={() => turn(value)} />
                    {textOf(value)}
                    {props.unit?.(value) && <span class="dim small">{props.unit(value)}</span>}
                  </label>
                );
              })}
            </fieldset>
          ))}
      </div>
    </div>
  );
}
