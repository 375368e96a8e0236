// All D-H rows in an editable table, with the limits, speed and acceleration of each joint.

import { useId } from "preact/hooks";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Warning } from "../../../ui/marks/warning";
import type { Joint } from "../description/description";
import { jointUnit } from "../description/description";
import { problemsAt } from "../draft/checks";
import { draft } from "../draft/draft";
import { NumberField } from "../draft/fields";
import { choosePart, chosenPart } from "../draft/selection";
import { COLUMNS, type Column, columnUnit } from "./dh-columns";
import { isTable, openPasteTable } from "./paste-table";

export function DhTable() {
  const words = useId();
  const now = draft.value;
  if (!now || now.description.joint.length === 0) return null;
  const { joint: joints, units } = now.description;
  const mixed = new Set(joints.map(({ type }) => type)).size > 1;
  const heads = COLUMNS.map((column) => ({
    column,
    units: [...new Set(joints.map((each) => columnUnit(column, each, units)))],
  }));
  return (
    <>
      <div class="dh-head row spread rigid tall-40">
        <h3>{d("dh_head")}</h3>
        <Button quiet text={d("paste_button")} title={d("paste_hint")} onClick={() => openPasteTable()} />
      </div>
      <section
        class="dh-scroll"
        onPaste={(event) => {
          const text = event.clipboardData?.getData("text/plain") ?? "";
          if (!isTable(text)) return;
          event.preventDefault();
          openPasteTable(text, typeof chosenPart.value === "number" ? chosenPart.value : 0);
        }}
        tabIndex={0}
        aria-label={d("dh_table")}
      >
        <table class={`dh-table ${mixed ? "mixed" : ""}`} aria-label={d("dh_table")}>
          <thead>
            <tr>
              <th scope="col">{d("joint")}</th>
              {heads.map(({ column, units: shown }) => (
                <th key={column.key} scope="col" class={column.group} title={column.title()}>
                  {column.head()} <span class="unit">{shown.join(", ")}</span>
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {joints.map((joint, index) => (
              <tr key={index} class={chosenPart.value === index ? "chosen" : ""}>
                <th scope="row">
                  <button
                    class="row-name row spread wide left tall-32 gap-4"
                    title={joint.name}
                    onClick={() => choosePart(index)}
                  >
                    <span>{joint.name || "–"}</span>
                    {problemsAt(`joint/${index}`).length > 0 && <span class="shape warning" aria-hidden="true" />}
                  </button>
                </th>
                {heads.map(({ column, units: shown }) => (
                  <Cell
                    key={column.key}
                    column={column}
                    joint={joint}
                    index={index}
                    unit={columnUnit(column, joint, units)}
                    showUnit={shown.length > 1}
                    words={words}
                  />
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </section>
      <TableProblems id={words} joints={joints} />
    </>
  );
}

function Cell(props: {
  column: Column;
  joint: Joint;
  index: number;
  unit: string;
  /** Whether the rows of this column differ in their units. */
  showUnit: boolean;
  /** Id of the problems in words. */
  words: string;
}) {
  const { column, joint, index, unit } = props;
  const units = draft.value?.description.units;
  const varies = column.key === (joint.type === "rotary" ? "theta" : "d");
  const path = `joint/${index}/${column.path}`;
  return (
    <td
      class={`${column.group} ${varies ? "varies" : ""}`}
      title={varies && units ? d("variable", { unit: jointUnit(joint.type, units) }) : ""}
    >
      <NumberField
        quiet
        path={path}
        label={d("field_of", { field: `${column.head()}, ${unit}`, name: joint.name })}
        describedBy={props.words}
        {...(props.showUnit && { unit })}
        step={/^(m|rad)/.test(unit) && !unit.startsWith("mm") ? 0.01 : column.step}
        onFocus={() => (chosenPart.value = index)}
      />
    </td>
  );
}

/** Problems of the table's cells in words, each with its joint and column. */
function TableProblems({ id, joints }: { id: string; joints: readonly Joint[] }) {
  const found = joints.flatMap((joint, index) =>
    [...new Set(COLUMNS.map(({ path }) => path))].flatMap((path) => {
      const column = COLUMNS.find((each) => each.path === path);
      return problemsAt(`joint/${index}/${path}`)
        .filter(({ path: at }) => at[0] === "joint" && at[1] === index && at.length > 2)
        .map(({ text }) => ({ text, name: joint.name, head: column?.title() ?? "" }));
    }),
  );
  const lines = [...new Map(found.map((each) => [`${each.name} ${each.text}`, each])).values()];
  return (
    <ul id={id} class="dh-problems grid rigid scroll gap-4" aria-label={d("dh_problems")} hidden={lines.length === 0}>
      {lines.map(({ name, head, text }) => (
        <Warning
          key={`${name} ${text}`}
          as="li"
          class="problem-word"
          text={<span>{text.includes(name) ? text : d("cell_problem", { name, head, text })}</span>}
        />
      ))}
    </ul>
  );
}
