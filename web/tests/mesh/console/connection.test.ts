// The page's connection: what is live, what arrives, and how a stop finds its way.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { fromBinary } from "@bufbuild/protobuf";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ControllerStateSchema,
  FromPageSchema,
  LeaseAnswerSchema,
  LeaseRequestSchema,
  StopAnswerSchema,
  StopRequestSchema,
} from "../../../src/gen/robomesh_pb";
import type { Sample } from "../../../src/mesh/console/connection";
import { answer, connect, newPage, next, publish, refuse, requests, say, sockets, stall, watched } from "../../console";

let page: typeof import("../../../src/mesh/console/connection");
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const own = () => sockets.findLast(({ path }) => path === "/mesh");
const ofStops = () => sockets.findLast(({ path }) => path === "/mesh/stop");
const paths = () => sockets.map(({ path }) => path);
const state = { rateHz: 1 };
const ask = (key = "r/lease") => page.ask(key, LeaseRequestSchema, {}, LeaseAnswerSchema);
const askStop = () => page.ask("r/stop", StopRequestSchema, {}, StopAnswerSchema);

function open(socket = own()): void {
  if (socket) socket.readyState = 1;
  socket?.onopen?.();
}
function end(code = 1006, reason = "", socket = own()): void {
  if (socket) socket.readyState = 3;
  socket?.onclose?.({ code, reason });
}
beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/console/connection");
});

test("a lost connection is tried again, less and less often, and what was watched is watched again", async () => {
  await connect();
  page.watch("k", () => undefined);
  end();
  const lostAt = Date.now();
  expect([page.reachable.value, ofStops()?.readyState]).toEqual([false, 3]);
  watched.clear();
  for (const [ms, connections] of [
    [240, 1],
    [20, 2],
    [490, 2],
    [20, 3],
    [990, 3],
    [20, 4],
    [1990, 4],
    [20, 5],
    [1990, 5],
    [20, 6],
  ]) {
    await after(ms as number);
    expect(paths().filter((path) => path === "/mesh")).toHaveLength(connections as number);
    if (ms === 20) end();
  }
  await after(2010);
  open();
  expect(watched).toEqual(new Set(["k"]));
  expect(page.lostAt.value).toBe(lostAt);
  say({ case: "hello", value: { connected: true } } as never);
  expect(page.lostAt.value).toBeNull();
  expect(page.reachable.value).toBe(true);
  end();
  await after(260);
  expect(own()?.readyState).toBe(0);
});

test("a session that the console ended is not continued", async () => {
  const ended = vi.fn();
  page.keepConnected(async () => true, ended);
  await after(0);
  open();
  say({ case: "hello", value: {} } as never);
  end(4401, "role");
  await after(10_000);
  expect(ended).toHaveBeenCalledExactlyOnceWith("role");
  expect([page.hello.value, paths().filter((path) => path === "/mesh")]).toEqual([null, ["/mesh"]]);
});

test.each([
  ["a console that does not answer is asked again", null, 3],
  ["a page that may not connect waits until it is called", false, 1],
])("%s", async (_, may, times) => {
  const ready = vi.fn(async () => may);
  const connectNow = page.keepConnected(ready, () => undefined);
  await after(1000);
  expect([ready.mock.calls.length, paths()]).toEqual([times, []]);
  ready.mockResolvedValue(true as never);
  connectNow();
  await after(0);
  expect(paths()).toEqual(["/mesh"]);
});

test("a page that hears nothing for 0.8 s says that nothing can be sent, until it hears something", async () => {
  await connect();
  await after(700);
  expect(page.reachable.value).toBe(true);
  await after(400);
  expect(page.reachable.value).toBe(false);
  say({ case: "answer", value: { id: 0n } } as never);
  expect(page.reachable.value).toBe(true);
});

test("a page that stood still itself first reads what waits for it", async () => {
  await connect();
  await after(200);
  stall(3000);
  await after(200);
  expect(page.reachable.value).toBe(true);
  await after(200);
  expect(page.reachable.value).toBe(false);
});

test("the mesh is out of reach while the console has lost its router", async () => {
  await connect({ connected: false } as never);
  expect(page.reachable.value).toBe(false);
});

