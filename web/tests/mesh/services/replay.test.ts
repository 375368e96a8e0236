// A replay: where it is, what it was asked, and whether what is shown belongs to its moment.

import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ReplayRequest_Action as Action,
  ControllerStateSchema,
  ReplayRequestSchema,
  ReplayStateSchema,
} from "../../../src/gen/robomesh_pb";
import type { Replay } from "../../../src/mesh/services/replay";
import type { Request } from "../../console";
import { answer, connect, newPage, next, publish, read, refuse, requests, watched } from "../../console";
import { use } from "../../shown";

let replay: Replay;
let make: (values?: object) => Replay;
const KEY = "robomesh/hall/replay-1";
const START_MS = 1e12;
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const stamp = () => timestampFromMs(Date.now());
const state = (values = {}) => ({
  start: timestampFromMs(START_MS),
  durationS: 100,
  positionS: 10,
  speed: 1,
  playing: true,
  ...values,
});
const report = (values = {}) => publish(`${KEY}/replay`, ReplayStateSchema, state({ timestamp: stamp(), ...values }));
const action = (request: Request) => {
  const { action, positionS, speed, loop } = read(request, ReplayRequestSchema);
  return [Action[action], positionS || speed || loop];
};
const reply = (request: Request, values = {}) =>
  answer(request, ReplayStateSchema, state({ timestamp: stamp(), ...values }));

beforeEach(async () => {
  newPage();
  const { Replay } = await import("../../../src/mesh/services/replay");
  await connect({ stale: [{ topic: "replay", afterS: 2 }] } as never);
  make = (values = {}) => new Replay(KEY, create(ReplayStateSchema, state(values)));
  replay = make();
});

test("between reports a replay goes on with its speed, to its end and not beyond", async () => {
  await after(1000);
  expect(replay.position()).toBeCloseTo(11);
  report({ speed: 10, positionS: 20 });
  await after(500);
  expect([replay.position(), replay.recordedMs()]).toEqual([25, START_MS + 25_000]);
  await after(60_000);
  expect(replay.position()).toBe(100);
  report({ playing: false, positionS: 30 });
  await after(1000);
  expect(replay.position()).toBe(30);
});

test("a report from before the last, and a stored one, change nothing", async () => {
  report({ positionS: 50 });
  report({ positionS: 10, timestamp: timestampFromMs(Date.now() - 1) });
  publish(`${KEY}/replay`, ReplayStateSchema, state({ positionS: 5 }), { live: false });
  expect(replay.position()).toBe(50);
});

test("a replay whose player is silent is gone", async () => {
  await after(1900);
  expect(replay.gone).toBe(false);
  await after(200);
  expect(replay.gone).toBe(true);
});

test("of many seeks one is on its way, and the newest follows it", async () => {
  for (const to of [20, 30, 40]) replay.seek(to);
  expect([replay.position(), requests.length]).toEqual([40, 1]);
  const first = await next();
  expect(action(first)).toEqual(["SEEK", 20]);
  reply(first, { positionS: 20 });
  const second = await next();
  expect(action(second)).toEqual(["SEEK", 40]);
  expect(replay.position()).toBe(40);
  reply(second, { positionS: 40 });
  await after(0);
  expect([replay.seeking, requests, replay.position()]).toEqual([false, [], 40]);
});

test("a seek stays within the recording, and one that failed leaves the replay where it is", async () => {
  replay.seek(900);
  expect(replay.position()).toBe(100);
  refuse(await next(), "no such moment");
  await after(0);
  expect([replay.problem.value, replay.seeking]).toEqual(["no such moment", false]);
  expect(replay.position()).toBeCloseTo(10, 0);
  replay.seek(-5);
  expect(action(await next())).toEqual(["SEEK", false]);
});

test("a replay begins where its first joints are, if that is soon and it does not play", async () => {
  replay.beginAt(0.3);
  expect(requests).toEqual([]);
  replay = make({ playing: false, positionS: 0 });
  replay.beginAt(0.6);
  expect(requests).toEqual([]);
  replay.beginAt(0.3);
  expect(action(await next())).toEqual(["SEEK", 0.3]);
});

test("at its end play begins at the start, and each request's problem is said until one succeeds", async () => {
  replay.play();
  const first = await next();
  expect(action(first)[0]).toBe("PLAY");
  refuse(first, "player is gone");
  await after(0);
  expect(replay.problem.value).toBe("player is gone");
  report({ positionS: 100, playing: false });
  replay.play();
  const both = [await next(), await next()];
  expect(both.map((each) => action(each)[0])).toEqual(["SEEK", "PLAY"]);
  for (const each of both) reply(each);
  await after(0);
  expect(replay.problem.value).toBe("");
});

test("pause, speed, loop and close are asked for", async () => {
  replay.pause();
  replay.setSpeed(5);
  replay.setLoop(true);
  replay.close();
  expect(requests.splice(0).map(action)).toEqual([
    ["PAUSE", false],
    ["SPEED", 5],
    ["LOOP", true],
    ["CLOSE", false],
  ]);
  replay.unfollow();
  expect(watched).toEqual(new Set());
});

test("it has played for the time since the last jump or change, at its own speed only", async () => {
  await after(1000);
  expect(replay.playedForMs()).toBe(1000);
  report({ positionS: 11 });
  expect(replay.playedForMs()).toBe(1000);
  report({ positionS: 60 });
  expect(replay.playedForMs()).toBe(0);
  await after(1000);
  report({ positionS: 61, speed: 2 });
  await after(1000);
  expect(replay.playedForMs()).toBe(0);
});

const sent = (positionS: number, topic = "joints") =>
  publish(`${KEY}/${topic}`, ControllerStateSchema, {}, { timeMs: START_MS + 1000 * positionS });

async function moment(of: Replay | null = replay, topic = "joints") {
  const { useMomentState } = await import("../../../src/mesh/services/replay-moment");
  return use(useMomentState, of, topic, 1);
}

test("a message is of the replay's moment for as long as it holds, and then absent", async () => {
  report({ playing: false });
  const used = await moment();
  expect(used.result).toBe("coming");
  sent(9.5);
  await after(60);
  expect(used.result).toBe("here");
  report({ playing: false, positionS: 10.6 });
  await after(60);
  expect(used.result).toBe("coming");
  await after(2100);
  expect(used.result).toBe("absent");
});

test("what does not come within 2 s of a jump is absent, and a seek that goes on waits for it", async () => {
  report({ playing: false });
  const used = await moment();
  await after(1900);
  expect(used.result).toBe("coming");
  await after(200);
  expect(used.result).toBe("absent");
  replay.seek(50);
  await after(500);
  expect(used.result).toBe("coming");
});

test("a publisher whose clock differs from the recorder's is still of the moment after it played along", async () => {
  const used = await moment();
  for (let s = 0; s < 3; s++) {
    report({ positionS: 10 + s });
    sent(5 + s);
    await after(1000);
  }
  report({ positionS: 13 });
  sent(8);
  await after(60);
  expect(used.result).toBe("here");
});

test("without a replay, a topic or a time there is nothing of a moment", async () => {
  expect([(await moment(null)).result, (await moment(replay, "")).result]).toEqual(["absent", "absent"]);
  const used = await moment();
  publish(`${KEY}/joints`, ControllerStateSchema, {}, { timeMs: 0 });
  await after(60);
  expect(used.result).toBe("coming");
  used.end();
  expect([...watched]).toEqual([`${KEY}/replay`]);
});
