// Parts that other components add to a robot's scene, and its surroundings.

import { Color, Group, Matrix4, type Mesh, Object3D, PerspectiveCamera, Scene } from "three";
import type { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { beforeEach, expect, test, vi } from "vitest";
import type { Stage } from "../../../src/scene/parts/stage";
import { addGizmo } from "../../../src/scene/parts/stage";
import { KEY_LIGHT, lights, palette, surround } from "../../../src/scene/parts/surroundings";

let ending: AbortController;
let stage: Stage;
let camera: PerspectiveCamera;
const controls = { enabled: true };
const changed = vi.fn();

beforeEach(() => {
  ending = new AbortController();
  camera = new PerspectiveCamera();
  stage = {
    scene: new Scene(),
    canvas: document.body.appendChild(document.createElement("canvas")),
    base: () => new Matrix4(),
    camera: () => camera,
    controls: () => controls as OrbitControls,
    view: () => ({}) as ReturnType<Stage["view"]>,
    changed,
  };
});

const shift = (kind: "keydown" | "keyup", key = "Shift") => dispatchEvent(new KeyboardEvent(kind, { key }));

test("with Shift the gizmo moves in steps of 10 mm and 15°", () => {
  const gizmo = addGizmo(stage, ending.signal);
  const steps = () => [gizmo.translationSnap, gizmo.rotationSnap];
  expect([gizmo.space, ...steps()]).toEqual(["local", null, null]);
  shift("keydown", "a");
  expect(steps()).toEqual([null, null]);
  shift("keydown");
  expect(steps()).toEqual([0.01, Math.PI / 12]);
  shift("keyup", "a");
  expect(steps()).toEqual([0.01, Math.PI / 12]);
  shift("keyup");
  expect(steps()).toEqual([null, null]);
  ending.abort();
  shift("keydown");
  expect(steps()).toEqual([null, null]);
});

test("while the gizmo is dragged the camera stays, and what it changes is drawn", () => {
  const gizmo = addGizmo(stage, ending.signal);
  gizmo.dispatchEvent({ type: "dragging-changed", value: true });
  expect(controls.enabled).toBe(false);
  gizmo.dispatchEvent({ type: "dragging-changed", value: false });
  expect(controls.enabled).toBe(true);
  changed.mockReset();
  gizmo.dispatchEvent({ type: "change" } as never);
  expect(changed).toHaveBeenCalledOnce();
});

test("the gizmo follows the camera of each view, and leaves the scene at its end", () => {
  const gizmo = addGizmo(stage, ending.signal);
  const part = new Object3D();
  stage.scene.add(part);
  gizmo.attach(part);
  expect(stage.scene.children).toEqual([gizmo.getHelper(), part]);
  camera = new PerspectiveCamera();
  stage.scene.updateMatrixWorld(true);
  expect(gizmo.camera).toBe(camera);
  ending.abort();
  expect([stage.scene.children, gizmo.object]).toEqual([[part], undefined]);
});

test("the floor has the page's colours, and is replaced with them", () => {
  const style = document.documentElement.style;
  style.setProperty("--scene", " #102030");
  style.setProperty("--scene-floor", "#405060");
  const scene = new Scene();
  surround(scene, palette());
  const floor = surround(scene, { ...palette(), floor: "#708090" });
  expect([scene.children, scene.background]).toEqual([[floor], new Color("#102030")]);
  const disc = floor?.getObjectByProperty("type", "Mesh") as Mesh;
  expect(disc.material).toMatchObject({ color: new Color("#708090") });
  // Lines each 100 mm on both sides of the middle, stronger each 500 mm.
  const [fine, strong] = (floor?.children.slice(1) ?? []) as Mesh[];
  const lines = (of?: Mesh) => (of?.geometry.getAttribute("position").count ?? 0) / 4;
  expect([lines(fine), lines(strong)]).toEqual([26, 7]);
  expect(surround(scene, palette(), false)).toBeNull();
  expect(scene.children).toEqual([]);
});

test("one light casts shadows", () => {
  const casting = new Group().add(...lights()).children.filter(({ castShadow }) => castShadow);
  expect(casting.map(({ name }) => name)).toEqual([KEY_LIGHT]);
});
