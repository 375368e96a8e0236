// Preview of a changed cell in the 3-D view, and the gizmo that drags the chosen fixture.
//
// The valid fixtures stay as they are drawn; the preview is blue, translucent, with edges.

import { effect, signal } from "@preact/signals";
import * as THREE from "three";
import type { CellFixture, Description } from "../../gen/robomesh_pb";
import { meshUrl } from "../../scene/parts/arm";
import { loadModel } from "../../scene/parts/models";
import type { Stage } from "../../scene/parts/stage";
import { addGizmo } from "../../scene/parts/stage";
import { palette } from "../../scene/parts/surroundings";
import { changeFixture, chosen, mayEdit, rows } from "./cell-draft";

/** What dragging does; off: hidden. */
export const dragging = signal<"off" | "translate" | "rotate">("off");

const OPACITY = 0.45;
const SIDES = 48;
// Roll, pitch and yaw about fixed axes are yaw, pitch and roll about its own.
const ORDER = "ZYX";
const ROUND_M = 1e-4;
const ROUND_RAD = Math.PI / 1800; // 0.1 degrees

/** Add the preview to a scene; the returned function removes it. */
export function addPreview(stage: Stage, prefix: string, description: Description): () => void {
  const ending = new AbortController();
  const controls = addGizmo(stage, ending.signal);
  controls.setSpace("world");
  const group = new THREE.Group();
  const handle = new THREE.Object3D();
  const meshes = new Map<string, THREE.Group>();
  stage.scene.add(group, handle);

  controls.addEventListener("objectChange", () => {
    const { position, rotation } = handle;
    const angles = new THREE.Euler().setFromQuaternion(handle.quaternion, ORDER);
    changeFixture(chosen.value, (fixture) => {
      if (fixture.xyz && controls.mode === "translate") Object.assign(fixture.xyz, rounded(position, ROUND_M));
      if (fixture.rpy && controls.mode === "rotate") Object.assign(fixture.rpy, rounded(angles, ROUND_RAD));
    });
    rotation.order = ORDER;
  });

  const loadMesh = async (name: string): Promise<void> => {
    const published = description.fixtures.find((each) => each.name === name);
    if (!published || meshes.has(name)) return;
    meshes.set(name, new THREE.Group());
    const url = meshUrl(prefix, published.mesh, published.meshSha256);
    const model = await loadModel(url, () => !ending.signal.aborted).catch(() => null);
    if (!model) return;
    meshes.set(name, model);
    show();
  };

  const show = () => {
    const { accent } = palette();
    for (const child of [...group.children]) {
      group.remove(child);
      child.traverse((part) => {
        if (part instanceof THREE.Mesh && !part.userData.loaded) part.geometry.dispose();
      });
    }
    for (const { fixture, mark } of rows.value) {
      if (mark !== "added" && mark !== "changed") continue;
      if (fixture.shape.case === "mesh") void loadMesh(fixture.name);
      const made = solid(fixture, meshes.get(fixture.name), accent);
      place(made, fixture);
      group.add(made);
    }
    const picked = rows.value.find((each) => each.fixture.name === chosen.value && each.mark !== "removed");
    if (!picked || dragging.value === "off" || !mayEdit.value) controls.detach();
    else {
      // During a drag, keep the dragged pose.
      if (!controls.dragging) place(handle, picked.fixture);
      controls.setMode(dragging.value);
      if (controls.object !== handle) controls.attach(handle);
    }
    stage.canvas.dataset.preview = String(group.children.length);
    stage.canvas.dataset.gizmo = controls.object ? dragging.value : "";
    stage.changed();
  };
  const end = effect(show);
  return () => {
    end();
    ending.abort();
    stage.scene.remove(group, handle);
  };
}

function rounded({ x, y, z }: { x: number; y: number; z: number }, step: number) {
  const round = (value: number) => Math.round(value / step) * step;
  return { x: round(x), y: round(y), z: round(z) };
}

function place(object: THREE.Object3D, { xyz, rpy }: CellFixture): void {
  object.position.set(xyz?.x ?? 0, xyz?.y ?? 0, xyz?.z ?? 0);
  object.setRotationFromEuler(new THREE.Euler(rpy?.x ?? 0, rpy?.y ?? 0, rpy?.z ?? 0, ORDER));
}

/** Return a fixture's shape in the preview's colour. */
function solid({ shape }: CellFixture, loaded: THREE.Group | undefined, colour: string): THREE.Object3D {
  const material = new THREE.MeshStandardMaterial({
    color: colour,
    transparent: true,
    opacity: OPACITY,
    depthWrite: false,
  });
  if (shape.case === "mesh") {
    const copy = loaded?.clone() ?? new THREE.Group();
    copy.traverse((part) => {
      if (!(part instanceof THREE.Mesh)) return;
      part.material = material;
      part.userData.loaded = true;
    });
    return new THREE.Group().add(copy);
  }
  const mesh = new THREE.Mesh(geometry(shape), material);
  mesh.add(
    new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry, 30), new THREE.LineBasicMaterial({ color: colour })),
  );
  return mesh;
}

function geometry(shape: CellFixture["shape"]): THREE.BufferGeometry {
  switch (shape.case) {
    case "box":
      return new THREE.BoxGeometry(shape.value.x, shape.value.y, shape.value.z);
    case "cylinder":
      // Three's cylinder has y as its axis.
      return new THREE.CylinderGeometry(shape.value.radius, shape.value.radius, shape.value.height, SIDES).rotateX(
        Math.PI / 2,
      );
    case "sphere":
      return new THREE.SphereGeometry(shape.value, SIDES, SIDES / 2);
    default:
      return new THREE.BufferGeometry();
  }
}
