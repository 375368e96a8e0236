// The camera of a robot's 3-D view: a view of the description, or where a person put it.

import { create } from "@bufbuild/protobuf";
import { Matrix4 } from "three";
import { beforeEach, expect, test, vi } from "vitest";
import { View_Projection as Projection, ViewSchema } from "../../src/gen/robomesh_pb";
import { SceneCamera } from "../../src/scene/scene-camera";

// The base is 10 m along the site's x axis, and turned by 90° about z.
const BASE = new Matrix4().makeRotationZ(Math.PI / 2).setPosition(10, 0, 0);
const view = (name: string, more: object = {}) =>
  create(ViewSchema, { name, eye: { x: 2 }, target: { z: 0.5 }, up: { z: 1 }, ...more });
const FRONT = view("front");
const FLAT = view("top", { eye: { z: 3 }, up: { x: 1 }, projection: Projection.ORTHOGRAPHIC });
const OWN = [1, 1, 1, 0, 0, 0.5];
const moved = vi.fn();
let camera: SceneCamera;

beforeEach(() => {
  vi.useFakeTimers();
  moved.mockReset();
  camera = new SceneCamera(document.createElement("canvas"), BASE, () => undefined);
  camera.moved = moved;
  return () => camera.dispose();
});
const eye = () =>
  camera.viewpoint
    .now()
    .eye.toArray()
    .map((each) => Number(each.toFixed(3)) + 0);
const rest = () => vi.advanceTimersByTime(1600);

test("a view is given in the robot's base frame, and so is the camera for the renderer", () => {
  camera.show(FRONT, null);
  expect(eye()).toEqual([10, 2, 0]);
  const { eye: at, target, up, projection, fieldOfView } = camera.now();
  expect([at?.x, target?.z, up?.z].map((each) => Number(each?.toFixed(6)))).toEqual([2, 0.5, 1]);
  expect([projection, fieldOfView]).toEqual([Projection.PERSPECTIVE, (32 * Math.PI) / 180]);
  camera.show(FLAT, null);
  expect(camera.now()).toMatchObject({ projection: Projection.ORTHOGRAPHIC, height: camera.viewpoint.flatHeight });
  camera.show(view("none", { up: undefined }), null);
  expect(camera.viewpoint.now().up.toArray()).toEqual([0, 0, 1]);
});

test("the camera stays where a person put it until another view or pose is asked for", () => {
  camera.show(FRONT, null);
  camera.viewpoint.turn(1, 0);
  const put = eye();
  camera.show(view("front"), null);
  expect(eye()).toEqual(put);
  camera.show(FRONT, OWN);
  expect(eye()).toEqual([9, 1, 1]);
  camera.show(FRONT, null);
  expect(eye()).toEqual([10, 2, 0]);
  camera.show(view("side", { eye: { y: 3 } }), null);
  expect(eye()).toEqual([7, 0, 0]);
});

test("a pose keeps the view's projection and vertical", () => {
  camera.show(FLAT, OWN);
  expect([camera.viewpoint.isFlat, camera.now().up?.x]).toEqual([true, expect.closeTo(1)]);
  camera.show(view("plain", { up: undefined }), OWN);
  expect(camera.now().up?.z).toBeCloseTo(1);
});

test("a move is reported once, when the camera rests, and its report moves nothing", () => {
  camera.show(FRONT, null);
  rest();
  expect(moved).not.toHaveBeenCalled();
  camera.viewpoint.turn(1, 0);
  vi.advanceTimersByTime(500);
  expect(moved).not.toHaveBeenCalled(); // it may go on
  rest();
  expect(moved.mock.calls).toEqual([
    [{ view: "front", pose: [2 * Math.cos(1), 2 * Math.sin(1), 0, 0, 0, 0.5].map((each) => expect.closeTo(each, 3)) }],
  ]);
  camera.viewpoint.turn(0.00001, 0); // nobody sees it
  camera.show(FRONT, moved.mock.calls[0]?.[0].pose);
  const looks = vi.spyOn(camera.viewpoint, "look");
  camera.show(FRONT, moved.mock.calls[0]?.[0].pose);
  rest();
  expect([looks.mock.calls.length, moved.mock.calls.length]).toEqual([0, 1]);
  camera.viewpoint.turn(1, 0);
  rest();
  expect(moved).toHaveBeenCalledTimes(2);
  camera.show(view("side", { eye: { y: 3 } }), null); // no person's move
  rest();
  expect(moved).toHaveBeenCalledTimes(2);
});

test("a flat view is not turned, and a camera that has ended looks at nothing", () => {
  camera.show(FLAT, null);
  const before = eye();
  camera.viewpoint.turn(1, 0);
  expect(eye()).toEqual(before);
  camera.dispose();
  expect(vi.getTimerCount()).toBe(0);
});

test.each([
  ["without a view", () => undefined],
  ["that nothing follows", () => ((camera.moved = undefined), camera.show(FRONT, null))],
  ["of a flat view, whose zoom is no pose", () => camera.show(FLAT, null)],
])("a move %s is not reported", (_, begin) => {
  begin();
  rest();
  camera.viewpoint.camera.position.x += 1;
  rest();
  expect(moved).not.toHaveBeenCalled();
});
