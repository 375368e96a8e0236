// The gizmo at the ghost's tool: dragging it sets the pose to teach.

import { effect, signal } from "@preact/signals";
import { Group, Matrix4, Object3D } from "three";
import { makeGizmo } from "../../scene/parts/gizmo";
import type { Stage } from "../../scene/robot-scene";
import { taughtPose, teachPose } from "./taught-pose";

/** What dragging does; off: hidden. */
export const gizmoMode = signal<"off" | "translate" | "rotate">("off");

/** Add the gizmo to a scene; the returned function removes it. */
export function addGizmo(stage: Stage): () => void {
  const ending = new AbortController();
  const controls = makeGizmo(stage.camera(), stage.canvas, ending.signal);
  const helper = controls.getHelper();
  const inBase = new Group();
  const tool = new Object3D();
  inBase.matrixAutoUpdate = false;
  inBase.add(tool);
  // Each view has its own camera, which the gizmo must use for its size and its drags.
  const update = helper.updateMatrixWorld.bind(helper);
  helper.updateMatrixWorld = (force) => {
    controls.camera = stage.camera();
    update(force);
  };
  stage.scene.add(inBase, helper);

  controls.addEventListener("change", stage.changed);
  controls.addEventListener("dragging-changed", ({ value }) => {
    stage.controls().enabled = value !== true;
  });
  controls.addEventListener("objectChange", () => {
    tool.updateMatrix();
    teachPose(tool.matrix.clone().transpose().elements);
  });
  const end = effect(() => {
    const pose = taughtPose.value;
    const mode = gizmoMode.value;
    if (!pose || mode === "off") controls.detach();
    else {
      inBase.matrix.copy(stage.base());
      inBase.matrixWorldNeedsUpdate = true;
      // During a drag, keep the dragged pose.
      if (!controls.dragging)
        new Matrix4().fromArray(pose).transpose().decompose(tool.position, tool.quaternion, tool.scale);
      controls.setMode(mode);
      if (controls.object !== tool) controls.attach(tool);
    }
    stage.canvas.dataset.gizmo = controls.object ? mode : "";
    stage.changed();
  });
  return () => {
    end();
    ending.abort();
    controls.detach();
    controls.dispose();
    stage.scene.remove(inBase, helper);
  };
}
