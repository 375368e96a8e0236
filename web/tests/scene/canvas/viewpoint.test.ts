// The camera of a 3-D picture.

import { Vector3 } from "three";
import { beforeEach, expect, test, vi } from "vitest";
import type { CameraPose, ViewpointOptions } from "../../../src/scene/canvas/viewpoint";
import { Viewpoint } from "../../../src/scene/canvas/viewpoint";

const moved = vi.fn();
const OPTIONS: ViewpointOptions = {
  clip: [0.1, 50],
  distance: [0.2, 12],
  damping: true,
  turnsFlat: false,
  polarMargin: 0.1,
};
const FRONT: CameraPose = {
  eye: new Vector3(2, 0, 1),
  target: new Vector3(0, 0, 1),
  up: new Vector3(0, 0, 1),
  flat: false,
};

beforeEach(() => void moved.mockReset());

function made(pose: Partial<CameraPose> = {}, options: Partial<ViewpointOptions> = {}): Viewpoint {
  const viewpoint = new Viewpoint(document.createElement("canvas"), { ...OPTIONS, ...options }, moved);
  viewpoint.look({ ...FRONT, ...pose });
  return viewpoint;
}
const rounded = (at: Vector3) => at.toArray().map((each) => Number(each.toFixed(6)) + 0);

test("a look is what the camera has then, and is nobody's move", () => {
  const viewpoint = made();
  expect(moved).toHaveBeenCalled();
  const { eye, target, up, flat } = viewpoint.now();
  expect([rounded(eye), rounded(target), rounded(up), flat, viewpoint.touched]).toEqual([
    ...[
      [2, 0, 1],
      [0, 0, 1],
      [0, 0, 1],
    ],
    ...[false, false],
  ]);
  const gone = vi.spyOn(viewpoint.controls, "dispose");
  viewpoint.controls.dispatchEvent({ type: "start" });
  expect(viewpoint.touched).toBe(true);
  viewpoint.look(FRONT);
  expect(viewpoint.touched).toBe(false);
  expect(gone).toHaveBeenCalledOnce(); // otherwise two follow the pointer
});

test("the keyboard turns the camera about its target, at the same distance", () => {
  const viewpoint = made();
  moved.mockReset();
  viewpoint.turn(Math.PI / 2, 0);
  expect(rounded(viewpoint.now().eye)).toEqual([0, 2, 1]);
  expect([viewpoint.touched, moved.mock.calls.length > 0]).toEqual([true, true]);
  viewpoint.turn(0, -Math.PI / 4);
  expect(rounded(viewpoint.now().eye)).toEqual([0, Number(Math.SQRT2.toFixed(6)), Number((1 + Math.SQRT2).toFixed(6))]);
});

test.each([
  [-9, 0.1],
  [9, Math.PI - 0.1],
])("a turn by %s stays beside the vertical", (polar, angle) => {
  const viewpoint = made();
  viewpoint.turn(0, polar);
  const { eye, target, up } = viewpoint.now();
  expect(eye.sub(target).angleTo(up)).toBeCloseTo(angle, 5);
});

test.each([
  [false, [2, 0, 1]],
  [true, [0, 2, 1]],
])("a flat camera that may turn (%s) is turned by it", (turnsFlat, eye) => {
  const viewpoint = made({ flat: true }, { turnsFlat });
  viewpoint.turn(Math.PI / 2, 0);
  expect([rounded(viewpoint.now().eye), viewpoint.controls.enableRotate, viewpoint.isFlat]).toEqual([
    eye,
    turnsFlat,
    true,
  ]);
});

test("the zoom of a flat camera is the distance of its eye, and it shows what a perspective one would", () => {
  const viewpoint = made({ flat: true });
  const height = 2 * 2 * Math.tan((16 * Math.PI) / 180);
  expect(viewpoint.flatHeight).toBeCloseTo(height);
  expect(viewpoint.letterScale).toBeCloseTo(2);
  viewpoint.camera.zoom = 4;
  expect(rounded(viewpoint.now().eye)).toEqual([0.5, 0, 1]);
  expect(viewpoint.flatHeight).toBeCloseTo(height / 4);
  viewpoint.look(FRONT);
  expect([viewpoint.camera.zoom, viewpoint.letterScale]).toEqual([1, 1]);
});

test("a narrow picture has a wider angle, and a flat one its shape", () => {
  const viewpoint = made();
  expect(viewpoint.fieldOfView).toBe(32);
  viewpoint.resize(0.5);
  expect(viewpoint.fieldOfView).toBeCloseTo(43.2);
  viewpoint.look({ ...FRONT, flat: true });
  const { right, left, top, bottom } = viewpoint.camera as unknown as Record<string, number>;
  expect((Number(right) - Number(left)) / (Number(top) - Number(bottom))).toBeCloseTo(0.5);
});

test("before its first look a camera has a picture", () => {
  const viewpoint = new Viewpoint(document.createElement("canvas"), OPTIONS, moved);
  viewpoint.resize(1);
  expect(viewpoint.flatHeight).toBeGreaterThan(0.1);
});

test.each([
  [true, false, true],
  [true, true, false],
  [false, false, false],
])("the camera glides (%s) unless the person wants less motion (%s)", (damping, reduced, glides) => {
  vi.stubGlobal("matchMedia", (query: string) => ({ matches: reduced && query.includes("reduced-motion") }));
  expect(made({}, { damping }).controls.enableDamping).toBe(glides);
});

test("after its end the controls follow no pointer", () => {
  const viewpoint = made();
  const gone = vi.spyOn(viewpoint.controls, "dispose");
  viewpoint.dispose();
  expect(gone).toHaveBeenCalled();
  expect([viewpoint.controls.minDistance, viewpoint.controls.maxDistance]).toEqual([0.2, 12]);
});
