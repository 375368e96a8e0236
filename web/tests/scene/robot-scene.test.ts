// The live 3-D picture of a robot: what of it is drawn, and when.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import type { Color, DirectionalLight, Group, Mesh, MeshStandardMaterial, Object3D } from "three";
import { beforeEach, expect, test, vi } from "vitest";
import { FrameTransformsSchema } from "../../src/gen/foxglove/FrameTransforms_pb";
import { JointStatesSchema } from "../../src/gen/foxglove/JointStates_pb";
import { DescriptionSchema, ViewSchema } from "../../src/gen/robomesh_pb";
import type { RobotScene, SceneState } from "../../src/scene/robot-scene";
import { connect, newPage, publish, watched } from "../console";
import { fakeRenderer } from "./canvas/gl";
import { meshes } from "./glb";

const fake = vi.hoisted(() => ({ software: false, renderer: {} as object }));
vi.mock("../../src/scene/canvas/webgl", async (original) => ({
  ...(await original<typeof import("../../src/scene/canvas/webgl")>()),
  drawsInSoftware: () => fake.software,
  makeRenderer: () => fake.renderer,
}));

const WHITE = "#ffffff"; // of the loaded models
const ROBOT = "robomesh/hall/arm";
const at = (x: number, z = 0) => [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, z, 0, 0, 0, 1];
const DESCRIPTION: MessageInitShape<typeof DescriptionSchema> = {
  urdf: `<robot><joint name="slide" type="prismatic"><parent link="base"/><child link="hand"/></joint></robot>`,
  joints: [{ name: "slide" }],
  links: [{ name: "hand", mesh: "hand" }],
  frames: [
    { name: "tool", link: "hand" },
    { name: "flange", link: "hand" },
  ],
  fixtures: [{ name: "table", mesh: "table", fixtureToSite: at(3) }],
  baseToSite: at(5, 2),
};
let gpu: ReturnType<typeof fakeRenderer>["gpu"];
let gl: ReturnType<typeof fakeRenderer>["made"];
let canvas: HTMLCanvasElement;
let label: HTMLElement;
let scene: RobotScene;
let state: SceneState;
const drew = vi.fn<SceneState["drew"]>();
const failed = vi.fn();

beforeEach(async () => {
  newPage();
  vi.stubGlobal("fetch", meshes());
  for (const [name, colour] of [
    ["stop", "#ff0000"],
    ["dim", "#888888"],
    ["scene", "#101010"],
  ] as const)
    document.documentElement.style.setProperty(`--${name}`, colour);
  const made = fakeRenderer();
  ({ gpu, made: gl } = made);
  Object.assign(fake, { software: false, renderer: made.renderer });
  drew.mockReset();
  failed.mockReset();
  await connect();
  canvas = document.body.appendChild(document.createElement("canvas"));
  label = document.createElement("span");
  await begin();
});

async function begin(description = DESCRIPTION): Promise<void> {
  const { RobotScene } = await import("../../src/scene/robot-scene");
  scene = new RobotScene(canvas, ROBOT, label);
  const message = create(DescriptionSchema, description);
  state = {
    ...{ description: message, topic: "frames", stale: false, rate: 1, theme: "dark", trail: false, frames: false },
    ...{ ghost: null, red: new Set<string>(), path: null, nearest: null, pose: null, moved: undefined, drew },
    view: create(ViewSchema, { name: "free", eye: { x: 3 } }),
  };
  await scene.load(message, failed);
  scene.update(state);
  await pass(500);
}
const pass = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const update = (more: Partial<SceneState>) => scene.update((state = { ...state, ...more }));
const renders = () => gl.render.mock.calls.length;
const parts = () => scene.stage().scene.children;
const ofKind = (type: string) => parts().filter((each) => each.type === type);
const meshIn = (group?: Object3D) => group?.getObjectByProperty("type", "Mesh") as Mesh<never, MeshStandardMaterial>;
const colourOf = (group?: Object3D) => `#${meshIn(group).material.color.getHexString()}`;
/** The groups with a model: the arm's link, its ghost, the fixture. */
const models = () => ofKind("Group").filter((each) => !each.matrixAutoUpdate) as [Group, Group, Group, Group];
const sendFrames = (x: number, sequence = 1n, timeMs = Date.now(), name = "hand") =>
  publish(
    `${ROBOT}/frames`,
    FrameTransformsSchema,
    {
      transforms: [name, "tool", "flange"].map((each) => ({
        childFrameId: `hall/arm/${each}`,
        translation: { x, z: 2 },
      })),
    },
    { sequence, timeMs },
  );

test("a picture that does not change is drawn once", async () => {
  const before = renders();
  expect([before > 0, Number(canvas.dataset.drawn)]).toEqual([true, before]);
  await pass(5000);
  expect(renders()).toBe(before);
  sendFrames(1);
  await pass(500);
  expect(renders()).toBeGreaterThan(before);
  const after = renders();
  for (let sequence = 2n; sequence < 10n; sequence++) {
    sendFrames(1, sequence);
    await pass(50);
  }
  expect(renders()).toBe(after); // at rest
});

