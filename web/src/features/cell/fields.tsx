// Inputs of a cell: numbers in SI, shown in millimetres and degrees.

import type { ComponentChildren } from "preact";
import { useId } from "preact/hooks";
import type { Vector3 } from "../../gen/robomesh_pb";
import { NumberInput } from "../../ui/inputs/number-input";
import { numberText } from "../../ui/inputs/number-text";
import { mayEdit } from "./cell-draft";
import { type Quantity, UNITS } from "./cell-text";

export function Fields(props: { label: string; children: ComponentChildren }) {
  return (
    <fieldset class="cell-fields pad-4-16-8">
      <legend>{props.label}</legend>
      <div class="cell-numbers-row grid gap-8">{props.children}</div>
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
        <NumberField
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

/** A number in SI, entered in the unit of its quantity. */
export function NumberField(props: {
  label: string;
  quantity: Quantity;
  positive?: boolean;
  value: number;
  set: (value: number) => void;
}) {
  const id = useId();
  const { unit, factor } = UNITS[props.quantity];
  return (
    <span class="cell-number grid small">
      <label for={id}>{props.label}</label>
      <NumberInput
        id={id}
        disabled={!mayEdit.value}
        positive={props.positive ?? false}
        value={props.value * factor}
        format={(value) => numberText(Math.round(value * 1e3) / 1e3)}
        set={(value) => props.set(value / factor)}
      />
      <span class="dim">{unit}</span>
    </span>
  );
}
