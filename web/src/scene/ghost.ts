// What the 3-D view shows beside what is: where the arm would stand, the way of its tool, what would touch.
//
// Whoever sets one of these takes it away again when its page or panel goes.

import { signal } from "@preact/signals";

/** A robot at joint positions [rad] or [m], in the description's order. */
export interface Ghost {
  robotKey: string;
  positions: readonly number[];
}

/** Where an arm would stand; null: nowhere. The view that shows that robot draws it. */
export const ghost = signal<Ghost | null>(null);
/** What is drawn red, as pairs of a check name it: `<robot>/<link>`, or a fixture of the cell.
 *
 * A link is red at its ghost; at the robot itself where both stand in the same place. */
export const redLinks = signal<ReadonlySet<string>>(new Set());
/** Points x, y, z of the tool's way in the robot's base frame [m]; null: none is shown. */
export const toolPath = signal<readonly (readonly [number, number, number])[] | null>(null);

/** Shows the arm's ghost at joint positions; null takes it away. */
export function ghostAt(robotKey: string, positions: readonly number[] | null): void {
  ghost.value = positions && { robotKey, positions };
}
