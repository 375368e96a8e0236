// Form fields: numbers with units, texts, choices; each has its path in the description.

import type { ComponentChildren } from "preact";
import { useId } from "preact/hooks";
import { defineText as d } from "../../../i18n/texts";
import { NumberInput } from "../../../ui/inputs/number-input";
import { Select } from "../../../ui/inputs/select";
import { TextInput } from "../../../ui/inputs/text-input";
import { Warning } from "../../../ui/marks/warning";
import { angleUnit } from "../description/description";
import { invalidNumbers, problemsAt, setInvalidNumber } from "./checks";
import { draft, endUndoStep, setValue, valueAt } from "./draft";

interface Place {
  /** Its path in the description, as in the server's problems: "joint/2/limits/0". */
  path: string;
  label: string;
  /** Show the label to screen readers only: a column's head or the row shows it. */
  quiet?: boolean;
}

function Labelled(
  props: Place & { id: string; kind?: string; isWrong: boolean; hint?: string; children: ComponentChildren },
) {
  return (
    <span class={`field ${props.kind ?? ""} ${props.quiet ? "quiet-label" : ""}`}>
      <label for={props.id}>{props.label}</label>
      <span class={`entry ${props.isWrong ? "wrong" : ""}`}>{props.children}</span>
      {props.hint && <span class="hint">{props.hint}</span>}
    </span>
  );
}

/** A number of the description with its unit, or one that `value` and `set` give. */
export function NumberField(
  props: Place & {
    unit?: string;
    step?: number;
    /** Id of an element with the field's problems in words. */
    describedBy?: string;
    value?: number;
    set?: (value: number) => void;
    onFocus?: () => void;
  },
) {
  const { path } = props;
  const id = useId();
  const wrong = problemsAt(path)[0]?.text ?? "";
  return (
    <Labelled {...props} id={id} kind="number" isWrong={wrong !== ""}>
      <NumberInput
        id={id}
        data-path={path}
        aria-invalid={wrong !== ""}
        aria-describedby={wrong ? props.describedBy : undefined}
        title={wrong}
        step={props.step ?? 1}
        value={props.value ?? Number(valueAt(path) ?? 0)}
        set={props.set ?? ((value) => setValue(path, value))}
        invalid={invalidNumbers.value.get(path)}
        setInvalid={(text) => setInvalidNumber(path, text)}
        end={endUndoStep}
        onFocus={() => props.onFocus?.()}
      />
      {props.unit && <span class="entry-unit rigid small dim">{props.unit}</span>}
    </Labelled>
  );
}

/** A text of the description, or one that `value` and `set` give. */
export function TextField(
  props: Place & { value?: string; set?: (value: string) => void; hint?: string; placeholder?: string },
) {
  const { path } = props;
  const id = useId();
  const [problem] = problemsAt(path);
  return (
    <Labelled {...props} id={id} isWrong={problem !== undefined}>
      <TextInput
        id={id}
        data-path={path}
        value={props.value ?? String(valueAt(path) ?? "")}
        placeholder={props.placeholder ?? ""}
        aria-invalid={problem !== undefined}
        title={problem?.text ?? ""}
        set={props.set ?? ((value) => setValue(path, value))}
        onBlur={endUndoStep}
        onKeyDown={(event) => event.key === "Enter" && endUndoStep()}
      />
    </Labelled>
  );
}

/** A choice; without `set`, of the description's value. */
export function SelectField<Value extends string>(
  props: Place & {
    values: readonly Value[];
    text: (value: Value) => string;
    set?: (value: Value) => void;
  },
) {
  const { path, values, text } = props;
  const id = useId();
  const isWrong = problemsAt(path).length > 0;
  return (
    <Labelled {...props} id={id} isWrong={isWrong}>
      <Select
        id={id}
        data-path={path}
        value={valueAt(path) as Value}
        values={values}
        text={text}
        aria-invalid={isWrong}
        choose={props.set ?? ((value) => setValue(path, value))}
      />
    </Labelled>
  );
}

/** A pose of the description: x, y, z and roll, pitch, yaw, each with its unit. */
export function PoseFields({ path, of }: { path: string; of: string }) {
  const units = draft.value?.description.units;
  if (!units) return null;
  const row = (key: "xyz" | "rpy", labels: readonly string[], unit: string) =>
    labels.map((label, index) => (
      <NumberField key={label} path={`${path}/${key}/${index}`} label={label} unit={unit} />
    ));
  return (
    <div class="pose" role="group" aria-label={of}>
      {row("xyz", ["x", "y", "z"], units.length)}
      {row("rpy", [d("roll"), d("pitch"), d("yaw")], angleUnit(units))}
    </div>
  );
}

export function Section(props: { title: string; end?: ComponentChildren; children: ComponentChildren }) {
  return (
    <section class="section grid gap-8" aria-label={props.title}>
      <div class="row spread tall-32 gap-8">
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