test("links stand where their frames are, and the picture on the screen is named", async () => {
  sendFrames(1, 7n);
  await pass(200);
  expect([models()[0].visible, models()[0].matrix.elements[12]]).toEqual([true, 1]);
  expect(drew).toHaveBeenLastCalledWith(expect.objectContaining({ sequence: 7n }));
});

test("of a moving arm the frames that are drawn are named, not those that have just arrived", async () => {
  for (let sequence = 1n; sequence <= 20n; sequence++) {
    await pass(50);
    sendFrames(Number(sequence), sequence);
  }
  expect(drew).toHaveBeenLastCalledWith(expect.objectContaining({ sequence: 18n }));
  await pass(200);
  expect(drew).toHaveBeenLastCalledWith(expect.objectContaining({ sequence: 20n }));
});

test("a canvas that lost its context shows no known picture", async () => {
  gpu.lost = true;
  sendFrames(1);
  await pass(100);
  expect(drew).toHaveBeenLastCalledWith(null);
});

test("over a slow link the links are placed by their joints", async () => {
  expect([...watched]).toContain(`${ROBOT}/frames`);
  update({ topic: "joints/slow" });
  expect([...watched]).toEqual([`${ROBOT}/joints/slow`]);
  publish(`${ROBOT}/joints/slow`, JointStatesSchema, { joints: [{ name: "slide", position: 0.25 }] });
  await pass(200);
  expect(models()[0].matrix.elements.slice(12, 15)).toEqual([5.25, 0, 2]);
});

test("a stale arm turns grey at once, also while the picture pauses", async () => {
  sendFrames(1);
  await pass(200);
  expect(colourOf(models()[0])).toBe(WHITE);
  gpu.finished = false;
  update({ trail: true });
  await pass(100);
  gpu.finished = true; // a slow frame: a pause follows
  await pass(16);
  const before = renders();
  update({ stale: true });
  await pass(40);
  expect([colourOf(models()[0]), renders()]).toEqual(["#7d8387", before + 1]);
});

test("a ghost stands at its joints, beside the arm", async () => {
  sendFrames(5);
  await pass(200);
  update({ ghost: [0.5] });
  expect([canvas.dataset.ghost, models()[1].visible, models()[1].matrix.elements[12]]).toEqual(["1", true, 5.5]);
  update({ ghost: null });
  expect([canvas.dataset.ghost, models()[1].visible]).toEqual(["0", false]);
  update({ ghost: [0] }); // where the arm is
  expect(canvas.dataset.ghost).toBe("0");
});

test("colliding links and fixtures are red, with their edges", () => {
  const edges = () =>
    (
      models()[2].getObjectByProperty("type", "LineSegments") as unknown as { material: { color: Color } }
    ).material.color.getHexString();
  expect([colourOf(models()[2]), edges()]).toEqual([WHITE, "888888"]);
  update({ red: new Set(["table", "arm/hand"]) });
  expect([colourOf(models()[2]), edges(), colourOf(models()[0])]).toEqual(["#ff0000", "ff0000", "#ff0000"]);
  expect(canvas.dataset.red).toBe("arm/hand table");
  update({ red: new Set() });
  expect([colourOf(models()[2]), colourOf(models()[0])]).toEqual([WHITE, WHITE]);
});

test("fixtures stand in the site; one without a model is named", async () => {
  expect([models()[2].matrix.elements[12], canvas.dataset.fixtures]).toEqual([3, "1"]);
  vi.stubGlobal("fetch", async () => new Response("gone", { status: 404, headers: { "Content-Type": "text/plain" } }));
  await begin();
  expect(failed.mock.calls.slice(-2)).toEqual([
    ["hand", "gone"],
    ["table", "gone"],
  ]);
});

test("the tool's path is in the robot's base frame", () => {
  update({
    path: [
      [0, 0, 0],
      [1, 0, 0],
    ],
  });
  const path = ofKind("Line").find(({ matrix }) => matrix.elements[12] === 5);
  expect([canvas.dataset.path, path?.visible]).toEqual(["2", true]);
  update({ path: null });
  expect([canvas.dataset.path, path?.visible]).toEqual(["0", false]);
});

test.each([
  ["of an older gateway at the base", {}, "2", [5, 0, 2]],
  ["at its height", { floor: { height: -1 } }, "-1", [5, 0, -1]],
  ["that there is not", { floor: {} }, "null", undefined],
])("the floor %s", async (_, more, height, place) => {
  await begin({ ...DESCRIPTION, ...more });
  const floor = scene.stage().scene.getObjectByName("floor");
  expect([canvas.dataset.floor, floor?.position.toArray()]).toEqual([height, place]);
});

test("another theme paints the surroundings anew, and draws them", async () => {
  document.documentElement.style.setProperty("--scene", "#f0f0f0");
  const before = renders();
  update({ theme: "light" });
  await pass(100);
  expect((scene.stage().scene.background as Color).getHexString()).toBe("f0f0f0");
  expect(renders()).toBeGreaterThan(before);
});

