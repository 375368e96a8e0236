// The 3-D panel: what it waits for, what it calls stale, and what it lets be drawn.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import type { ComponentProps } from "preact";
import { beforeEach, expect, test, vi } from "vitest";
import { FrameTransformsSchema } from "../../src/gen/foxglove/FrameTransforms_pb";
import { DescriptionSchema, KinematicStateSchema, ReplayStateSchema } from "../../src/gen/robomesh_pb";
import type { SceneState } from "../../src/scene/robot-scene";
import type { SceneView } from "../../src/scene/scene-view";
import { connect, newPage, publish, watched } from "../console";
import { find, key, pass, press, texts } from "../hands";
import { hide, show } from "../shown";

type Failed = (link: string, why: string) => void;
const drawing = vi.hoisted(() => ({ broken: false, scenes: [] as unknown[] }));
/** A scene that draws nothing. */
class Scene {
  static readonly made = drawing.scenes as Scene[];
  disposed = false;
  states: SceneState[] = [];
  turns: number[][] = [];
  loaded = Promise.withResolvers<void>();
  failed: Failed = () => undefined;
  constructor() {
    if (drawing.broken) throw new Error("no WebGL");
    Scene.made.push(this);
  }
  stage = () => "stage";
  load = (_: unknown, failed: Failed) => ((this.failed = failed), this.loaded.promise);
  update = (state: SceneState) => this.states.push(state);
  turn = (...by: number[]) => this.turns.push(by);
  addNeighbour = () => ({ setStale: vi.fn() });
  removeNeighbour = () => undefined;
  dispose = () => (this.disposed = true);
}
vi.mock("../../src/scene/robot-scene", () => ({ RobotScene: Scene }));

const ROBOT = "robomesh/hall/arm";
const VIEWS = ["front", "close"].map((name) => ({ name, eye: { x: 6 }, target: { z: 1 } }));
let page: typeof import("../../src/scene/scene-view");
let overlays: typeof import("../../src/scene/overlays");
let place: HTMLElement;
type Described = Exclude<MessageInitShape<typeof DescriptionSchema>, { $typeName: string }>;
let described: Described;
let props: Partial<ComponentProps<typeof SceneView>>;

beforeEach(async () => {
  newPage();
  Object.assign(drawing, { broken: false });
  Scene.made.length = 0;
  described = { links: [{ name: "hand" }], views: VIEWS };
  props = {};
  page = await import("../../src/scene/scene-view");
  overlays = await import("../../src/scene/overlays");
  await connect({
    site: "hall",
    stale: [
      { topic: "frames", afterS: 1 },
      { topic: "kinematics", afterS: 1 },
    ],
  });
  place = show(null);
});

async function draw(description: Described | null = described, more: typeof props = {}): Promise<void> {
  props = { ...props, ...more };
  const message = description ? create(DescriptionSchema, description) : undefined;
  show(<page.SceneView robotKey={ROBOT} stale={false} age={0} lostAt={null} {...props} description={message} />, place);
  await pass();
}
const scene = () => Scene.made.at(-1) as Scene;
const state = () => scene().states.at(-1) as SceneState;
async function loaded(description = described, more: typeof props = {}): Promise<void> {
  await draw(description, more);
  scene().loaded.resolve();
  await pass();
}
async function sendFrames(): Promise<void> {
  publish(`${ROBOT}/frames`, FrameTransformsSchema, {});
  await pass(300);
}
const waits = () => texts(".scene-word");
const staleWords = () => texts(".scene-stale");

test("the panel says what it waits for: description, model, position", async () => {
  await draw(null);
  expect([waits(), Scene.made]).toEqual([["Waiting for the robot's description…"], []]);
  await draw();
  expect(waits()).toEqual(["Loading the model…"]);
  expect(find("canvas").dataset.loaded).toBe("false");
  scene().loaded.resolve();
  await pass();
  expect([waits(), staleWords()]).toEqual([["Waiting for the robot's position…"], []]);
  expect(find("canvas").dataset.loaded).toBe("true");
  await sendFrames();
  expect(waits()).toEqual([]);
});

