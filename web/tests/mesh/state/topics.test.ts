// The newest messages and lists that components follow.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  AuditEntrySchema,
  AuditListSchema,
  ControllerStateSchema,
  EventListSchema,
  EventSchema,
} from "../../../src/gen/robomesh_pb";
import { connect, newPage, publish, watched } from "../../console";
import { ARM, payloads, replay } from "../../recorded";
import { use } from "../../shown";

let topics: typeof import("../../../src/mesh/state/topics");
const redrawn = () => vi.advanceTimersByTimeAsync(60);
const state = (rateHz: number, second = 0) => ({ rateHz, timestamp: timestampFromMs(1e12 + second * 1000) });

beforeEach(async () => {
  newPage();
  topics = await import("../../../src/mesh/state/topics");
  await connect();
});

test("components that follow one topic share a subscription, which ends with the last of them", async () => {
  const first = use(topics.useTopic, ControllerStateSchema, "k");
  const second = use(topics.useTopic, ControllerStateSchema, "k");
  publish("k", ControllerStateSchema, state(1));
  await redrawn();
  expect([first, second].map(({ result }) => result?.message.rateHz)).toEqual([1, 1]);
  first.end();
  expect(watched).toEqual(new Set(["k"]));
  second.end();
  expect(watched).toEqual(new Set());
  publish("k", ControllerStateSchema, state(2));
  await redrawn();
  expect(second.result?.message.rateHz).toBe(1);
});

test("of several messages the newest is drawn, and an equal one renews only the age", async () => {
  const used = use(topics.useTopic, ControllerStateSchema, "k");
  publish("k", ControllerStateSchema, state(1));
  publish("k", ControllerStateSchema, state(2));
  await redrawn();
  const first = used.result;
  const arrived = first?.sample.arrived ?? 0;
  expect(first?.message.rateHz).toBe(2);
  publish("k", ControllerStateSchema, state(2, 1));
  await redrawn();
  expect(used.result).toBe(first);
  expect(first?.sample.arrived).toBeGreaterThan(arrived);
  await vi.advanceTimersByTimeAsync(300);
  publish("k", ControllerStateSchema, state(2, 2));
  await redrawn();
  expect(used.result).not.toBe(first);
});

test("a page that is shown again knows at once how old its data is", () => {
  const before = topics.now.value;
  vi.advanceTimersByTime(200);
  document.dispatchEvent(new Event("visibilitychange"));
  expect(topics.now.value).toBeGreaterThan(before + 199);
});

const codes = (events: readonly { code: string }[]) => events.map(({ code }) => code).join("");
const event = (code: string, second = 0) => ({ code, timestamp: timestampFromMs(1e12 + second * 1000) });
const sent = (code: string, sequence: bigint, publisher = 1n) =>
  publish("r/events", EventSchema, event(code, Number(sequence)), { publisher, sequence });
const list = (letters: string, sequence: bigint, publisher = 1n) =>
  publish(
    "r/events",
    EventListSchema,
    { events: [...letters].map((code, i) => event(code, i)) },
    { publisher, sequence, live: false },
  );

test.each([
  ["live events follow the history", () => [list("ab", 2n), sent("c", 3n)], "cba"],
  ["an event that is repeated is shown once", () => [list("ab", 2n), sent("c", 3n), sent("c", 3n)], "cba"],
  ["after an outage a list holds only new events", () => [list("ab", 2n), list("cd", 4n)], "dcba"],
  ["after a reconnect a list holds all again", () => [list("ab", 2n), list("ab", 2n)], "ba"],
  ["after a reconnect a list holds all again, also new ones", () => [list("ab", 2n), list("abc", 3n)], "cba"],
  ["a restarted publisher's list replaces the old", () => [list("ab", 2n), list("cd", 9n, 7n)], "dc"],
])("%s", async (_, act, shown) => {
  const events = use(topics.useEvents, "r");
  act();
  await redrawn();
  expect(codes(events.result)).toBe(shown);
});

test("events of all services are in the order of their times, the newest first", async () => {
  const events = use(topics.useEvents, "r");
  for (const [key, code, second] of [
    ["r/events", "a", 1],
    ["r/events/recorder", "c", 3],
    ["r/events", "b", 2],
  ] as const)
    publish(key, EventSchema, event(code, second));
  await redrawn();
  expect(codes(events.result)).toBe("cba");
});

test("a list keeps the last 200 entries", async () => {
  const audit = use(topics.useAudit, "r");
  const entries = Array.from({ length: 201 }, (_, i) => ({ number: BigInt(i) }));
  publish("r/audit", AuditListSchema, { entries }, { live: false, sequence: 201n });
  publish("r/audit", AuditEntrySchema, { number: 201n }, { sequence: 202n });
  await redrawn();
  expect(audit.result.map(({ number }) => number)).toEqual(Array.from({ length: 200 }, (_, i) => BigInt(201 - i)));
});

test("a real site's audit trail and events are listed, each entry once", async () => {
  const [audit, events] = [use(topics.useAudit, ARM), use(topics.useEvents, ARM)];
  await replay();
  await redrawn();
  const numbers = audit.result.map(({ number }) => Number(number));
  expect(numbers).toEqual([...new Set(numbers)].sort((a, b) => b - a));
  expect(numbers.length).toBeGreaterThanOrEqual(payloads(`${ARM}/audit`).length - 1);
  expect(codes(events.result)).toContain("stop.latched");
});