test("named frames have axes only while a person wants them", async () => {
  const shown = () => ofKind("AxesHelper").map(({ visible, position }) => [visible, position.x]);
  expect(shown()).toEqual(Array(2).fill([false, 0]));
  sendFrames(1);
  await pass(200);
  expect(shown()).toEqual([
    [false, 1],
    [false, 1],
  ]);
  update({ frames: true });
  await pass(200);
  expect(shown()).toEqual([
    [true, 1],
    [true, 1],
  ]);
});

test("the trail has each place of the tool while it is shown", async () => {
  const trail = () => (ofKind("Line")[0] as Mesh).geometry.drawRange.count;
  sendFrames(1);
  await pass(200);
  update({ trail: true });
  for (let x = 2; x < 5; x++) {
    sendFrames(x, BigInt(x));
    await pass(50);
  }
  await pass(200);
  expect(trail()).toBe(4); // from where the tool was
  update({ trail: false });
  expect(ofKind("Line")[0]?.visible).toBe(false);
});

test("the shortest distance is shown with the frames of its time, and hidden when it is not known", async () => {
  const time = Date.now();
  const nearest = { points: [{ x: 0 }, { x: 1 }], level: "normal", text: "12 mm" } as unknown as NonNullable<
    SceneState["nearest"]
  >["nearest"];
  update({ nearest: { nearest, sourceTime: time } });
  await pass(200);
  expect(label.textContent).toBe("");
  for (const sequence of [1n, 2n, 3n, 4n]) {
    sendFrames(1, sequence, time + 50 * Number(sequence));
    await pass(50);
  }
  expect([label.textContent, label.hidden]).toEqual(["12 mm", false]);
  update({ nearest: null });
  await pass(200);
  expect(label.hidden).toBe(true);
});

test("slow frames are drawn coarser, without shadows, and once more in full at rest", async () => {
  vi.stubGlobal("devicePixelRatio", 2);
  await begin();
  expect(canvas.dataset.pixelRatio).toBe("2");
  const light = () => ofKind("DirectionalLight")[0] as DirectionalLight;
  for (let i = 0; i < 6; i++) {
    gpu.finished = false;
    scene.turn(0.3, 0);
    await pass(300);
    gpu.finished = true;
    await pass(500);
  }
  expect([Number(canvas.dataset.pixelRatio) < 2, light().castShadow]).toEqual([true, false]);
  expect(gl.setPixelRatio).toHaveBeenLastCalledWith(Number(canvas.dataset.pixelRatio));
  await pass(4000);
  expect(canvas.dataset.pixelRatio).toBe("2");
  const rested = renders();
  await pass(4000);
  expect(renders()).toBe(rested);
});

test("a neighbour is dimmed, red where it collides, and gone when it is removed", async () => {
  update({ red: new Set(["arm2/hand"]) });
  const neighbour = scene.addNeighbour("hall/arm2", create(DescriptionSchema, DESCRIPTION));
  await pass(50);
  expect([canvas.dataset.neighbours, colourOf(models()[3])]).toEqual(["1", "#ff0000"]);
  update({ red: new Set() });
  expect(colourOf(models()[3])).not.toMatch(/#ff0000|#ffffff/);
  const before = renders();
  neighbour.placeFrames(create(FrameTransformsSchema, { transforms: [{ childFrameId: "hall/arm2/hand" }] }), 0, 0);
  await pass(200);
  expect([models()[3].visible, renders() > before]).toEqual([true, true]);
  scene.removeNeighbour(neighbour);
  expect(models()).toHaveLength(3);
});

test("a person's camera is reported, and the stage has it for the renderer", async () => {
  const moved = vi.fn();
  update({ moved });
  await pass(1000);
  const before = renders();
  scene.turn(Math.PI / 2, 0);
  await pass(3000);
  expect(renders()).toBeGreaterThan(before);
  expect(moved).toHaveBeenCalledOnce();
  const stage = scene.stage();
  expect([stage.view().eye?.y, stage.base().elements[12], stage.camera().type]).toEqual([
    expect.closeTo(3),
    ...[5, "PerspectiveCamera"],
  ]);
  expect(stage.controls().target.toArray()).toEqual([5, 0, expect.closeTo(2)]);
  expect(stage.canvas).toBe(canvas);
});

test("a software renderer spares shadows", async () => {
  expect(gl.shadowMap.enabled).toBe(true);
  fake.software = true;
  await begin();
  expect(gl.shadowMap.enabled).toBe(false);
});

test("a canvas of another size is drawn in it at the next frame", async () => {
  const before = gl.setSize.mock.calls.length;
  canvas.dispatchEvent(new Event("webglcontextrestored"));
  expect(gl.setSize.mock.calls.length).toBe(before);
  await pass(50);
  expect(gl.setSize.mock.calls.length).toBe(before + 1);
});

test("after its end nothing is watched, drawn or kept", async () => {
  sendFrames(1);
  scene.dispose();
  expect([...watched]).toEqual([]);
  expect(gl.dispose).toHaveBeenCalledOnce();
  const before = renders();
  await pass(5000);
  expect(renders()).toBe(before);
});