test("a browser without WebGL says so, and the page goes on", async () => {
  drawing.broken = true;
  await draw();
  expect(waits()).toEqual(["This browser has no WebGL: the 3-D view cannot be drawn. The video works."]);
});

test("a model that cannot be loaded is named until it is", async () => {
  await draw();
  scene().failed("hand", "busy");
  scene().failed("arm", "gone");
  await pass();
  expect(waits()).toEqual(["The model of hand could not be loaded: busy"]);
  scene().failed("hand", "");
  await pass();
  expect(waits()).toEqual(["The model of arm could not be loaded: gone"]);
  scene().failed("arm", "");
  await pass();
  expect(waits()).toEqual(["Loading the model…"]);
});

test("frames that stop make the picture stale, with their age", async () => {
  await loaded();
  await sendFrames();
  expect([state().stale, staleWords()]).toEqual([false, []]);
  await pass(2000);
  expect([state().stale, staleWords()]).toEqual([true, ["stale 2\u202fs"]]);
  expect(find("section").className).toContain("is-stale");
  await sendFrames();
  expect([state().stale, staleWords()]).toEqual([false, []]);
});

test.each([
  ["whose joints are stale", { stale: true, age: 7 }, true, ["stale 7\u202fs"]],
  ["whose joints have an unknown age", { stale: true, age: null }, true, ["stale, age unknown"]],
  ["without joints yet", { stale: true, age: undefined }, false, []],
  ["of a replay without joints yet", { stale: true, age: undefined, arm: "shown" }, true, ["no data yet"]],
  [
    "without a link",
    { stale: true, age: 7, lostAt: 1e12 },
    true,
    [expect.stringMatching(/^stale 7\u202fsno link since/)],
  ],
  ["of a replay without joints then", { arm: "absent" }, true, ["No joints were recorded of this moment."]],
  ["of a replay whose joints are coming", { arm: "coming" }, true, []],
] as const)("the picture of a robot %s is stale: %o", async (_, more, stale, words) => {
  await loaded(described, more as typeof props);
  expect([state().stale, staleWords()]).toEqual([stale, words]);
});

test("a paused replay sends no frames, and is not stale; it is marked as a replay, and plays at its rate", async () => {
  described = { ...described, replay: {}, cell: "c1" };
  await loaded();
  await sendFrames();
  publish(`${ROBOT}/replay`, ReplayStateSchema, { speed: 4 });
  await pass(3000);
  expect([state().stale, state().rate, staleWords(), texts(".replay-mark")]).toEqual([false, 4, [], ["replay"]]);
  expect([...watched]).not.toContain("robomesh/hall/*/description");
});

test("a replay does not wait for frames", async () => {
  await loaded({ ...described, replay: {} });
  expect(waits()).toEqual([]);
});

test("views are chosen by name, the free one first", async () => {
  await loaded();
  expect(texts(".choice button")).toEqual(["Free", "Front", "Close-up"]);
  expect([state().view.name, state().pose, state().moved]).toEqual(["free", null, undefined]);
  press("Front");
  expect(state().view.name).toBe("front");
});

test("a page that keeps the camera is asked for another view, and for poses", async () => {
  const setCamera = vi.fn();
  const pose = [1, 2, 3, 0, 0, 0];
  await loaded(described, { camera: { view: "close", pose }, setCamera });
  expect([state().view.name, state().pose]).toEqual(["close", pose]);
  press("Front");
  expect(setCamera.mock.calls).toEqual([[{ view: "front", pose: null }]]);
  expect([state().view.name, state().moved]).toEqual(["close", setCamera]);
  await draw(described, { camera: { view: "unknown", pose: null } });
  expect(state().view.name).toBe("free");
});

