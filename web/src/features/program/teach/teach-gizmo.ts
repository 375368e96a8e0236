// The gizmo at the ghost's tool: dragging it sets the pose to teach.

import { effect, signal } from "@preact/signals";
import { Group, Matrix4, Object3D } from "three";
import type { Stage } from "../../../scene/parts/stage";
import { addGizmo } from "../../../scene/parts/stage";
import { taughtPose, teachPose } from "../motion/taught-pose";

/** What dragging does; off: hidden. */
export const gizmoMode = signal<"off" | "translate" | "rotate">("off");

/** Add the gizmo to a scene; the returned function removes it. */
export function addTeachGizmo(stage: Stage): () => void {
  const ending = new AbortController();
  const controls = addGizmo(stage, ending.signal);
  const inBase = new Group();
  const tool = new Object3D();
  inBase.matrixAutoUpdate = false;
  inBase.add(tool);
  stage.scene.add(inBase);

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
    stage.scene.remove(inBase);
  };
}
