// A table pasted from a spreadsheet: how it is read, a preview, and what cannot be read.

import { signal } from "@preact/signals";
import { useEffect, useId, useMemo, useRef, useState } from "preact/hooks";
import { count } from "../../../i18n/format";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Choice } from "../../../ui/inputs/choice";
import { numberText } from "../../../ui/inputs/number-text";
import { Select } from "../../../ui/inputs/select";
import { Warning } from "../../../ui/marks/warning";
import type { Description } from "../description/description";
import { draft, editDraft } from "../draft/draft";
import { outcome } from "../draft/save-and-start";
import { choosePart } from "../draft/selection";
import { COLUMN, type COLUMNS, columnUnit } from "./dh-columns";
import { CONVENTIONS, type Convention, fillJoints, typesFrom } from "./table-fill";
import type { CellProblem, Delimiter, Meaning, ReadRow, Refusal, TextColumn, TextTable } from "./table-text";
import { DELIMITERS, MEANINGS, MOST_CHARACTERS, MOST_ROWS, readText, readValues } from "./table-text";
import type { DecimalSign } from "./table-units";

/** What is pasted, and into which joint its first row goes; null: the dialog is closed. */
const pasted = signal<{ text: string; start: number } | null>(null);
let opened = 0;
const MOST_PROBLEMS = 6; // that are listed
const SEPARATORS: Record<Delimiter, "by_tab" | "by_semicolon" | "by_bar" | "by_comma" | "by_space"> = {
  "\t": "by_tab",
  ";": "by_semicolon",
  "|": "by_bar",
  ",": "by_comma",
  " ": "by_space",
};

export function openPasteTable(text = "", start = 0): void {
  opened++; // another text begins with nothing chosen
  pasted.value = { text, start };
}

/** Return whether a text has several cells, so that it is no number for one field. */
export function isTable(text: string): boolean {
  return /\t|[\r\n]\s*\S/.test(text.slice(0, MOST_CHARACTERS).trim());
}

export function PasteTable() {
  const now = draft.value;
  if (!pasted.value || !now) return null;
  return <PasteDialog key={opened} description={now.description} {...pasted.value} />;
}

function PasteDialog({ description, text: given, start }: { description: Description; text: string; start: number }) {
  const dialog = useRef<HTMLDialogElement>(null);
  const id = useId();
  const [text, setText] = useState(given);
  const [delimiter, setDelimiter] = useState<Delimiter | null>(null);
  const [sign, setSign] = useState<DecimalSign | null>(null);
  const [length, setLength] = useState<"mm" | "m">(description.units.length);
  const [angle, setAngle] = useState<"deg" | "rad">(description.units.angle);
  const [convention, setConvention] = useState<Convention | null>(null);
  const [meanings, setMeanings] = useState<ReadonlyMap<number, Meaning>>(new Map());
  // Not modal: the stop button must stay free.
  useEffect(() => dialog.current?.show(), []);
  const table = useMemo(() => (text.trim() ? readText(text, delimiter) : null), [text, delimiter]);
  const refused = table && "refused" in table ? table : null;
  const found = table && "columns" in table ? table : null;
  const columns = found?.columns.map((column, index) => ({
    ...column,
    meaning: meanings.get(index) ?? column.meaning,
  }));
  const chosen = convention ?? (found?.modified ? "modified" : "standard");
  const first = chosen === "modified" ? 0 : start;
  const reading = { decimal: sign ?? found?.decimal.sign ?? ("." as const), length, angle };
  const read =
    found && columns && readValues({ ...found, columns }, reading, description.units, typesFrom(description, first));
  const close = () => void (pasted.value = null);
  const setTable = (value: string) => {
    setText(value);
    setDelimiter(null);
    setSign(null);
    setMeanings(new Map());
  };
  const values = read?.rows.reduce((sum, { values: each }) => sum + Object.keys(each).length, 0) ?? 0;
  const fill = () => {
    if (!read || values === 0) return;
    editDraft((own) => fillJoints(own.description, read, first, chosen));
    choosePart(first);
    const rows = d(read.rows.length === 1 ? "paste_filled_one" : "paste_filled", { count: read.rows.length });
    const left = read.problems.length ? ` ${d("paste_left", { count: read.problems.length })}` : "";
    outcome.value = { kind: "done", text: rows + left };
    close();
  };
  return (
    <dialog
      ref={dialog}
      class="paste-dialog stack panel"
      aria-labelledby={id}
      onKeyDown={(event) => event.key === "Escape" && close()}
    >
      <div class="panel-head">
        <h2 id={id}>{d("paste_title")}</h2>
        <button class="quiet panel-end" onClick={close}>
          {d("close")}
        </button>
      </div>
      <div class="paste-body grid scroll gap-12">
        <PasteText text={text} set={setTable} refused={refused} />
        {found && columns && read && (
          <>
            <div class="paste-choices flex wrap gap-8-24">
              <Labelled label={d("paste_separator")}>
                <Select
                  label={d("paste_separator")}
                  value={found.delimiter}
                  values={DELIMITERS}
                  text={(each) => d(SEPARATORS[each])}
                  choose={(each) => {
                    setDelimiter(each);
                    setMeanings(new Map());
                  }}
                />
              </Labelled>
              {(!found.decimal.sure || reading.decimal === "," || sign) && (
                <LabelledChoice
                  title={d(found.decimal.sure ? "paste_decimal" : "paste_decimal_guess")}
                  label={d("paste_decimal")}
                  values={[".", ","] as const}
                  chosen={reading.decimal}
                  text={(each) => d(each === "." ? "paste_point" : "paste_comma")}
                  choose={setSign}
                />
              )}
              {lacksUnit(columns, "length", read.rows) && (
                <LabelledChoice
                  label={d("paste_lengths")}
                  values={["mm", "m"] as const}
                  chosen={length}
                  text={String}
                  choose={setLength}
                />
              )}
              {lacksUnit(columns, "angle", read.rows) && (
                <LabelledChoice
                  label={d("paste_angles")}
                  values={["deg", "rad"] as const}
                  chosen={angle}
                  text={(each) => (each === "deg" ? "°" : "rad")}
                  choose={setAngle}
                />
              )}
              <LabelledChoice
                label={d("paste_convention")}
                values={CONVENTIONS}
                chosen={chosen}
                text={(each) => d(`paste_${each}`)}
                choose={setConvention}
              />
            </div>
            <Preview
              {...{ ...read, columns, table: found, first, description }}
              mean={(index, meaning) => setMeanings(new Map([...meanings, [index, meaning]]))}
            />
            <Result
              {...{ ...read, columns, table: found, first }}
              joints={description.joint.length}
              modified={chosen === "modified"}
            />
          </>
        )}
      </div>
      <div class="flex to-end ruled gap-8 pad-8-16">
        <Button text={d("cancel")} onClick={close} />
        <Button primary text={d("paste_fill")} disabled={values === 0} onClick={fill} />
      </div>
    </dialog>
  );
}

