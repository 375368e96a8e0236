// The numbers that plots get: live ones, and the past from the recorder.

import { timestampMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import type { PlotFeed } from "../../../../src/features/robot/plots/plot-feed";
import { JointStatesSchema } from "../../../../src/gen/foxglove/JointStates_pb";
import { SeriesAnswerSchema, SeriesRequestSchema } from "../../../../src/gen/robomesh_pb";
import type { Request } from "../../../console";
import {
  answer,
  connect,
  newPage,
  next,
  publish,
  read,
  refuse,
  requests,
  say,
  stayConnected,
  watched,
} from "../../../console";
import { ARM } from "../../../recorded";

const WAIST = "joints/waist/position";
const ELBOW = "joints/elbow/position";
const HOUR = 3600;
let feed: PlotFeed;
let now: () => number;

beforeEach(async () => {
  newPage();
  const module = await import("../../../../src/features/robot/plots/plot-feed");
  const clock = await import("../../../../src/mesh/console/age-clock");
  now = () => clock.ageClock() / 1000;
  await connect({
    values: [
      { topic: "joints", schema: "foxglove.JointStates" },
      { topic: "controller", schema: "robomesh.ControllerState" },
    ],
    stale: [{ topic: "joints", afterS: 0.5 }],
  });
  feed = new module.PlotFeed(ARM, "joints");
  return () => feed.end();
});

const want = (...wanted: [name: string, span: number][]) => feed.want(wanted.map(([name, span]) => ({ name, span })));
const settle = () => vi.advanceTimersByTimeAsync(0);
function send(position: number, header: Parameters<typeof publish>[3] = {}, topic = "joints"): void {
  publish(`${ARM}/${topic}`, JointStatesSchema, { joints: [{ name: "waist", position }] }, header);
}
async function startRecorder(): Promise<void> {
  say({ case: "presence", value: { key: "robomesh/test/-/alive/recorder/1", alive: true } });
  await stayConnected(0.1);
}
/** Answer with the value 7 at 20 s of what was asked, recorded in these parts of it [s]. */
function answerPast(request: Request, ...recorded: [startS: number, endS: number][]): void {
  answer(request, SeriesAnswerSchema, {
    series: [{ name: WAIST, unit: "rad", timesS: [20], lowest: [6], highest: [7] }],
    recorded: recorded.map(([startS, endS]) => ({ startS, endS })),
  });
}
/** Return the seconds of the past that a request is about. */
function asked(request: Request): number {
  const { start, end } = read(request, SeriesRequestSchema);
  return (timestampMs(end as NonNullable<typeof end>) - timestampMs(start as NonNullable<typeof start>)) / 1000;
}

test("several plots of a topic watch it once, and a topic without a plot is not watched", () => {
  want([WAIST, 60], [ELBOW, 60], [WAIST, 10], ["controller/rate_hz", 60]);
  expect([...watched]).toEqual([`${ARM}/joints`, `${ARM}/controller`]);
  want([ELBOW, 60]);
  expect([...watched]).toEqual([`${ARM}/joints`]);
  feed.end();
  expect([...watched]).toEqual([]);
});

test("a value of no topic is not watched, and one of an unknown topic never arrives", () => {
  want(["unknown/value", 60]);
  expect([...watched]).toEqual([]);
  expect([feed.has("unknown/value"), feed.newest("unknown/value"), feed.liveFrom("unknown/value")]).toEqual([
    false,
    null,
    Infinity,
  ]);
});

test("a value is shown until it is stale, and stays known", async () => {
  want([WAIST, 60]);
  expect([feed.newest(WAIST), feed.has(WAIST)]).toEqual([null, false]);
  send(0);
  expect([feed.newest(WAIST), feed.has(WAIST)]).toEqual([0, true]);
  await stayConnected(0.5);
  expect(feed.newest(WAIST)).toBe(0);
  await stayConnected(0.1);
  expect([feed.newest(WAIST), feed.has(WAIST)]).toEqual([null, true]);
});

test("a robot's own stale time counts for its joints; a topic without one expires after an hour", () => {
  feed.description = { staleAfterS: 2 } as NonNullable<PlotFeed["description"]>;
  expect([feed.holdOf(WAIST), feed.holdOf("controller/rate_hz")]).toEqual([2, HOUR]);
});

test("a state that is not live, and a number that is not finite, are not plotted", () => {
  want([WAIST, 60]);
  send(1, { live: false });
  send(Number.NaN);
  expect(feed.has(WAIST)).toBe(false);
});

test("over a slow link the thinned joints are plotted by the same names", async () => {
  const module = await import("../../../../src/features/robot/plots/plot-feed");
  feed = new module.PlotFeed(ARM, "joints/slow");
  want([WAIST, 60]);
  send(3, {}, "joints/slow");
  expect([...watched, feed.newest(WAIST)]).toEqual([`${ARM}/joints/slow`, 3]);
});

test("a delayed sample is plotted when it was measured, also by a clock that is wrong", async () => {
  want([WAIST, 60]);
  const wrong = -86_400_000;
  send(1, { timeMs: Date.now() + wrong });
  const first = now();
  await stayConnected(0.3);
  send(2, { timeMs: Date.now() + wrong - 200 });
  const buckets = feed.buckets(WAIST, 60);
  expect(buckets?.newest(first + 0.2, 0.18)).toEqual({ low: 2, high: 2 });
  expect(buckets?.newest(now(), 0.15)).toBeNull();
  expect(feed.liveFrom(WAIST)).toBeCloseTo(first, 3);
});

test("after the publisher's clock was set back, samples are plotted at the right edge again", async () => {
  want([WAIST, 60]);
  send(1);
  await stayConnected(0.2);
  send(2, { timeMs: Date.now() - 6000 });
  expect(feed.buckets(WAIST, 60)?.newest(now(), 0.02)?.low).toBe(2);
});

test("a sample that was overtaken does not become the newest value", async () => {
  want([WAIST, 60]);
  send(1);
  await stayConnected(0.2);
  send(2);
  send(3, { timeMs: Date.now() - 100 });
  expect(feed.newest(WAIST)).toBe(2);
});

test.each([
  ["less than a pixel", WAIST, 2e-4, true],
  ["visibly", WAIST, 4e-4, false],
  ["a little, in a unit without a usual range", "joints/waist/effort", 2e-4, false],
])("a curve that changes %s is redrawn: %s by %s", async (_, name, by, level) => {
  want([name, 10]);
  for (let i = 0; i < 50; i++) {
    const value = i === 30 ? 1 + by : 1;
    publish(`${ARM}/joints`, JointStatesSchema, { joints: [{ name: "waist", position: value, effort: value }] });
    await stayConnected(0.4);
  }
  expect(feed.isLevel(name, 10, now())).toBe(level);
  expect(feed.isLevel(name, 3, now())).toBe(true);
  await stayConnected(0.6);
  expect(feed.isLevel(name, 3, now())).toBe(false);
});

test("without a recorder the plot says so, and asks nothing", async () => {
  want([WAIST, HOUR]);
  expect(feed.pastOf(HOUR).reads).toBe(1);
  await settle();
  expect(feed.pastOf(HOUR)).toEqual({ reads: 0, problem: "no recorder answers at this site", recorded: [] });
  expect(requests).toEqual([]);
});

test("a long plot reads its past, and soon its newest part again", async () => {
  await startRecorder();
  send(1);
  want([WAIST, HOUR]);
  const first = await next();
  expect(first.key).toBe("robomesh/test/-/recordings/series/page1");
  const { robot, values, points } = read(first, SeriesRequestSchema);
  expect([robot, values, points]).toEqual(["arm", [WAIST], 3001]);
  expect(asked(first)).toBeCloseTo(HOUR * (3001 / 3000), 3);
  answerPast(first, [0, 100], [50, 200], [300, 400]);
  await settle();
  const { reads, problem, recorded } = feed.pastOf(HOUR);
  expect([reads, problem]).toEqual([0, ""]);
  const start = now() - HOUR;
  expect(recorded.map(({ from, to }) => [from, to].map((at) => Math.round(at - start)))).toEqual([
    [-0, 200],
    [300, 400],
  ]);
  expect(feed.buckets(WAIST, HOUR)?.newest(start + 21, 2)).toEqual({ low: 6, high: 7 });
  await stayConnected(4);
  const again = await next();
  expect(asked(again)).toBeGreaterThanOrEqual(15);
  expect(asked(again)).toBeLessThan(18);
  answerPast(again);
  await stayConnected(60);
  expect(requests).toEqual([]);
});

test("the past is asked for by the publisher's clock, once a live value has shown it", async () => {
  await startRecorder();
  want([WAIST, 60]);
  send(1, { timeMs: Date.now() - 86_400_000 });
  want([WAIST, HOUR]);
  const { end } = read(await next(), SeriesRequestSchema);
  expect(Math.abs(timestampMs(end as NonNullable<typeof end>) - (Date.now() - 86_400_000))).toBeLessThan(3000);
});

test("a longer plot begins with the live minute, and the recorder does not replace it", async () => {
  await startRecorder();
  want([WAIST, 60]);
  send(1);
  await stayConnected(0.1);
  want([WAIST, 60], [WAIST, HOUR]);
  answerPast(await next());
  expect(feed.buckets(WAIST, HOUR)?.newest(now(), 2)).toEqual({ low: 1, high: 1 });
  want([WAIST, 600]);
  expect(feed.buckets(WAIST, HOUR)).toBeUndefined();
});

test("after a gap in the live values, the recorder is asked for it", async () => {
  await startRecorder();
  want([WAIST, HOUR], [ELBOW, 60]);
  answerPast(await next());
  await stayConnected(5);
  answerPast(await next());
  send(1);
  await stayConnected(20);
  send(2);
  await stayConnected(0.4);
  send(3);
  await stayConnected(3.5);
  expect(requests).toEqual([]);
  const request = await next();
  expect(asked(request)).toBeGreaterThanOrEqual(35);
  expect(asked(request)).toBeLessThan(39);
  expect(read(request, SeriesRequestSchema).values).toEqual([WAIST]);
  answerPast(request);
  await stayConnected(10);
  expect(requests).toEqual([]);
});

test("a plot that was closed asks for nothing more, and an answer to it is ignored", async () => {
  await startRecorder();
  want([WAIST, HOUR]);
  const request = await next();
  feed.end();
  answerPast(request);
  await stayConnected(10);
  expect([requests, feed.buckets(WAIST, HOUR)]).toEqual([[], undefined]);
});

test("a refused request is a problem in words; the next answer removes it", async () => {
  await startRecorder();
  want([WAIST, HOUR]);
  refuse(await next(), "the disk is gone");
  await settle();
  expect(feed.pastOf(HOUR).problem).toBe("the disk is gone");
  await stayConnected(4);
  answerPast(await next());
  await settle();
  expect(feed.pastOf(HOUR).problem).toBe("");
});

test.each([
  ["at once, is not repeated: nothing receives it", 0, 1],
  ["after a long time, is repeated three times: the recorder goes on with it", 20, 4],
])("a request without an answer %s", async (_, seconds, attempts) => {
  await startRecorder();
  await stayConnected(20);
  want([WAIST, HOUR]);
  for (let left = attempts; left; left--) {
    const request = await next();
    const newest = seconds && left === attempts ? await next() : null;
    await stayConnected(seconds);
    refuse(request);
    if (newest) answerPast(newest);
    await settle();
  }
  expect([requests, feed.pastOf(HOUR)]).toEqual([
    [],
    { reads: 0, problem: "no recorder answers at this site", recorded: [] },
  ]);
});
