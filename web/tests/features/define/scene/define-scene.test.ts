// The 3-D picture of a robot that is described: which link a click chooses.

import * as THREE from "three";
import { beforeEach, expect, test, vi } from "vitest";
import type { DefineScene, Picture } from "../../../../src/features/define/scene/define-scene";
import { newPage } from "../../../console";
import { fakeRenderer } from "../../../scene/canvas/gl";
import { meshes } from "../../../scene/glb";

const fake = vi.hoisted(() => ({ renderer: {} as object }));
vi.mock("../../../../src/scene/canvas/webgl", async (original) => ({
  ...(await original<typeof import("../../../../src/scene/canvas/webgl")>()),
  drawsInSoftware: () => false,
  makeRenderer: () => fake.renderer,
}));

let canvas: HTMLCanvasElement;
let scene: DefineScene;
const pick = vi.fn();

beforeEach(async () => {
  newPage();
  pick.mockReset();
  vi.stubGlobal("fetch", meshes());
  canvas = document.body.appendChild(document.createElement("canvas"));
  vi.spyOn(canvas, "getBoundingClientRect").mockReturnValue(new DOMRect(0, 0, 100, 100));
  const { made } = fakeRenderer();
  made.render.mockImplementation((drawn: THREE.Scene) => drawn.updateMatrixWorld()); // as a real one does
  fake.renderer = Object.assign(made, { domElement: canvas });
  const { DefineScene } = await import("../../../../src/features/define/scene/define-scene");
  scene = new DefineScene(canvas, { pick, drag: vi.fn(), dragged: vi.fn(), failed: vi.fn() });
  return () => scene.dispose();
});

/** Show a triangle for each link, at these heights [m], and look down on them. */
async function show(...heights: number[]): Promise<void> {
  const unit = new THREE.Matrix4();
  const shape = { glb: "triangle", scale: 1, pose: unit, color: "" };
  const picture: Picture = {
    placements: heights.map((z) => new THREE.Matrix4().makeTranslation(-0.2, -0.2, z)),
    ...{ start: unit, rows: [], shapes: heights.map(() => shape), tool: unit, frames: [], size: 1, chosen: null },
  };
  scene.show(picture);
  const eye = new THREE.Vector3(0, 0, 10);
  scene.view.look({ eye, target: new THREE.Vector3(), up: new THREE.Vector3(0, 1, 0), flat: true });
  await vi.advanceTimersByTimeAsync(500);
}
function click(x: number, y: number): void {
  for (const kind of ["pointerdown", "pointerup"])
    canvas.dispatchEvent(new PointerEvent(kind, { clientX: x, clientY: y, pointerId: 1 }));
}

test("a click chooses the nearest link under it", async () => {
  await show(0, 2, 1);
  click(50, 50);
  click(1, 1);
  expect(pick.mock.calls).toEqual([[1]]);
});
