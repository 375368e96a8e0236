// The share of time that 3-D takes: the rate gives way first, then the quality, which returns slowly.

import { beforeEach, expect, test, vi } from "vitest";
import { DrawBudget, qualities } from "../../../src/scene/canvas/draw-budget";

let budget: DrawBudget;
let at = 0;

beforeEach(() => {
  vi.stubGlobal("devicePixelRatio", 3);
  budget = new DrawBudget(qualities(false));
  at = 0;
});

interface Frame {
  at: number;
  pause: number;
  ratio: number;
  shadows: boolean;
}
/** Draw frames of a duration [ms]. */
function draw(tookMs: number, count: number): Frame[] {
  return Array.from({ length: count }, () => {
    const pause = budget.take(tookMs, (at += tookMs));
    at += pause;
    return { at, pause, ratio: budget.quality.pixelRatio, shadows: budget.quality.shadows };
  });
}
const last = (frames: Frame[]) => frames.at(-1);

test("fast frames are drawn without a pause in the best quality, of at most 2 pixels", () => {
  expect(last(draw(49, 100))).toMatchObject({ pause: 0, ratio: 2, shadows: true });
  expect(last(draw(50, 1))).toMatchObject({ pause: 150, ratio: 2 });
});

test("two slow frames change no quality", () => {
  draw(8, 10);
  expect(last(draw(900, 2))?.ratio).toBe(2);
  draw(8, 1);
  expect(last(draw(900, 2))?.ratio).toBe(2);
});

test("slow frames give way in rate and then in quality, down to the lowest", () => {
  // Shadows and extra pixels go first; a quarter of the time is left to drawing.
  expect(last(draw(70, 10))).toMatchObject({ ratio: 1, shadows: false, pause: 210 });
  const many = draw(300, 30);
  expect([...new Set(many.map(({ ratio }) => ratio))]).toEqual([1, 0.7, 0.5]);
  // At least two frames a second, until the quality cannot be lower.
  for (const { pause, ratio } of many) expect(pause).toBe(ratio > 0.5 ? 360 : 900);
  expect(last(draw(5000, 1))?.pause).toBe(2000);
});

test("quality returns slowly", () => {
  draw(300, 30);
  const from = at;
  const raised = draw(10, 5000).find(({ ratio }) => ratio > 0.5);
  expect((raised?.at ?? 0) - from).toBeGreaterThanOrEqual(10_000);
  expect(budget.quality).toBe(budget.best);
});

test("a quality that was soon too slow is tried again after twice the time, at most 2 min", () => {
  draw(300, 30);
  const waits: number[] = [];
  for (let i = 0; i < 6; i++) {
    const from = at;
    while (budget.quality.pixelRatio < 0.7) draw(10, 1);
    waits.push(Math.round((at - from) / 10_000));
    draw(300, 3);
  }
  expect(waits).toEqual([1, 2, 4, 8, 12, 12]);
});

test("frames that are neither fast nor slow raise nothing", () => {
  draw(300, 30);
  expect(last(draw(26, 3000))?.ratio).toBe(0.5);
});

test("a software renderer spares shadows and extra pixels from the beginning", () => {
  budget = new DrawBudget(qualities(true));
  expect(budget.quality).toMatchObject({ pixelRatio: 1, shadows: false });
  expect(last(draw(119, 100))?.ratio).toBe(1);
  expect(last(draw(120, 3))?.ratio).toBe(0.7);
});
