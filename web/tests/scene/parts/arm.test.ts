// An arm in the 3-D view.

import { create } from "@bufbuild/protobuf";
import { Matrix4, type Mesh, type MeshStandardMaterial, Scene } from "three";
import { beforeEach, expect, test, vi } from "vitest";
import { FrameTransformsSchema } from "../../../src/gen/foxglove/FrameTransforms_pb";
import { DescriptionSchema } from "../../../src/gen/robomesh_pb";
import { Arm } from "../../../src/scene/parts/arm";
import { meshes } from "../glb";

const DESCRIPTION = create(DescriptionSchema, {
  links: [{ name: "base" }, { name: "hand", mesh: "hand v2", meshSha256: "ab", color: "#112233" }],
  baseToSite: [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
});
const failed = vi.fn();
const changed = vi.fn();
let scene: Scene;
let arm: Arm;
let asked: string[];

beforeEach(() => {
  vi.useFakeTimers();
  asked = [];
  vi.stubGlobal("fetch", meshes(asked));
  document.documentElement.style.setProperty("--accent", "#00ff00");
  document.documentElement.style.setProperty("--stop", "#ff0000");
  failed.mockReset();
  changed.mockReset();
  scene = new Scene();
  arm = new Arm(scene, "hall/arm", "arm", changed);
});

const place = (x: number) =>
  create(FrameTransformsSchema, { transforms: [{ childFrameId: "hall/arm/hand", translation: { x } }] });
const ghostAt = (x: number) => new Map([["hand", new Matrix4().setPosition(x, 0, 0)]]);
const [LINK, GHOST] = [0, 1];
function look(of: number) {
  scene.updateMatrixWorld(true); // as drawing does
  const group = scene.children[of];
  const part = group?.getObjectByProperty("type", "Mesh") as Mesh<never, MeshStandardMaterial>;
  const { color, opacity } = part.material;
  return [group?.visible, `#${color.getHexString()}`, opacity];
}

test("each link with a mesh is loaded by its hash, and appears with its first frame", async () => {
  const made = vi.fn();
  await arm.load(DESCRIPTION, failed, made);
  expect(asked).toEqual(["/mesh/hall/arm/hand%20v2?sha=ab"]);
  expect([failed.mock.calls, made.mock.calls]).toEqual([[["hand", ""]], [[scene.children[GHOST]]]]);
  expect(look(LINK)[0]).toBe(false);
  changed.mockReset();
  arm.placeFrames(place(7), 0, 0);
  expect(changed).toHaveBeenCalledOnce();
  expect(arm.placeAt(1000)?.size).toBe(1);
  expect([look(LINK)[0], scene.children[LINK]?.matrix.elements[12]]).toEqual([true, 7]);
  expect(arm.placeAt(1001)).toBeNull();
  arm.placeFrames(place(7), 50, 50);
  expect(changed).toHaveBeenCalledOnce();
});

test("a link whose model cannot be had is named with the reason", async () => {
  vi.stubGlobal("fetch", async () => new Response("gone", { status: 404, headers: { "Content-Type": "text/plain" } }));
  await arm.load(DESCRIPTION, failed);
  expect([failed.mock.calls, scene.children]).toEqual([[["hand", "gone"]], []]);
});

test("a stale arm is grey until it is live again", async () => {
  await arm.load(DESCRIPTION, failed);
  const live = look(LINK);
  changed.mockReset();
  arm.setStale(false);
  expect(changed).not.toHaveBeenCalled();
  arm.setStale(true);
  expect(look(LINK).slice(1)).toEqual(["#7d8387", 0.38]);
  expect(changed).toHaveBeenCalledOnce();
  arm.setStale(false);
  expect(look(LINK)).toEqual(live);
});

test("a ghost shows the links that would be elsewhere, in the base's place", async () => {
  await arm.load(DESCRIPTION, failed, () => undefined);
  arm.placeFrames(place(5.001), 0, 0);
  arm.placeAt(1000);
  expect(arm.showGhost(ghostAt(0))).toBe(0); // within 2 mm of the link
  expect(arm.showGhost(ghostAt(0.5))).toBe(1);
  expect([look(GHOST), scene.children[GHOST]?.matrix.elements[12]]).toEqual([[true, "#00ff00", 0.4], 5.5]);
  expect(arm.showGhost(new Map())).toBe(0);
  expect([arm.showGhost(ghostAt(1)), arm.showGhost(null), look(GHOST)[0]]).toEqual([1, 0, false]);
});

test("a red link's visible ghost is red, or without one the link itself", async () => {
  await arm.load(DESCRIPTION, failed, () => undefined);
  arm.setRed(new Set(["arm/hand"]));
  expect([look(LINK)[1], look(GHOST)]).toEqual(["#ff0000", [false, "#ff0000", 0.75]]);
  arm.showGhost(ghostAt(1));
  expect(look(LINK)[1]).not.toBe("#ff0000");
  changed.mockReset();
  arm.showGhost(ghostAt(2));
  expect(changed).toHaveBeenCalledOnce(); // it is painted no more than needed
  arm.showGhost(null);
  expect(look(LINK)[1]).toBe("#ff0000");
  arm.setRed(new Set(["arm2/hand"]));
  expect([look(LINK)[1] === "#ff0000", look(GHOST)[1]]).toEqual([false, "#00ff00"]);
});

test("an arm without ghosts shows none", async () => {
  await arm.load(DESCRIPTION, failed);
  expect([arm.showGhost(ghostAt(1)), scene.children.length]).toEqual([0, 1]);
});

test("a removed arm is gone with its memory, and what is still loaded does not appear", async () => {
  await arm.load(DESCRIPTION, failed);
  const part = scene.getObjectByProperty("type", "Mesh") as Mesh<never, MeshStandardMaterial>;
  const freed = [vi.spyOn(part.geometry as Mesh["geometry"], "dispose"), vi.spyOn(part.material, "dispose")];
  const loading = arm.load(DESCRIPTION, failed);
  arm.remove();
  await loading;
  expect(scene.children).toEqual([]);
  for (const each of freed) expect(each).toHaveBeenCalled();
});
