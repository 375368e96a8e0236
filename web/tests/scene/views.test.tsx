// What surrounds the 3-D view: topics over slow links, the age of its frames, its overlays, other robots, its poster.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { FrameTransformsSchema } from "../../src/gen/foxglove/FrameTransforms_pb";
import { DescriptionSchema } from "../../src/gen/robomesh_pb";
import type { RobotScene } from "../../src/scene/robot-scene";
import { connect, newPage, publish, say, watched } from "../console";
import { find, pass, send, texts } from "../hands";
import { hide, show, use } from "../shown";

const ROBOT = "robomesh/hall/arm";
const STALE = [{ topic: "frames", afterS: 1 }];

beforeEach(async () => {
  newPage();
  await connect({ site: "hall", stale: STALE });
});
const sendFrames = (robot = ROBOT, more = {}) =>
  publish(`${robot}/frames`, FrameTransformsSchema, { transforms: [{ childFrameId: "a" }] }, more);

test.each([
  [ROBOT, false, ["frames", "joints"]],
  ["robomesh/mill/arm", true, ["joints/slow", "joints/slow"]],
  ["robomesh/mill/replay-1", false, ["frames", "joints"]],
])("%s is at another site: %s", async (robot, remote, topics) => {
  const page = await import("../../src/scene/topic-selection");
  const chosen = () => [page.framesTopic(robot), page.jointsTopic(robot)];
  expect([page.isRemote(robot), chosen()]).toEqual([remote, topics]);
  page.selectTopics(robot, "all");
  page.selectTopics("robomesh/mill/other", "slow");
  expect(chosen()).toEqual(["frames", "joints"]);
  page.selectTopics(robot, "slow");
  expect(chosen()).toEqual(["joints/slow", "joints/slow"]);
});

test("before the console has greeted no robot is at another site", async () => {
  newPage();
  const { isRemote } = await import("../../src/scene/topic-selection");
  expect(isRemote("robomesh/mill/arm")).toBe(false);
});

test("the age of the frames is that of the newest, and it grows", async () => {
  const { useFramesAge } = await import("../../src/scene/frames-age");
  const age = use(useFramesAge, ROBOT, "frames");
  expect([age.result, watched]).toEqual([undefined, new Set([`${ROBOT}/frames`])]);
  sendFrames();
  await pass(2000);
  expect(age.result).toBeCloseTo(2, 0);
  sendFrames(ROBOT, { live: false });
  await pass(300);
  expect(age.result).toBeNull();
  age.end();
  expect(watched.size).toBe(0);
});

test("a ghost is of one robot, and hidden by no positions", async () => {
  const { ghost, ghostAt } = await import("../../src/scene/overlays");
  ghostAt(ROBOT, [1, 2]);
  expect(ghost.value).toEqual({ robotKey: ROBOT, positions: [1, 2] });
  ghostAt(ROBOT, null);
  expect(ghost.value).toBeNull();
});

test("the other robots of the cell stand beside this one, grey when stale, and go", async () => {
  const { Neighbours } = await import("../../src/scene/neighbours");
  const arms = new Map<string, { placeFrames: ReturnType<typeof vi.fn>; setStale: ReturnType<typeof vi.fn> }>();
  const scene = {
    addNeighbour: (prefix: string) => {
      const arm = { placeFrames: vi.fn(), setStale: vi.fn(), prefix };
      arms.set(prefix, arm);
      return arm;
    },
    removeNeighbour: ({ prefix }: { prefix: string }) => arms.delete(prefix),
  } as unknown as RobotScene;
  const place = show(<Neighbours robotKey={ROBOT} cell="c1" scene={scene} />);
  const describe = (robot: string, more = {}) =>
    publish(`robomesh/hall/${robot}/description`, DescriptionSchema, { cell: "c1", ...more });
  describe("arm");
  describe("arm2");
  describe("far", { cell: "c2" });
  describe("replay-1", { replay: {} });
  await pass(100);
  expect([...arms.keys()]).toEqual(["hall/arm2"]);
  sendFrames("robomesh/hall/arm2");
  await pass(300);
  const [arm] = arms.values();
  expect(arm?.placeFrames.mock.calls[0]?.[0]).toEqual(
    create(FrameTransformsSchema, { transforms: [{ childFrameId: "a" }] }),
  );
  expect(arm?.setStale.mock.calls).toEqual([[false]]);
  await pass(1000);
  expect(arm?.setStale).toHaveBeenLastCalledWith(true);
  hide(place);
  expect([arms.size, watched.size]).toEqual([0, 0]);
});

test("the last picture stands in until the 3-D view draws, and says that it is not live", async () => {
  const { Poster } = await import("../../src/scene/poster");
  const place = show(<Poster robotKey={ROBOT} view="front" why="Loading…" />);
  expect([texts("img"), texts("p")]).toEqual([[], ["Loading…"]]); // no renderer
  say({ case: "presence", value: { key: "robomesh/hall/-/alive/renderer/1", alive: true } });
  await pass();
  const image = () => find<HTMLImageElement>("img");
  expect([image().getAttribute("src"), image().alt, image().hidden]).toEqual([
    ...["/image/hall/arm/front.jpg", "Last picture of arm, view Front", true],
  ]);
  const first = image();
  send("img", new Event("error"));
  await pass(900);
  expect(image()).toBe(first);
  await pass(200);
  expect(image()).not.toBe(first); // asked for again
  send("img", new Event("load"));
  expect([image().hidden, texts("p")]).toEqual([
    false,
    [expect.stringMatching(/^Picture of .*, not live\. Loading…$/)],
  ]);
  act(() => void show(<Poster robotKey={ROBOT} view="a/b" why="Loading…" />, place));
  expect([image().hidden, image().getAttribute("src"), texts("p")]).toEqual([
    true,
    "/image/hall/arm/a%2Fb.jpg",
    ["Loading…"],
  ]);
});
