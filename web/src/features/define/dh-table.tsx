// All D-H rows in an editable table.

import { d } from "../../i18n/define";
import { problemsAt } from "./checks";
import { angleUnit, jointUnit } from "./description";
import { draft, editDraft } from "./draft";
import { NumberField } from "./fields";
import { choosePart, chosenPart } from "./selection";

const COLUMNS = ["a", "alpha", "d", "theta"] as const;
const HEADS = { a: "a", alpha: "α", d: "d", theta: "θ" };

export function DhTable() {
  const now = draft.value;
  if (!now || now.description.joint.length === 0) return null;
  const { joint: joints, units } = now.description;
  const angle = angleUnit(units);
  const unitOf = (column: (typeof COLUMNS)[number]) => (column === "a" || column === "d" ? units.length : angle);
  return (
    <table class="dh-table" aria-label={d("dh_table")}>
      <thead>
        <tr>
          <th scope="col">{d("joint")}</th>
          {COLUMNS.map((column) => (
            <th key={column} scope="col">
              {HEADS[column]} <span class="unit">{unitOf(column)}</span>
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {joints.map((joint, index) => (
          <tr key={index} class={chosenPart.value === index ? "chosen" : ""}>
            <th scope="row">
              <button class="row-name" onClick={() => choosePart(index)}>
                {joint.name || "–"}
                {problemsAt(`joint/${index}`).length > 0 && <span class="shape warning" aria-hidden="true" />}
              </button>
            </th>
            {COLUMNS.map((column) => {
              const varies = column === (joint.type === "rotary" ? "theta" : "d");
              return (
                <td
                  key={column}
                  class={varies ? "varies" : ""}
                  title={varies ? d("variable", { unit: jointUnit(joint.type, units) }) : ""}
                >
                  <NumberField
                    quiet
                    path={`joint/${index}/${column}`}
                    label={d("field_of", { field: HEADS[column], name: joint.name })}
                    value={joint[column]}
                    step={unitOf(column) === "m" || unitOf(column) === "rad" ? 0.01 : 1}
                    onFocus={() => (chosenPart.value = index)}
                    set={(value) =>
                      editDraft(({ description }) => {
                        const row = description.joint[index];
                        if (row) row[column] = value;
                      }, `joint/${index}/${column}`)
                    }
                  />
                </td>
              );
            })}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
