// Columns of the D-H table: the row's four parameters, then the joint's limits, speed and acceleration.

import { d } from "../../i18n/define";
import { angleUnit, type Joint, jointUnit, type Range, type Units } from "./description";

export type ColumnKey = "a" | "alpha" | "d" | "theta" | "lower" | "upper" | "max_speed" | "max_acceleration";

export interface Column {
  key: ColumnKey;
  /** Path of its value below the joint's, as in the server's problems. */
  path: string;
  group: "row" | "motion";
  step: number;
  /** Short text of the header. */
  head: () => string;
  /** Full name, for a tooltip and for problems. */
  title: () => string;
}

function symbol(key: "a" | "alpha" | "d" | "theta", head: string): Column {
  return { key, path: key, group: "row", step: 1, head: () => head, title: () => d(`dh_${key}`) };
}

export const COLUMNS: readonly Column[] = [
  symbol("a", "a"),
  symbol("alpha", "α"),
  symbol("d", "d"),
  symbol("theta", "θ"),
  { key: "lower", path: "limits/0", group: "motion", step: 1, head: () => d("head_lower"), title: () => d("lower") },
  { key: "upper", path: "limits/1", group: "motion", step: 1, head: () => d("head_upper"), title: () => d("upper") },
  {
    key: "max_speed",
    path: "max_speed",
    group: "motion",
    step: 10,
    head: () => d("head_speed"),
    title: () => d("max_speed"),
  },
  {
    key: "max_acceleration",
    path: "max_acceleration",
    group: "motion",
    step: 10,
    head: () => d("head_acceleration"),
    title: () => d("max_acceleration"),
  },
];

export const COLUMN = Object.fromEntries(COLUMNS.map((column) => [column.key, column])) as Record<ColumnKey, Column>;

/** Return the unit of a joint's value in a column. */
export function columnUnit({ key }: Pick<Column, "key">, { type }: Pick<Joint, "type">, units: Units): string {
  switch (key) {
    case "a":
    case "d":
      return units.length;
    case "alpha":
    case "theta":
      return angleUnit(units);
    case "max_speed":
      return `${jointUnit(type, units)}/s`;
    case "max_acceleration":
      return `${jointUnit(type, units)}/s²`;
    default:
      return jointUnit(type, units);
  }
}

export function jointValue(joint: Joint, key: ColumnKey): number {
  if (key === "lower") return joint.limits[0];
  if (key === "upper") return joint.limits[1];
  return joint[key];
}

export function setJointValue(joint: Joint, key: ColumnKey, value: number): void {
  if (key === "lower" || key === "upper") {
    const limits: Range = [...joint.limits];
    limits[key === "lower" ? 0 : 1] = value;
    joint.limits = limits;
  } else {
    joint[key] = value;
  }
}
