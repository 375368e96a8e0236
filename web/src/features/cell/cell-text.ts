// Places, shapes and changes of a cell in words.

import type { CellChange, CellFixture, CellFloor, Vector3 } from "../../gen/robomesh_pb";
import { CellChange_Kind as Kind } from "../../gen/robomesh_pb";
import { cellText as c } from "../../i18n/texts";
import { numberText } from "../../ui/inputs/number-text";

/** The unit in which people read and type a quantity, and its factor from SI. */
export const UNITS = { length: { unit: "mm", factor: 1000 }, angle: { unit: "°", factor: 180 / Math.PI } } as const;
export type Quantity = keyof typeof UNITS;

export function kindText({ shape }: CellFixture): string {
  return shape.case === "mesh" ? c("mesh_kind") : shape.case ? c(shape.case) : "";
}

export function placeText({ xyz }: CellFixture): string {
  return vectorText(xyz, "length");
}

export function vectorText(vector: Vector3 | undefined, quantity: Quantity): string {
  const { x = 0, y = 0, z = 0 } = vector ?? {};
  const { unit, factor } = UNITS[quantity];
  return `${[x, y, z].map((each) => numberText(Math.round(each * factor * 10) / 10)).join(", ")} ${unit}`;
}

export function floorText(floor: CellFloor | undefined): string {
  if (!floor || floor.none) return c("no_floor");
  return floor.height === undefined ? c("lowest_base") : lengthText(floor.height);
}

export function lengthText(metres: number): string {
  return `${numberText(Math.round(metres * UNITS.length.factor * 10) / 10)} ${UNITS.length.unit}`;
}

/** Return a change in words; numbers are as in the site file. */
export function changeText(change: CellChange): string {
  const name = change.fixture || c("floor");
  if (change.kind === Kind.ADDED) return c("change_added", { name });
  if (change.kind === Kind.REMOVED) return c("change_removed", { name });
  const minus = (text: string) => text.replaceAll(/-(?=[\d.])/g, "−");
  return c("change_value", { name, key: change.key, before: minus(change.before), after: minus(change.after) });
}
