// Values of the whole robot: name, source of its dimensions, units.

import { d } from "../../i18n/define";
import type { Units } from "./description";
import { draft, editDraft, endUndoStep } from "./draft";
import { setUnits } from "./edits";
import { ProblemWords, Section, SelectField, TextField } from "./fields";

export function RobotTab() {
  const now = draft.value;
  if (!now) return null;
  const { name, title, title_zh, provenance, provenance_zh, units } = now.description;
  const text = (key: "name" | "title" | "title_zh" | "provenance" | "provenance_zh", value: string, hint = "") => (
    <>
      <TextField
        path={key}
        label={d(key)}
        value={value}
        hint={hint}
        set={(typed) => editDraft(({ description }) => void (description[key] = typed), key)}
      />
      <ProblemWords path={key} />
    </>
  );
  const inUnits = (changed: Partial<Units>) => {
    endUndoStep();
    editDraft(({ description }) => setUnits(description, { ...description.units, ...changed }));
  };
  return (
    <>
      <Section title={d("robot")}>
        {text("name", name, d("name_hint"))}
        {text("title", title)}
        {text("title_zh", title_zh)}
        {text("provenance", provenance, d("provenance_hint"))}
        {text("provenance_zh", provenance_zh)}
      </Section>
      <Section title={d("units")}>
        <div class="grid-2">
          <SelectField
            path="units/length"
            label={d("unit_length")}
            value={units.length}
            values={["mm", "m"]}
            text={(unit) => unit}
            set={(length) => inUnits({ length })}
          />
          <SelectField
            path="units/angle"
            label={d("unit_angle")}
            value={units.angle}
            values={["deg", "rad"]}
            text={(unit) => (unit === "deg" ? "°" : unit)}
            set={(angle) => inUnits({ angle })}
          />
        </div>
        <p class="dim small">{d("units_hint")}</p>
      </Section>
    </>
  );
}
