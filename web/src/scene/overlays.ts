// Overlays of the 3-D view: a ghost of the arm, a path of its tool, colliding parts in red.
//
// The page or panel that sets one of these clears it when it unmounts.

import { signal } from "@preact/signals";

/** A robot at joint positions [rad] or [m], in the description's order. */
export interface Ghost {
  robotKey: string;
  positions: readonly number[];
}

/** The ghost, drawn by the view that shows its robot; null: none. */
export const ghost = signal<Ghost | null>(null);
/** Red parts, named as in a check's pairs: `<robot>/<link>`, or a fixture of the cell.
 *
 * A link's ghost is red, or the link itself if its ghost is not visible. */
export const redLinks = signal<ReadonlySet<string>>(new Set());
/** Points x, y, z of the tool's path in the robot's base frame [m]; null: none. */
export const toolPath = signal<readonly (readonly [number, number, number])[] | null>(null);

/** Show the ghost at joint positions; null hides it. */
export function ghostAt(robotKey: string, positions: readonly number[] | null): void {
  ghost.value = positions && { robotKey, positions };
}
