// Drawing on demand, and never before the GPU has finished the last frame.

import { beforeEach, expect, test, vi } from "vitest";
import { DrawLoop } from "../../../src/scene/canvas/draw-loop";
import { fakeRenderer } from "./gl";

const draw = vi.fn<(at: number) => boolean>();
const drawn = vi.fn<(tookMs: number, at: number) => void>();
let gpu: ReturnType<typeof fakeRenderer>["gpu"];
let gl: ReturnType<typeof fakeRenderer>["gl"];
let loop: DrawLoop;

beforeEach(() => {
  vi.useFakeTimers();
  draw.mockReset().mockReturnValue(true);
  drawn.mockReset();
  const fake = fakeRenderer();
  ({ gpu, gl } = fake);
  loop = new DrawLoop(fake.renderer, draw, drawn);
});
const pass = (ms: number) => vi.advanceTimersByTime(ms);

test("an idle page requests no frame", () => {
  pass(1000);
  loop.wake();
  loop.wake();
  pass(100);
  expect([draw.mock.calls.length, drawn.mock.calls.length, vi.getTimerCount()]).toEqual([1, 1, 0]);
});

test("no frame is drawn before the GPU has finished the last, and its duration is until then", () => {
  gpu.finished = false;
  loop.wake();
  pass(16);
  const began = performance.now();
  expect([draw.mock.calls, gl.flush.mock.calls.length]).toEqual([[[began]], 1]);
  loop.wake();
  loop.hurry();
  pass(100);
  expect([draw.mock.calls.length, drawn.mock.calls.length]).toEqual([1, 0]);
  gpu.finished = true;
  pass(8);
  const [took, at] = drawn.mock.calls[0] ?? [0, 0];
  expect(took).toBe(at - began);
  expect(took).toBeGreaterThan(90);
  expect(gl.deleteSync).toHaveBeenCalledOnce();
  pass(16);
  expect(draw).toHaveBeenCalledTimes(2);
});

test("a lost context ends the wait", () => {
  gpu.finished = false;
  loop.wake();
  pass(40);
  gpu.lost = true;
  pass(8);
  expect(drawn).toHaveBeenCalledOnce();
});

test("what changes while a frame is drawn is drawn next, and nothing else", () => {
  draw.mockImplementationOnce(() => (loop.wake(), false)).mockReturnValue(false);
  loop.wake();
  pass(200);
  expect([draw.mock.calls.length, drawn.mock.calls.length, vi.getTimerCount()]).toEqual([2, 0, 0]);
});

test("nothing is drawn in a pause, the longest counts, and hurry ends it", () => {
  const begin = performance.now();
  loop.pauseUntil(begin + 500);
  loop.pauseUntil(begin + 100);
  loop.wake();
  pass(499);
  expect(draw).not.toHaveBeenCalled();
  pass(20);
  expect(draw).toHaveBeenCalledOnce();
  pass(20);
  loop.pauseUntil(performance.now() + 500);
  loop.wake();
  pass(50);
  loop.hurry();
  pass(17);
  expect(draw).toHaveBeenCalledTimes(2);
});

test("after its end nothing is drawn", () => {
  loop.wake();
  loop.dispose();
  loop.wake();
  pass(100);
  expect([draw.mock.calls.length, vi.getTimerCount()]).toEqual([0, 0]);
});
