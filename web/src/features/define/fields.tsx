// Form fields: numbers with units, texts, choices; each has its path in the description.

import type { ComponentChildren } from "preact";
import { useId, useState } from "preact/hooks";
import { d } from "../../i18n/define";
import { numberText, readNumber } from "../../ui/number-text";
import { Select } from "../../ui/select";
import { TextInput } from "../../ui/text-input";
import { Warning } from "../../ui/warning";
import { invalidNumbers, problemsAt, setInvalidNumber } from "./checks";
import type { Pose, Triple } from "./description";
import { endUndoStep } from "./draft";

interface Place {
  /** Its path in the description, as in the server's problems: "joint/2/limits/0". */
  path: string;
  label: string;
  /** Show the label to screen readers only: a column's head or the row shows it. */
  quiet?: boolean;
}

/** A number with its unit. Arrow keys step it; invalid text stays, marked, until it is corrected or Escape. */
export function NumberField(
  props: Place & {
    value: number;
    unit?: string;
    step?: number;
    /** Id of an element with the field's problems in words. */
    describedBy?: string;
    set: (value: number) => void;
    onFocus?: () => void;
  },
) {
  const id = useId();
  const [being, setBeing] = useState<string | null>(null);
  const typed = invalidNumbers.value.get(props.path) ?? being;
  const setTyped = (text: string | null) => {
    setBeing(text);
    setInvalidNumber(props.path, text !== null && readNumber(text) === null ? text : null);
  };
  const read = typed === null ? props.value : readNumber(typed);
  // Keep the typed text while it has the value; an undo shows the value again.
  const text = typed !== null && (read === null || read === props.value) ? typed : numberText(props.value);
  const problems = problemsAt(props.path);
  const wrong = problems[0]?.text ?? "";
  const onKey = (event: KeyboardEvent) => {
    const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (direction) {
      event.preventDefault();
      setTyped(null);
      const by = (props.step ?? 1) * (event.shiftKey ? 10 : 1) * direction;
      props.set(Math.round((props.value + by) * 1e6) / 1e6);
    } else if (event.key === "Escape" || (event.key === "Enter" && read !== null)) {
      setTyped(null);
      endUndoStep();
    }
  };
  return (
    <span class={`field number ${props.quiet ? "quiet-label" : ""}`}>
      <label for={id}>{props.label}</label>
      <span class={`entry ${wrong ? "wrong" : ""}`}>
        <TextInput
          id={id}
          inputMode="decimal"
          data-path={props.path}
          value={text}
          aria-invalid={wrong !== ""}
          aria-describedby={wrong ? props.describedBy : undefined}
          title={wrong}
          onFocus={() => props.onFocus?.()}
          set={(text) => {
            const value = readNumber(text);
            setTyped(text);
            if (value !== null) props.set(value);
          }}
          onBlur={() => {
            if (read !== null) setTyped(null);
            endUndoStep();
          }}
          onKeyDown={onKey}
        />
        {props.unit && <span class="entry-unit">{props.unit}</span>}
      </span>
    </span>
  );
}

export function TextField(
  props: Place & { value: string; set: (value: string) => void; hint?: string; placeholder?: string },
) {
  const id = useId();
  const problems = problemsAt(props.path);
  return (
    <span class={`field ${props.quiet ? "quiet-label" : ""}`}>
      <label for={id}>{props.label}</label>
      <span class={`entry ${problems.length ? "wrong" : ""}`}>
        <TextInput
          id={id}
          data-path={props.path}
          value={props.value}
          placeholder={props.placeholder ?? ""}
          aria-invalid={problems.length > 0}
          title={problems[0]?.text ?? ""}
          set={props.set}
          onBlur={endUndoStep}
          onKeyDown={(event) => event.key === "Enter" && endUndoStep()}
        />
      </span>
      {props.hint && <span class="hint">{props.hint}</span>}
    </span>
  );
}

export function SelectField<Value extends string>(
  props: Place & {
    value: Value;
    values: readonly Value[];
    text: (value: Value) => string;
    set: (value: Value) => void;
  },
) {
  const id = useId();
  const wrong = problemsAt(props.path).length > 0;
  return (
    <span class={`field ${props.quiet ? "quiet-label" : ""}`}>
      <label for={id}>{props.label}</label>
      <span class={`entry ${wrong ? "wrong" : ""}`}>
        <Select
          id={id}
          data-path={props.path}
          value={props.value}
          values={props.values}
          text={props.text}
          aria-invalid={wrong}
          choose={props.set}
        />
      </span>
    </span>
  );
}

/** A pose: x, y, z and roll, pitch, yaw, each with its unit. */
export function PoseFields(props: {
  path: string;
  of: string;
  pose: Pose;
  length: string;
  angle: string;
  set: (change: (pose: Pose) => void, field: string) => void;
}) {
  const row = (key: "xyz" | "rpy", labels: readonly string[], unit: string) =>
    labels.map((label, index) => (
      <NumberField
        key={label}
        path={`${props.path}/${key}/${index}`}
        label={label}
        value={props.pose[key][index] ?? 0}
        unit={unit}
        set={(value) =>
          props.set((pose) => {
            const values: Triple = [...pose[key]];
            values[index] = value;
            pose[key] = values;
          }, `${key}/${index}`)
        }
      />
    ));
  return (
    <div class="pose" role="group" aria-label={props.of}>
      {row("xyz", ["x", "y", "z"], props.length)}
      {row("rpy", [d("roll"), d("pitch"), d("yaw")], props.angle)}
    </div>
  );
}

export function Section(props: { title: string; end?: ComponentChildren; children: ComponentChildren }) {
  return (
    <section class="section" aria-label={props.title}>
      <div class="section-head">
        <h3>{props.title}</h3>
        {props.end}
      </div>
      {props.children}
    </section>
  );
}

/** Problems of a path, in words. */
export function ProblemWords({ path }: { path: string }) {
  return (
    <>
      {problemsAt(path).map(({ text }) => (
        <Warning key={text} class="problem-word" text={text} />
      ))}
    </>
  );
}