function Labelled(props: { label: string; children: preact.ComponentChildren }) {
  return (
    <div class="paste-choice grid gap-4">
      <span class="label">{props.label}</span>
      {props.children}
    </div>
  );
}

function LabelledChoice<Value extends string>(props: Parameters<typeof Choice<Value>>[0] & { title?: string }) {
  return (
    <Labelled label={props.title ?? props.label}>
      <Choice {...props} />
    </Labelled>
  );
}

/** The field to paste into. A text too long is refused before it is shown, which would take long. */
function PasteText(props: { text: string; set: (text: string) => void; refused: Refusal | null }) {
  const id = useId();
  const [tooLong, setTooLong] = useState(0);
  const take = (text: string) => {
    const long = text.length > MOST_CHARACTERS;
    setTooLong(long ? text.length : 0);
    props.set(long ? "" : text);
    return long;
  };
  const refused = tooLong ? { refused: "too_long" as const, count: tooLong } : props.refused;
  return (
    <div class="paste-text grid gap-4">
      <label for={id}>{d("paste_words")}</label>
      <textarea
        id={id}
        rows={props.text ? 3 : 6}
        spellcheck={false}
        autocomplete="off"
        wrap="off"
        placeholder={"a (mm)\tα (°)\td (mm)\tθ (°)\tmin (°)\tmax (°)\n0\t90\t300\t0\t-150\t150"}
        value={props.text.length > MOST_CHARACTERS ? "" : props.text}
        aria-invalid={refused !== null}
        aria-describedby={`${id}-refused`}
        onPaste={(event) => {
          // A table replaces what is there, at once: the browser's own insertion takes long for many lines.
          const text = event.clipboardData?.getData("text/plain") ?? "";
          if (text.length <= MOST_CHARACTERS && !isTable(text)) return;
          event.preventDefault();
          take(text);
        }}
        onInput={(event) => take(event.currentTarget.value) && (event.currentTarget.value = "")}
      />
      <p id={`${id}-refused`} class="problem-word" role="alert">
        {refused && (
          <>
            <span class="shape warning" aria-hidden="true" />{" "}
            {d(`paste_${refused.refused}`, {
              count: count(refused.count),
              most: count(refused.refused === "too_long" ? MOST_CHARACTERS : MOST_ROWS),
            })}
          </>
        )}
      </p>
    </div>
  );
}

/** Return whether values of a column without a unit are lengths, or angles. */
function lacksUnit(columns: readonly TextColumn[], dimension: "length" | "angle", rows: readonly ReadRow[]): boolean {
  return columns.some(({ meaning, unit }) => {
    if (unit || meaning === "ignored" || meaning === "name" || meaning === "type") return false;
    if (meaning === "a" || meaning === "d") return dimension === "length";
    if (meaning === "alpha" || meaning === "theta") return dimension === "angle";
    return rows.some(({ type }) => (type === "prismatic" ? "length" : "angle") === dimension);
  });
}

