// Values of the whole robot: name, source of its dimensions, units.

import { Fragment } from "preact";
import { defineText as d } from "../../../i18n/texts";
import type { Units } from "../description/description";
import { setUnits } from "../description/edits";
import { editDraft } from "../draft/draft";
import { ProblemWords, Section, SelectField, TextField } from "../draft/fields";

const TEXTS = ["name", "title", "title_zh", "provenance", "provenance_zh"] as const;

export function RobotTab() {
  const inUnits = (changed: Partial<Units>) =>
    editDraft(({ description }) => setUnits(description, { ...description.units, ...changed }));
  return (
    <>
      <Section title={d("robot")}>
        {TEXTS.map((key) => (
          <Fragment key={key}>
            <TextField
              path={key}
              label={d(key)}
              hint={key === "name" || key === "provenance" ? d(`${key}_hint`) : ""}
            />
            <ProblemWords path={key} />
          </Fragment>
        ))}
      </Section>
      <Section title={d("units")}>
        <div class="grid-2">
          <SelectField
            path="units/length"
            label={d("unit_length")}
            values={["mm", "m"] as const}
            text={String}
            set={(length) => inUnits({ length })}
          />
          <SelectField
            path="units/angle"
            label={d("unit_angle")}
            values={["deg", "rad"] as const}
            text={(unit) => (unit === "deg" ? "°" : unit)}
            set={(angle) => inUnits({ angle })}
          />
        </div>
        <p class="dim small">{d("units_hint")}</p>
      </Section>
    </>
  );
}
