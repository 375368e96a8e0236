// Inputs of a cell: numbers in SI, shown in millimetres and degrees.

import type { ComponentChildren } from "preact";
import { useId, useState } from "preact/hooks";
import type { Vector3 } from "../../gen/robomesh_pb";
import { numberText, readNumber } from "../../ui/number-text";
import { TextInput } from "../../ui/text-input";
import { mayEdit } from "./cell-draft";
import { type Quantity, UNITS } from "./cell-text";

export function Fields(props: { label: string; children: ComponentChildren }) {
  return (
    <fieldset class="cell-fields">
      <legend>{props.label}</legend>
      <div class="cell-numbers-row">{props.children}</div>
    </fieldset>
  );
}

type Axis = "x" | "y" | "z";
const AXES: readonly Axis[] = ["x", "y", "z"];

export function Vector(props: {
  label: string;
  quantity: Quantity;
  positive?: boolean;
  value: Vector3 | undefined;
  set: (axis: Axis, value: number) => void;
}) {
  return (
    <Fields label={props.label}>
      {AXES.map((axis) => (
        <NumberInput
          key={axis}
          label={axis}
          quantity={props.quantity}
          positive={props.positive ?? false}
          value={props.value?.[axis] ?? 0}
          set={(value) => props.set(axis, value)}
        />
      ))}
    </Fields>
  );
}

/** A number in SI, entered in the unit of its quantity. Arrow keys step it; invalid text stays, marked, until it is
 * corrected or given up with Escape. */
export function NumberInput(props: {
  label: string;
  quantity: Quantity;
  positive?: boolean;
  value: number;
  set: (value: number) => void;
}) {
  const id = useId();
  const [typed, setTyped] = useState<string | null>(null);
  const { unit, factor } = UNITS[props.quantity];
  const value = props.value * factor;
  const valid = (text: string) => {
    const value = readNumber(text);
    return value === null || (props.positive && value <= 0) ? null : value;
  };
  const wrong = typed !== null && valid(typed) === null;
  return (
    <span class={`cell-number ${wrong ? "wrong" : ""}`}>
      <label for={id}>{props.label}</label>
      <TextInput
        id={id}
        inputMode="decimal"
        aria-invalid={wrong}
        disabled={!mayEdit.value}
        value={typed ?? numberText(Math.round(value * 1e3) / 1e3)}
        set={(text) => {
          setTyped(text);
          const value = valid(text);
          if (value !== null) props.set(value / factor);
        }}
        onBlur={() => !wrong && setTyped(null)}
        onKeyDown={(event) => {
          const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
          if (event.key === "Escape" || (event.key === "Enter" && !wrong)) setTyped(null);
          if (!direction) return;
          event.preventDefault();
          setTyped(null);
          const stepped = value + (event.shiftKey ? 10 : 1) * direction;
          if (!props.positive || stepped > 0) props.set(stepped / factor);
        }}
      />
      <span class="dim">{unit}</span>
    </span>
  );
}