test.each([
  ["a connection that answers no question for 15 s", true],
  ["a connection that does not open within 15 s", false],
])("%s is replaced", async (_, opens) => {
  page.keepConnected(
    async () => true,
    () => undefined,
  );
  await after(0);
  const first = own();
  if (opens) open();
  await after(14_500);
  expect(own()).toBe(first);
  await after(1500);
  expect(first?.readyState).toBe(3);
  expect(own()).not.toBe(first);
});

test("a connection on which something arrives stays", async () => {
  await connect();
  const first = own();
  for (let s = 0; s < 20; s++) {
    await after(1000);
    say({ case: "answer", value: { id: 0n } } as never);
  }
  expect(own()).toBe(first);
  page.reopenIfSilent(performance.now() - 1);
  expect(first?.readyState).toBe(1);
  page.reopenIfSilent(performance.now() + 1);
  expect(first?.readyState).toBe(3);
});

test("a stop has a connection of its own, and without an answer is sent over the other one too", async () => {
  await connect();
  const answered = askStop();
  const first = await next();
  expect(first.path).toBe("/mesh/stop");
  await after(490);
  expect(requests).toEqual([]);
  await after(20);
  const second = requests.shift();
  expect([second?.path, second?.id]).toEqual(["/mesh", first.id]);
  answer(first, StopAnswerSchema, { sent: true });
  expect((await answered).sent).toBe(true);
  void ask();
  expect((await next()).path).toBe("/mesh");
});

test("a stop that was answered is not sent again", async () => {
  await connect();
  const answered = askStop();
  answer(await next(), StopAnswerSchema, {});
  await answered;
  await after(1000);
  expect(requests).toEqual([]);
});

test("without its own connection a stop takes the other one at once, and the own one is opened again", async () => {
  await connect();
  end(1006, "", ofStops());
  void askStop().catch(() => undefined);
  expect(requests.map(({ path }) => path)).toEqual(["/mesh"]);
  await after(2010);
  expect(paths()).toEqual(["/mesh", "/mesh/stop", "/mesh/stop"]);
  const stops = ofStops();
  end();
  stops?.onclose?.({ code: 1006, reason: "" });
  await after(2500);
  expect(paths().filter((path) => path === "/mesh/stop")).toHaveLength(2);
});

test.each([
  ["is not connected", async () => undefined, "no connection"],
  ["loses its connection", async () => (await connect(), setTimeout(end, 10)), "no connection"],
  ["gets no answer", async () => connect(), "2 s"],
])("a request of a page that %s ends, and may have been carried out", async (_, begin, text) => {
  await begin();
  const failed = ask().catch((error: unknown) => error);
  await after(3010);
  expect(await failed).toMatchObject({ noAnswer: true, message: expect.stringContaining(text) });
});

test("a refused request was not carried out, and says why", async () => {
  await connect();
  const failed = ask().catch((error: unknown) => error);
  refuse(await next(), "the arm moves", { code: "x.y", text: "the arm moves" });
  expect(await failed).toMatchObject({ noAnswer: false, message: "the arm moves", reason: { code: "x.y" } });
});

test("a request without an answer has a text of its own, a refused one the reason's", async () => {
  const { AskError, reasonOf, withNoAnswerText } = page;
  const silent = withNoAnswerText(Promise.reject(new AskError("", true)), "no recorder");
  await expect(silent).rejects.toThrow("no recorder");
  await expect(withNoAnswerText(Promise.reject(new AskError("full", false)), "")).rejects.toThrow("full");
  expect(await withNoAnswerText(Promise.resolve(7), "")).toBe(7);
  expect([new Error("Not sent: full"), new Error("full"), 7].map(reasonOf)).toEqual(["full", "full", "7"]);
});

test("who begins to watch a watched key has its newest message at once, and none of before the last one ended", async () => {
  await connect();
  const got: string[] = [];
  const watch = (name: string, expression = "a/*") => page.watch(expression, ({ key }) => got.push(`${name} ${key}`));
  const ends = [watch("first")];
  publish("a/b", ControllerStateSchema, state);
  publish("b/b", ControllerStateSchema, state);
  ends.push(watch("second"));
  expect(got).toEqual(["first a/b", "second a/b"]);
  for (const stop of ends) stop();
  ends[1]?.();
  expect(watched).toEqual(new Set());
  watch("third");
  watch("fourth");
  expect(got).toHaveLength(2);
});

