// Playback of an arm's frames at the display's rate.

import { create } from "@bufbuild/protobuf";
import { beforeEach, expect, test } from "vitest";
import { FrameTransformsSchema } from "../../../src/gen/foxglove/FrameTransforms_pb";
import { FramePlayer } from "../../../src/scene/parts/frame-player";

const LATE = 1000; // between the publisher's and the page's clock [ms]
const BEHIND = 60;
let player: FramePlayer;

beforeEach(() => void (player = new FramePlayer()));

const frames = (x: number, name = "tool") =>
  create(FrameTransformsSchema, { transforms: [{ childFrameId: name, translation: { x } }] });
/** Take the tool's place `x` of a source time [ms]. */
const add = (time: number, x: number, arrived = time + LATE) => player.add(frames(x), time, arrived);
/** The tool's drawn place at a source time; null: as before. */
function drawn(time: number, rate = 1): number | null {
  const place = player.at((time + LATE) / rate + BEHIND)?.get("tool")?.elements[12];
  return place === undefined ? null : Number(place.toFixed(6));
}

test("nothing is drawn before the first frames", () => {
  expect([player.at(5000), player.moving]).toEqual([null, false]);
});

test("the arm is drawn between the two frames around the drawn time, and never beyond the newest", () => {
  expect([add(0, 0), add(50, 1)]).toEqual([true, true]);
  expect([drawn(-20), drawn(25), player.shown, player.moving, drawn(80)]).toEqual([0, 0.5, 25, true, 1]);
  expect(player.shown).toBe(50);
});

test("an arm at rest is not drawn again until it moves", () => {
  for (const time of [0, 50, 100]) add(time, 1);
  expect([drawn(100), drawn(101), player.moving]).toEqual([1, null, false]);
  expect(add(150, 1 + 0.9e-4)).toBe(false); // less than a pixel
  expect([drawn(150), player.shown]).toEqual([null, 150]);
  expect(add(200, 1.01)).toBe(true);
  expect([drawn(175), drawn(200), drawn(201)]).toEqual([1.005, 1.01, null]);
  player.touch();
  expect(drawn(202)).toBe(1.01);
});

test("an arm that begins to move begins at its last frame at rest", () => {
  for (const time of [0, 50, 100, 150]) add(time, 0);
  add(200, 1);
  expect([drawn(150), drawn(175)]).toEqual([0, 0.5]);
});

test.each([
  ["a new publisher's earlier time", -500],
  ["the same time again", 50],
  ["a gap of more than 1 s", 1051],
])("after %s nothing is drawn in between", (_, time) => {
  add(0, 0);
  add(50, 1);
  add(time, 3);
  expect(drawn(time - 1)).toBe(3);
});

test("a gap of 1 s is drawn across, and of a fast replay a longer one", () => {
  add(0, 0);
  add(1000, 1);
  expect(drawn(500)).toBe(0.5);
  player.setRate(4);
  add(2000, 0, 2500);
  add(5500, 1, 3375);
  expect(player.at(2500 - 500 + 500 + BEHIND + 437.5)?.get("tool")?.elements[12]).toBeCloseTo(0.5);
});

test("a slow replay's frames are drawn as slowly", () => {
  player.setRate(0.5);
  add(0, 0, 1000);
  add(50, 1, 1100);
  expect(player.at(1000 + 50 + BEHIND)?.get("tool")?.elements[12]).toBeCloseTo(0.5);
});

test("another rate keeps the newest frames", () => {
  add(0, 0);
  add(50, 1);
  player.setRate(2);
  player.setRate(2);
  expect(player.at(9999)?.get("tool")?.elements[12]).toBe(1);
});

test("one frame that was fast or late changes little, a pause of a replay everything", () => {
  add(0, 0);
  add(50, 1, 50 + LATE + 300); // late
  expect(drawn(25 + 0.05)).toBe(0.5);
  add(100, 2, 100 + LATE - 10); // the fastest counts
  expect(drawn(75 - 10)).toBe(1.5);
  for (let time = 150; time < 300; time += 50) add(time, 0, time + 5000);
  expect(player.at(225 + 5000 + BEHIND)?.get("tool")?.elements[12]).toBeCloseTo(0);
  expect(player.shown).toBeCloseTo(225);
});

test("the path of a frame has each of its positions once, up to the drawn time", () => {
  for (const [i, time] of [0, 50, 100].entries()) add(time, i);
  const passed = (time: number) => (drawn(time), player.passed("tool").map(({ x }) => x));
  expect([passed(60), passed(70), passed(100), player.passed("hand")]).toEqual([[0, 1], [], [2], []]);
  add(-500, 7);
  expect(passed(-500)).toEqual([7]);
});

test("of a late page the last frames are kept", () => {
  for (let i = 0; i < 20; i++) add(50 * i, i);
  expect(drawn(0)).toBe(8);
});

test("frames in other frames are placed in the site, whatever their order, also without an end", () => {
  const half = Math.SQRT1_2;
  const transforms = [
    { childFrameId: "tool", parentFrameId: "arm", translation: { x: 1 } },
    { childFrameId: "arm", parentFrameId: "site", translation: { x: 5 }, rotation: { x: 0, y: 0, z: half, w: half } },
    { childFrameId: "a", parentFrameId: "b" },
    { childFrameId: "b", parentFrameId: "a" },
  ];
  player.add(create(FrameTransformsSchema, { transforms }), 0, 0);
  const placed = player.at(1000)?.get("tool");
  expect(placed?.elements.slice(12, 15).map((each) => Number(each.toFixed(6)))).toEqual([5, 1, 0]);
  expect(placed?.elements[1]).toBeCloseTo(1); // its x axis is the site's y axis
});

test("a frame that appears is placed at once, and counts as a motion", () => {
  for (const time of [0, 50, 100]) add(time, 0);
  drawn(100);
  const both = create(FrameTransformsSchema, {
    transforms: [{ childFrameId: "tool" }, { childFrameId: "lid", translation: { x: 3 } }],
  });
  expect(player.add(both, 150, 150 + LATE)).toBe(true);
  expect(player.at(125 + LATE + BEHIND)?.get("lid")?.elements[12]).toBe(3);
  expect(player.add(frames(0, "lid"), 200, 200 + LATE)).toBe(true);
  expect(player.add(frames(0, "tool"), 250, 250 + LATE)).toBe(true);
});