function meaningText(meaning: Meaning): string {
  if (meaning === "ignored" || meaning === "limits" || meaning === "name" || meaning === "type")
    return d(`paste_as_${meaning}`);
  return COLUMN[meaning].title();
}

interface Shown {
  columns: readonly TextColumn[];
  table: TextTable;
  rows: readonly ReadRow[];
  problems: readonly CellProblem[];
  first: number;
}

function Preview(props: Shown & { description: Description; mean: (column: number, meaning: Meaning) => void }) {
  const { columns, rows, problems, table, description } = props;
  const wrong = new Set(problems.map(({ row, column }) => `${row} ${column}`));
  const shownValue = (row: ReadRow, index: number, meaning: Meaning) => {
    const joint = description.joint[props.first + index];
    const type = row.type ?? joint?.type ?? "rotary";
    const value = (key: (typeof COLUMNS)[number]["key"]) => {
      const number = row.values[key];
      return number === undefined ? "" : `${numberText(number)} ${columnUnit({ key }, { type }, description.units)}`;
    };
    if (meaning === "name") return row.name ?? "";
    if (meaning === "type") return row.type ? d(row.type) : "";
    if (meaning === "limits") return [value("lower"), value("upper")].filter(Boolean).join(" … ");
    return meaning === "ignored" ? "" : value(meaning);
  };
  return (
    <section class="paste-preview" tabIndex={0} aria-label={d("paste_preview")}>
      <table>
        <thead>
          <tr>
            <th scope="col">{d("joint")}</th>
            {columns.map(({ head, meaning }, index) => (
              <th key={index} scope="col" class={meaning === "ignored" ? "dim" : ""}>
                <span class="paste-head" title={head}>
                  {head || d("paste_column", { number: index + 1 })}
                </span>
                <Select
                  label={d("paste_meaning", { head: head || d("paste_column", { number: index + 1 }) })}
                  value={meaning}
                  values={MEANINGS}
                  text={meaningText}
                  choose={(value) => props.mean(index, value)}
                />
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.map((row, index) => (
            <tr key={row.number}>
              <th scope="row">{props.first + index + 1}</th>
              {columns.map(({ meaning }, column) => {
                const bad = wrong.has(`${row.number} ${column}`);
                const text = table.rows[index]?.cells[column] ?? "";
                return (
                  <td key={column} class={bad ? "bad" : meaning === "ignored" ? "dim" : ""}>
                    {bad && <span class="shape warning" role="img" aria-label={d("paste_unread")} />}
                    {bad || meaning === "ignored" ? text.slice(0, 24) : shownValue(row, index, meaning)}
                  </td>
                );
              })}
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

/** What was read and what was not, in words. */
function Result(props: Shown & { joints: number; modified: boolean }) {
  const { rows, problems, columns, table, first, joints } = props;
  const last = first + rows.length;
  const ignored = columns.filter(({ meaning, head }) => meaning === "ignored" && head).map(({ head }) => `“${head}”`);
  const lines = [
    rows.length === 0
      ? d("paste_no_rows")
      : d(rows.length === 1 ? "paste_read_one" : "paste_read", { count: rows.length, from: first + 1, to: last }),
    ...(last > joints && rows.length
      ? [d(last - joints === 1 ? "paste_added_one" : "paste_added", { count: last - joints })]
      : []),
    ...(last < joints && rows.length
      ? [d(joints - last === 1 ? "paste_stays_one" : "paste_stays", { count: joints - last })]
      : []),
    ...(table.hasHeader ? [] : [d("paste_no_header")]),
    ...(ignored.length ? [d("paste_ignored", { names: ignored.slice(0, MOST_PROBLEMS).join(", ") })] : []),
    ...(table.titles.length
      ? [
          d("paste_titles", {
            rows: table.titles
              .slice(0, MOST_PROBLEMS)
              .map(({ number }) => number)
              .join(", "),
          }),
        ]
      : []),
    ...(props.modified ? [d("paste_modified_words")] : []),
  ];
  return (
    <div class="grid gap-4" role="status">
      {problems.slice(0, MOST_PROBLEMS).map(({ row, column, text }) => {
        const { head = "", meaning = "ignored" } = columns[column] ?? {};
        const name = head || d("paste_column", { number: column + 1 });
        return (
          <Warning
            key={`${row} ${column}`}
            class="problem-word"
            text={d("paste_bad", { row, column: name, text, what: meaningText(meaning) })}
          />
        );
      })}
      {problems.length > MOST_PROBLEMS && (
        <p class="problem-word">{d("paste_bad_more", { count: problems.length - MOST_PROBLEMS })}</p>
      )}
      {lines.map((line) => (
        <p key={line} class="dim small">
          {line}
        </p>
      ))}
    </div>
  );
}
