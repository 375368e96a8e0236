// Gizmo that drags and turns a part of a scene.

import type { Camera } from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";

const STEP_M = 0.01;
const STEP_RAD = Math.PI / 12;

/** Create a gizmo in its part's own frame; with Shift it moves in steps, until `signal` aborts. */
export function makeGizmo(camera: Camera, canvas: HTMLCanvasElement, signal: AbortSignal): TransformControls {
  const gizmo = new TransformControls(camera, canvas);
  gizmo.setSize(0.8);
  gizmo.setSpace("local");
  const snap = (on: boolean) => {
    gizmo.setTranslationSnap(on ? STEP_M : null);
    gizmo.setRotationSnap(on ? STEP_RAD : null);
  };
  addEventListener("keydown", (event) => event.key === "Shift" && snap(true), { signal });
  addEventListener("keyup", (event) => event.key === "Shift" && snap(false), { signal });
  return gizmo;
}
