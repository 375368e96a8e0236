// Columns of the D-H table: the row's four parameters, then the joint's limits, speed and acceleration.

import type { NameIn } from "../../../i18n/texts";
import { defineText as d } from "../../../i18n/texts";
import { angleUnit, type Joint, jointUnit, type Range, type Units } from "../description/description";

export type ColumnKey = "a" | "alpha" | "d" | "theta" | "lower" | "upper" | "max_speed" | "max_acceleration";

export interface Column {
  key: ColumnKey;
  /** Path of its value below the joint's, as in the server's problems. */
  path: string;
  group: "dh" | "motion";
  step: number;
  /** Short text of the header. */
  head: () => string;
  /** Full name, for a tooltip and for problems. */
  title: () => string;
}

const parameter = (key: "a" | "alpha" | "d" | "theta", head: string): Column => ({
  ...{ key, path: key, group: "dh", step: 1 },
  head: () => head,
  title: () => d(`dh_${key}`),
});
const motion = (
  key: ColumnKey,
  path: string,
  step: number,
  head: NameIn<"define">,
  title: NameIn<"define">,
): Column => ({
  ...{ key, path, group: "motion", step },
  head: () => d(head),
  title: () => d(title),
});

export const COLUMNS: readonly Column[] = [
  parameter("a", "a"),
  parameter("alpha", "α"),
  parameter("d", "d"),
  parameter("theta", "θ"),
  motion("lower", "limits/0", 1, "head_lower", "lower"),
  motion("upper", "limits/1", 1, "head_upper", "upper"),
  motion("max_speed", "max_speed", 10, "head_speed", "max_speed"),
  motion("max_acceleration", "max_acceleration", 10, "head_acceleration", "max_acceleration"),
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

export function setJointValue(joint: Joint, key: ColumnKey, value: number): void {
  if (key === "lower" || key === "upper") {
    const limits: Range = [...joint.limits];
    limits[key === "lower" ? 0 : 1] = value;
    joint.limits = limits;
  } else {
    joint[key] = value;
  }
}
