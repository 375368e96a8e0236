// Delay of samples on their way: the cases of tests/robomesh/test_delay.py.

import { beforeEach, expect, test, vi } from "vitest";

let delay: typeof import("../../../src/mesh/console/sample-delay").sampleDelay;
const EPOCH_MS = 1.79e12;

beforeEach(async () => {
  vi.resetModules();
  delay = (await import("../../../src/mesh/console/sample-delay")).sampleDelay;
});

const delays = (rows: readonly (readonly [number, number])[], publisher = 1n, key = "k") =>
  rows.map(([sentS, gotS]) => delay(key, publisher, EPOCH_MS + 1000 * sentS, 1000 * gotS) / 1000);

test.each([
  [
    "is the time above the quickest",
    [
      [0, 0.04],
      [0.01, 0.05],
      [0.02, 1.54],
      [0.03, 1.55],
      [1.6, 1.64],
    ],
    [0, 0, 1.48, 1.48, 0],
  ],
  [
    "of a slow first one is 0, until two quicker ones came",
    [
      [0, 3],
      [3, 3.1],
      [3.1, 3.2],
      [0.2, 3.3],
    ],
    [0, 0, 0, 3],
  ],
  [
    "ignores one dated an hour ahead",
    [
      [0, 0.1],
      [3600, 0.2],
      [0.3, 0.4],
      [0.4, 0.5],
      [0.5, 2.6],
      [3605, 2.7],
      [0.6, 2.7],
    ],
    [0, 0, 0, 0, 2, 0, 2],
  ],
  [
    "ignores a first one dated ahead",
    [
      [3600, 0.1],
      [0.1, 0.2],
      [0.2, 0.3],
      [0.3, 2.4],
    ],
    [0, 0, 0, 2],
  ],
  [
    "may be long, when others came in time",
    [
      [0, 0],
      [0.1, 0.1],
      [0.2, 20.2],
    ],
    [0, 0, 20],
  ],
] as const)("the delay %s, whatever the clocks", (_, rows, expected) => {
  for (const offset of [0, 86_400, -3600.5]) {
    const found = delays(
      rows.map(([sent, got]) => [sent, got + offset] as const),
      BigInt(Math.round(offset + 1e6)),
    );
    for (const [i, each] of expected.entries()) expect(found[i]).toBeCloseTo(each, 1);
  }
});

test("a clock that drifts makes no sample late, and a silence does not hide that one is", () => {
  const drifting = delays(Array.from({ length: 36_000 }, (_, n) => [n * 0.1 * 0.9995, n * 0.1] as const));
  expect(Math.max(...drifting)).toBeLessThan(0.001);
  expect(
    delays(
      [
        [0, 0],
        [1, 1],
        [3600, 3600.5],
      ],
      2n,
    ).at(-1),
  ).toBeCloseTo(0.499, 3);
});

test("a replay, a sample without a time and another start of the publisher are not late", () => {
  expect(
    delays(
      [
        [0, 0],
        [1, 1],
        [1, 3],
      ],
      1n,
      "robomesh/hall/replay-1/joints",
    ),
  ).toEqual([0, 0, 0]);
  expect(delay("k", 1n, 0, 5)).toBe(0);
  expect(
    delays(
      [
        [0, 0],
        [1, 1],
      ],
      1n,
    ),
  ).toEqual([0, 0]);
  expect(delays([[1, 9]], 2n)).toEqual([0]);
});