test("the free view is as far as the others show the arm's reach, unless the description has one", () => {
  const free = (...views: object[]) => page.viewsOf(create(DescriptionSchema, { views }))[0];
  const reach = Math.hypot(6, 1) / 3;
  expect(free(...VIEWS)).toMatchObject({ eye: { x: 1.2 * reach, z: 1 + 0.72 * reach }, target: { z: 1 } });
  const nominal = page.viewsOf(undefined)[0];
  expect(nominal).toMatchObject({ eye: { x: 1.2 * 1.1 }, target: { z: 0.45 * 1.1 }, up: { z: 1 } });
  expect(free({ name: "front" })).toEqual(nominal);
  const own = { name: "free", eye: { x: 9 } };
  const views = page.viewsOf(create(DescriptionSchema, { views: [...VIEWS, own] }));
  expect(views.map(({ name, eye }) => [name, eye?.x])).toEqual([
    ["free", 9],
    ["front", 6],
    ["close", 6],
  ]);
});

test("trail and frames are drawn when a person wants them", async () => {
  await loaded();
  expect([state().trail, state().frames]).toEqual([false, false]);
  const [trail = "", frames = ""] = texts(".toggle");
  press(trail);
  expect([state().trail, state().frames]).toEqual([true, false]);
  press(frames);
  expect([state().trail, state().frames]).toEqual([true, true]);
});

test("the arrow keys turn the camera, and no other key", async () => {
  await loaded();
  for (const name of ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "a"]) key("canvas", name);
  expect(scene().turns).toEqual([
    [-0.1, 0],
    [0.1, 0],
    [0, -0.1],
    [0, 0.1],
  ]);
});

test("only this robot's ghost is drawn, with the path and what is red", async () => {
  await loaded();
  overlays.ghostAt("robomesh/hall/other", [1]);
  overlays.redLinks.value = new Set(["table"]);
  overlays.toolPath.value = [[1, 2, 3]];
  await pass();
  expect(state()).toMatchObject({ ghost: null, red: new Set(["table"]), path: [[1, 2, 3]] });
  overlays.ghostAt(ROBOT, [1]);
  await pass();
  expect(state().ghost).toEqual([1]);
});

test("the shortest distance is drawn while it is known", async () => {
  await loaded();
  expect(state().nearest).toBeNull();
  const clearance = {
    distance: 0.0123,
    first: "hall/arm/hand",
    second: "hall/table",
    firstPoint: { x: 1 },
    secondPoint: { x: 2 },
  };
  publish(`${ROBOT}/kinematics`, KinematicStateSchema, { clearance }, { timeMs: 5000 });
  await pass(300);
  expect(state().nearest).toMatchObject({
    nearest: { level: "normal", text: "12.3\u202fmm", points: [{ x: 1 }, { x: 2 }] },
    sourceTime: 5000,
  });
  await pass(1500);
  expect(state().nearest).toBeNull();
});

test("other parts are added to each scene, and told of its end", async () => {
  const staged = vi.fn();
  await loaded(described, { staged });
  const first = scene();
  await draw({ ...described, title: "new" });
  expect([Scene.made.length, staged.mock.calls]).toEqual([1, [["stage"]]]);
  await draw({ ...described, links: [{ name: "other" }] });
  expect([Scene.made.length, first.disposed, staged.mock.calls.flat()]).toEqual([2, true, ["stage", null, "stage"]]);
  expect(waits()).toEqual(["Loading the model…"]);
  hide(place);
  expect([scene().disposed, staged.mock.calls.length]).toEqual([true, 4]);
});

test("the robots of its cell are looked for once the model is there", async () => {
  await draw({ ...described, cell: "c1" });
  expect([...watched]).not.toContain("robomesh/hall/*/description");
  scene().loaded.resolve();
  await pass(300);
  expect([...watched]).toContain("robomesh/hall/*/description");
});
