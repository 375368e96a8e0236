// Rows of motions in a day's history, and the lists of events and audit entries.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import {
  AuditEntrySchema,
  EventListSchema,
  EventSchema,
  AuditEntry_Outcome as Outcome,
  Event_Severity as Severity,
} from "../../../src/gen/robomesh_pb";
import { connect, newPage, publish } from "../../console";
import { pass } from "../../hands";
import { ARM } from "../../recorded";
import { use } from "../../shown";

type EventFields = MessageInitShape<typeof EventSchema>;
const DAY = { from: 1_800_000_000_000, to: 1_800_086_400_000 };
const at = (second: number) => timestampFromMs(DAY.from + 1000 * second);
let day: typeof import("../../../src/features/events/day");

beforeEach(async () => {
  newPage();
  day = await import("../../../src/features/events/day");
});

const entry = (second: number, request: string, more: MessageInitShape<typeof AuditEntrySchema> = {}) =>
  create(AuditEntrySchema, {
    ...{ timestamp: at(second), request, operator: "li", outcome: Outcome.ACCEPTED, source: "mesh", ...more },
  });
const event = (second: number, code: string, severity = Severity.WARNING, more: EventFields = {}) =>
  create(EventSchema, { timestamp: at(second), code, severity, source: "gateway", ...more });

test("another operator, or a stop between them, begins a new line of motions", () => {
  const wang = { operator: "wang" };
  const audit = [entry(1, "HOME"), entry(2, "HOME", wang), entry(3, "STOP"), entry(4, "HOME", wang)];
  const known = { before: null, events: [], eventsFrom: null, recordings: [] };
  const lines = day.linesOf({ day: DAY, now: DAY.to, audit, ...known });
  expect(lines.map(({ kind }) => kind)).toEqual(["control", "control", "stop", "control"]);
});

test.each([
  [0, "0 s"],
  [59_499, "59 s"],
  [250_000, "4 min 10 s"],
  [3_599_600, "1 h 0 min"],
  [11_520_000, "3 h 12 min"],
  [-5, "0 s"],
])("%i ms lasted %s", (ms, text) => {
  expect(day.lastedText(ms)).toBe(text);
});

test("events that arrive twice are listed once, newest first, up to 5000", async () => {
  const entries = await import("../../../src/features/events/entries");
  await connect();
  const used = use(entries.useEntries);
  await pass();
  const send = (...seconds: number[]) =>
    publish(
      `${ARM}/events`,
      EventListSchema,
      { events: seconds.map((second) => event(second, "x", 1, { text: String(second) })) },
      { live: false },
    );
  send(1, 3, 2);
  send(2, 4);
  publish(`${ARM}/events/store`, EventSchema, event(2.5, "x"));
  await pass(300);
  const listed = () => entries.events.newest.value.map(({ ms }) => (ms - DAY.from) / 1000);
  expect(listed()).toEqual([4, 3, 2.5, 2, 1]);
  send(...Array.from({ length: 5000 }, (_, i) => 10 + i));
  await pass(300);
  expect([listed().length, listed()[0], listed().at(-1)]).toEqual([5000, 5009, 10]);
  used.end();
});

test("a repeated audit entry is listed again only with its count", async () => {
  const entries = await import("../../../src/features/events/entries");
  await connect();
  const used = use(entries.useEntries);
  await pass();
  for (const repeatedCount of [0n, 0n, 1n])
    publish(`${ARM}/audit`, AuditEntrySchema, { ...entry(1, "HOME"), number: 7n, repeatedCount });
  publish("robomesh/yard/arm/audit", AuditEntrySchema, { ...entry(2, "HOME"), number: 7n });
  await pass(300);
  expect(
    entries.audits.newest.value.map(({ site, robot, audit }) => `${site}/${robot} ${audit.repeatedCount}`),
  ).toEqual(["yard/arm 0", "test/arm 1", "test/arm 0"]);
  used.end();
});