test.each([
  ["a/b", "a/b", true],
  ["a/*", "a/b", true],
  ["*/b", "a/b", true],
  ["a/*", "a/b/c", false],
  ["a/*/c", "a/b/d", false],
  ["a", "b", false],
])("%s covers %s: %s", (expression, key, covers) => {
  expect(page.matches(expression, key)).toBe(covers);
});

async function received(...given: Parameters<typeof publish>[3][]): Promise<Sample[]> {
  const got: Sample[] = [];
  page.watch("k", (sample) => got.push(sample));
  for (const header of given) {
    publish("k", ControllerStateSchema, state, header);
    await after(1000);
  }
  return got;
}

test("the age of a message counts from what the console knows, or from its delay on the way if that is longer", async () => {
  await connect();
  const ages = (await received({}, { ageS: 0.5 }, { timeMs: Date.now() - 700 + 2000 }, { timeMs: 0, ageS: 2 })).map(
    ({ newAt, arrived }) => arrived - (newAt ?? 0),
  );
  expect(ages.map((age) => Math.round(age / 10) * 10)).toEqual([0, 500, 700, 2000]);
});

test("a stored message has no age, and a repeated one keeps its age", async () => {
  await connect();
  const same = { publisher: 5n, sequence: 7n };
  const got = await received({ live: false }, same, same, { ...same, live: false });
  expect(got.map(({ newAt }) => newAt)).toEqual([null, got[1]?.arrived, got[1]?.arrived, got[1]?.arrived]);
});

test("after the machine slept, messages of before are as old as they are", async () => {
  const { ageClock } = await import("../../../src/mesh/console/age-clock");
  const before = ageClock();
  vi.setSystemTime(Date.now() + 60_000);
  expect(ageClock() - before).toBe(60_000);
  vi.setSystemTime(Date.now() + 900);
  expect(ageClock() - before).toBe(60_000);
  vi.setSystemTime(Date.now() - 90_000);
  expect(ageClock() - before).toBe(60_000);
});

test("a message without the mesh's header is received", async () => {
  await connect();
  const got: Sample[] = [];
  page.watch("k", (sample) => got.push(sample));
  say({ case: "sample", value: { key: "k", payload: new Uint8Array([1]), step: 2 } } as never);
  expect(got).toMatchObject([{ publisher: 0n, sequence: 0n, sourceTime: 0, step: 2 }]);
});

test("presence is drawn in batches, at once when it is complete, and anew after a reconnect", async () => {
  const alive = (key: string, is = true) => say({ case: "presence", value: { key, alive: is } } as never);
  await connect({ presenceKnown: false } as never);
  alive("a");
  alive("b");
  alive("b", false);
  expect([...page.presence.value]).toEqual([]);
  await after(30);
  expect([...page.presence.value]).toEqual(["a"]);
  alive("c");
  say({ case: "hello", value: { presenceKnown: true } } as never);
  expect([...page.presence.value]).toEqual(["a", "c"]);
  end();
  await after(300);
  open();
  expect([...page.presence.value]).toEqual([]);
});

test("a request in the page's own name has the operator's, the session's, or none", async () => {
  expect(page.inOwnName("k")).toBe("k/page");
  await connect();
  expect(page.inOwnName("k")).toBe("k/page1");
  say({ case: "hello", value: { operator: "li", session: "s" } } as never);
  expect(page.inOwnName("k")).toBe("k/li");
});

test("the connection is encrypted when the page is", () => {
  vi.stubGlobal("location", { protocol: "https:", host: "h:1" });
  expect(page.meshAddress()).toBe("wss://h:1/mesh");
  vi.stubGlobal("location", { protocol: "http:", host: "h:1" });
  expect(page.meshAddress()).toBe("ws://h:1/mesh");
});

test("a request for another connection is a whole message", () => {
  const request: MessageInitShape<typeof LeaseRequestSchema> = { lease: "l" };
  const { message } = fromBinary(FromPageSchema, page.askMessage("k", LeaseRequestSchema, request));
  expect(message).toMatchObject({ case: "ask", value: { key: "k" } });
  expect(fromBinary(LeaseRequestSchema, (message.value as { payload: Uint8Array }).payload).lease).toBe("l");
});
