// A robot's 3-D scene for the parts that other components add: previews, and the gizmo that drags them.

import type { Camera, Matrix4, Scene } from "three";
import type { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { TransformControls } from "three/addons/controls/TransformControls.js";
import type { View } from "../../gen/robomesh_pb";
import { makeGizmo } from "./gizmo";

export interface Stage {
  scene: Scene;
  canvas: HTMLCanvasElement;
  /** The robot's base in the site's frame. */
  base: () => Matrix4;
  /** Current camera and controls: each view replaces them. */
  camera: () => Camera;
  controls: () => OrbitControls;
  /** The current camera as a view for the renderer. */
  view: () => View;
  changed: () => void;
}

/** Add a gizmo that follows the stage's camera, until `signal` aborts. */
export function addGizmo({ scene, canvas, camera, controls, changed }: Stage, signal: AbortSignal): TransformControls {
  const gizmo = makeGizmo(camera(), canvas, signal);
  const helper = gizmo.getHelper();
  const update = helper.updateMatrixWorld.bind(helper);
  helper.updateMatrixWorld = (force) => {
    gizmo.camera = camera(); // for its size and its drags
    update(force);
  };
  gizmo.addEventListener("change", changed);
  gizmo.addEventListener("dragging-changed", ({ value }) => {
    controls().enabled = value !== true;
  });
  scene.add(helper);
  signal.addEventListener("abort", () => {
    gizmo.detach();
    gizmo.dispose();
    scene.remove(helper);
  });
  return gizmo;
}
