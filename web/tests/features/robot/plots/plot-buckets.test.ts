// A plotted value's last minutes: every peak is kept, and a gap is not bridged.

import { expect, test } from "vitest";
import { Buckets, columnsOf } from "../../../../src/features/robot/plots/plot-buckets";

type Sample = readonly [at: number, value: number];
const SPAN = 60;

function filled(samples: readonly Sample[], span = SPAN): Buckets {
  const made = new Buckets(span);
  for (const [at, value] of samples) made.take(at, value);
  return made;
}
function columns(samples: readonly Sample[], from: number, to: number, most: number, factor = 1, holds = 1) {
  const [times = [], low = [], high = []] = columnsOf([{ buckets: filled(samples), holds, factor }], from, to, most, [
    [],
  ]);
  return { times: times as number[], low, high };
}
/** Samples from a time on, with the values 0, 1, 2, ... */
const rising = (from: number, count: number, hz = 100): Sample[] =>
  Array.from({ length: count }, (_, i) => [from + i / hz, i] as const);

test.each([400, 7000])("%i columns have the lowest and the highest of what each one covers, and a gap", (most) => {
  const samples = rising(100.004, 17_990, 300)
    .filter((_, i) => i < 6000 || i >= 6900)
    .map(([at, i]) => [at, i === 1234 ? 99 : Math.sin(12.9898 * i)] as const);
  const { times, low, high } = columns(samples, 100, 160, most);
  const [first = 0, second = 0] = times;
  const width = second - first;
  expect(times.length).toBeLessThanOrEqual(Math.min(most, 6000) + 2);
  expect(times.length).toBeGreaterThan(Math.min(most, 6000) / 2);
  const expected = new Map<number, number[]>();
  for (const [at, value] of samples) {
    const column = Math.floor((at - first + width / 2) / width);
    expected.set(column, [...(expected.get(column) ?? []), value]);
  }
  const drawn = low.flatMap((cell, i) => (typeof cell === "number" ? [[i, cell, high[i]]] : []));
  expect(drawn).toEqual([...expected].map(([i, values]) => [i, Math.min(...values), Math.max(...values)]));
  expect(Math.max(...high.map((cell) => cell ?? 0))).toBe(99);
  const gaps = times.filter((_, i) => low[i] === null && high[i] === null);
  expect(gaps).toHaveLength(1);
  expect(gaps[0]).toBeGreaterThan(120 - width);
  expect(gaps[0]).toBeLessThan(123);
});

test("what is older than the span is forgotten, and a repeated or an old sample changes nothing", () => {
  const once = rising(1000.004, 20_000);
  const twice = [...once, ...once.slice(-500), [1000, 1e9] as const];
  const drawn = columns(once, 1130, 1200, 50_000);
  expect(columns(twice, 1130, 1200, 50_000)).toEqual(drawn);
  const kept = drawn.times.filter((_, i) => typeof drawn.low[i] === "number");
  expect(kept[0]).toBeCloseTo(1140, 1);
  expect(kept.at(-1)).toBeCloseTo(1199.99, 1);
});

test.each([
  [0.9, 0],
  [1.2, 1],
])("two samples %s s apart have %i gap between them, if a value is valid for 1 s", (apart, gaps) => {
  const { low } = columns([[50, 1] as const, [50 + apart, 2] as const], 40, 60, 1000);
  expect(low.filter((cell) => cell === null)).toHaveLength(gaps);
});

test("values are drawn in the unit of the plot", () => {
  const { low, high } = columns([[50, -1] as const, [50.0001, 2] as const], 49, 51, 100, 1000);
  expect([low.find(Number.isFinite), high.find(Number.isFinite)]).toEqual([-1000, 2000]);
});

test("the earlier arrays are filled again, without the curves of before", () => {
  const of = (count: number) =>
    Array.from({ length: count }, () => ({ buckets: filled([[50, 1]]), holds: 1, factor: 1 }));
  const reused = columnsOf(of(3), 40, 60, 100, [[]]);
  const again = columnsOf(of(1), 40, 50, 100, reused);
  expect(again).toBe(reused);
  expect(again).toHaveLength(3);
  expect(new Set(again.map((each) => each.length)).size).toBe(1);
});

test.each([
  ["at the sample", 50, 1, { low: -1, high: 2 }],
  ["later, within the time", 50.9, 1, { low: -1, high: 2 }],
  ["too late", 51.1, 1, null],
  ["before it", 49.9, 1, null],
])("a value under the pointer, %s: %s s", (_, at, back, expected) => {
  expect(
    filled([
      [50, -1],
      [50.0001, 2],
    ]).newest(at, back),
  ).toEqual(expected);
});

test("a longer span begins with what the shorter one has, and a copy keeps what it had", () => {
  const short = filled([
    [50, 1],
    [50.001, 5],
  ]);
  const long = new Buckets(3600);
  long.takeAll(short);
  const copied = long.copy();
  long.take(50.1, 9);
  expect([long.newest(50.3, 1)?.high, copied.newest(50.3, 1)]).toEqual([9, { low: 1, high: 5 }]);
});
