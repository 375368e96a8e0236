// A description's cameras: its own, and top, front and left derived from the arm's reach.

import { Vector3 } from "three";
import type { CameraPose } from "../../../scene/canvas/viewpoint";
import type { Description, Triple, View } from "../description/description";
import { metres, tidy } from "../description/description";
import { reach } from "./placements";

export const USUAL_VIEWS = ["top", "front", "left"] as const;
// Size for an arm without lengths.
const LEAST_M = 0.4;

/** Return the arm's size for drawing [m]. */
export function sizeOf(description: Description, shapes = 0): number {
  return Math.max(reach(description), shapes, LEAST_M);
}

/** Return the camera of a named view; of the free one if the description does not have it. */
export function cameraOf(name: string, description: Description, size: number): CameraPose {
  const one = metres(description.units);
  const given = description.view[name];
  if (given) {
    const point = (values: Triple) => new Vector3(...values).multiplyScalar(one);
    return {
      eye: point(given.eye),
      target: point(given.target),
      up: new Vector3(...given.up),
      flat: given.projection === "orthographic",
    };
  }
  const target = new Vector3(0, 0, 0.45 * size);
  const directions: Record<string, Triple> = { top: [0, 0, 1], front: [1, 0, 0], left: [0, 1, 0] };
  const direction = directions[name];
  if (!direction) {
    const eye = target.clone().add(new Vector3(1.2, -1.69, 0.72).multiplyScalar(1.02 * size));
    return { eye, target, up: new Vector3(0, 0, 1), flat: false };
  }
  const eye = target.clone().addScaledVector(new Vector3(...direction), 3 * size);
  return { eye, target, up: name === "top" ? new Vector3(0, 1, 0) : new Vector3(0, 0, 1), flat: true };
}

/** Return a camera as a view of the description, rounded. */
export function viewOf({ eye, target, up, flat }: CameraPose, description: Description): View {
  const one = metres(description.units);
  const point = (at: Vector3) => at.toArray().map((value) => tidy(Math.round(value * 1e4) / 1e4 / one)) as Triple;
  return {
    eye: point(eye),
    target: point(target),
    up: up.toArray().map((value) => tidy(Math.round(value * 1e6) / 1e6)) as Triple,
    projection: flat ? "orthographic" : "perspective",
  };
}
