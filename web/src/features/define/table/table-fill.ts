// Values of a pasted table into the description's joints.

import type { Description, JointType } from "../description/description";
import { linkNames } from "../description/description";
import { insertJoint, renameJoint, setType } from "../description/edits";
import type { ColumnKey } from "./dh-columns";
import { COLUMNS, setJointValue } from "./dh-columns";
import type { ReadTable } from "./table-text";

/** How a table's rows place the joints: standard (distal), or modified (Craig), whose a and α belong before the joint. */
export const CONVENTIONS = ["standard", "modified"] as const;
export type Convention = (typeof CONVENTIONS)[number];

/** Return the type of each row's joint, before the table is filled. */
export function typesFrom(of: Description, start: number): readonly (JointType | undefined)[] {
  return of.joint.slice(start).map(({ type }) => type);
}

/** Fill the joints from `start` on, adding joints at the end where the table has more rows.
 *
 * A modified table begins with the first joint: `Rot(x, α) Trans(a, 0, 0)` of its first row becomes the base's
 * pose, and that of each other row ends the row before. The same positions then give the same places. */
export function fillJoints(of: Description, table: ReadTable, start: number, convention: Convention): void {
  const first = convention === "modified" ? 0 : start;
  table.rows.forEach(({ name, type, values }, index) => {
    const at = first + index;
    const joint = of.joint[at] ?? insertJoint(of, of.joint.length);
    if (type && type !== joint.type) setType(of, at, type);
    for (const { key } of COLUMNS) {
      const value = values[key];
      if (value !== undefined && !(convention === "modified" && isBefore(key))) setJointValue(joint, key, value);
    }
    const taken = [...linkNames(of), ...of.joint.map((each) => each.name), "tool"];
    if (name && name !== joint.name && !taken.includes(name)) renameJoint(of, at, name);
    joint.home = Math.max(joint.limits[0], Math.min(joint.limits[1], joint.home));
  });
  if (convention === "modified") shiftRows(of, table);
}

function isBefore(key: ColumnKey): boolean {
  return key === "a" || key === "alpha";
}

function shiftRows(of: Description, { rows }: ReadTable): void {
  if (!rows.some(({ values }) => values.a !== undefined || values.alpha !== undefined)) return;
  const { a, alpha } = rows[0]?.values ?? {};
  if (a !== undefined) of.base.pose.xyz = [a, 0, 0];
  if (alpha !== undefined) of.base.pose.rpy = [alpha, 0, 0];
  rows.forEach((_, index) => {
    const next = rows[index + 1]?.values;
    const joint = of.joint[index];
    if (!joint) return;
    for (const key of ["a", "alpha"] as const) {
      const has = rows.some(({ values }) => values[key] !== undefined);
      // The last row's frame is its joint's: nothing follows it, unless a joint that stays does.
      if (next) joint[key] = next[key] ?? joint[key];
      else if (has && index + 1 === of.joint.length) joint[key] = 0;
    }
  });
}
