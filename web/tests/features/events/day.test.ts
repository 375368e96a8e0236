// The history of a day, made from audit entries, events, notes and recordings.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { durationFromMs, timestampFromMs } from "@bufbuild/protobuf/wkt";
import { afterEach, expect, test } from "vitest";
import type { DaySources } from "../../../src/features/events/day";
import * as page from "../../../src/features/events/day";
import {
  AuditEntrySchema,
  EventSchema,
  AuditEntry_Outcome as Outcome,
  RecordingSchema,
  Event_Severity as Severity,
} from "../../../src/gen/robomesh_pb";
import { dateOf } from "../../../src/i18n/format";

const DAY = { from: 1_800_000_000_000, to: 1_800_086_400_000 };
const WHOLE = DAY.to - DAY.from;
const zone = process.env.TZ;
const at = (second: number) => timestampFromMs(DAY.from + 1000 * second);
const entry = (second: number, request: string, more: MessageInitShape<typeof AuditEntrySchema> = {}) =>
  create(AuditEntrySchema, {
    timestamp: at(second),
    request,
    operator: "li",
    outcome: Outcome.ACCEPTED,
    source: "mesh",
    ...more,
  } as never);
const event = (
  second: number,
  code: string,
  severity = Severity.WARNING,
  more: MessageInitShape<typeof EventSchema> = {},
) => create(EventSchema, { timestamp: at(second), code, severity, source: "gateway", ...more } as never);
const note = (second: number, code: string, of: object) =>
  event(second, code, Severity.INFO, { source: "store", note: { id: "1", author: "li", ...of } });
const of = (sources: Partial<DaySources>): DaySources => ({
  day: DAY,
  now: DAY.to,
  audit: [],
  before: { stopped: false },
  events: [],
  eventsFrom: DAY.from,
  recordings: [],
  ...sources,
});

afterEach(() => {
  process.env.TZ = zone;
  if (!zone) delete process.env.TZ;
});

test.each([
  ["Europe/Berlin", [23, 24, 25]],
  ["America/New_York", [23, 24, 25]],
  ["America/Santiago", [23, 24, 25]],
  ["Asia/Beirut", [23, 24, 25]],
  ["Australia/Lord_Howe", [23.5, 24, 24.5]],
  ["UTC", [24]],
])("in %s every day of a year begins and ends where its date does", (name, hours) => {
  process.env.TZ = name;
  const found = new Set<number>();
  for (let each = Date.UTC(2027, 0, 1); each < Date.UTC(2028, 0, 1); each += 86_400_000) {
    const date = new Date(each).toISOString().slice(0, 10);
    const { from, to } = page.spanOfDay(date) ?? { from: 0, to: 0 };
    expect([dateOf(from), dateOf(to - 1)]).toEqual([date, date]);
    expect([from - 1, to].map(dateOf)).not.toContain(date);
    found.add((to - from) / 3_600_000);
  }
  expect([...found].sort()).toEqual(hours);
});

test.each(["", "2027-1-1", "tomorrow"])("%j is no day", (date) => {
  expect(page.spanOfDay(date)).toBeNull();
});

test("a day is told in sentences with runs folded", () => {
  const run = (n: number) => [
    entry(100 + 10 * n, "RUN_PROGRAM", { values: { program_name: "pick" } }),
    entry(101 + 10 * n, "MOVE_ABSOLUTE", { source: "program" }),
    entry(105 + 10 * n, "PROGRAM_END", {
      outcome: n === 11 ? Outcome.FAILED : Outcome.ACCEPTED,
      source: "program",
      text: "program pick ended at line 3: no link",
    }),
  ];
  const sources = of({
    audit: [
      entry(0, "ACQUIRE"),
      entry(10, "HOME"),
      entry(20, "MOVE_RELATIVE"),
      ...Array.from({ length: 12 }, (_, n) => run(n)).flat(),
      entry(300, "STOP", { operator: "wang" }),
      entry(360, "RESET"),
      entry(400, "RELEASE"),
    ],
    events: [
      event(230, "link.down", Severity.WARNING, { text: "no link" }),
      event(275, "link.up", Severity.INFO),
      note(500, "note.written", { text: "slips", begin: at(50) }),
      note(501, "note.withdrawn", { text: "slips" }),
      event(502, "programs.saved", Severity.INFO, { source: "store" }),
    ],
    recordings: [
      create(RecordingSchema, { name: "trial", start: at(30), duration: durationFromMs(75_000), file: "x.mcap" }),
    ],
  });
  const lines = page.linesOf(sources);
  expect(lines.map((line) => [line.kind, line.bad ?? false, page.wordsOf(line)])).toEqual([
    ["control", false, "li: take control"],
    ["control", false, "li: 2 commands"],
    ["recording", false, "Recording trial, 1 min 15 s"],
    ["note", false, expect.stringMatching(/^li noted on .*: slips \(withdrawn\)$/)],
    ["program", true, "li ran program pick 12 times: 11 done; program pick ended at line 3: no link"],
    ["alarm", true, "no link (over after 45 s)"],
    ["stop", true, "wang: stop request"],
    ["stop", false, "li: Reset"],
    ["control", false, "li: release control"],
  ]);
  expect(page.totalsOf(sources)).toEqual({
    program: 60_000,
    stopped: 60_000,
    offline: 45_000,
    unknown: WHOLE - 165_000,
  });
});

test("time that no source describes is unknown", () => {
  const known = { program: 0, stopped: 0, offline: 0 };
  // A stop of the day before, reset at 08:01.
  const reset = page.totalsOf(of({ audit: [entry(60, "RESET")], before: { stopped: true } }));
  expect(reset).toEqual({ ...known, stopped: 60_000, unknown: WHOLE - 60_000 });
  // Events before the oldest one that is surely complete say nothing; a day that goes on counts until now.
  const events = [event(10, "link.down"), event(20, "link.up", Severity.INFO)];
  expect(page.totalsOf(of({ events, eventsFrom: null, now: DAY.from + 100_000 }))).toEqual({
    ...known,
    unknown: 100_000,
  });
  expect(page.totalsOf(of({ events, eventsFrom: DAY.from + 15_000 }))).toEqual({ ...known, unknown: WHOLE });
  expect(page.totalsOf(of({ now: DAY.from - 5 })).unknown).toBe(0);
});

test("a table holds no formula, and every line once", () => {
  const lines = page.linesOf(
    of({ events: [note(0, "note.written", { author: "=li", text: '=1+1, "quoted"', begin: at(0) })] }),
  );
  const [header, row, rest] = page.exported(lines, [], String, true).split("\r\n");
  expect([header, rest]).toEqual(["time,kind,text", ""]);
  expect(row).toMatch(/^"2027-01-15T08:00:00\.000Z","note",/);
  expect(row).not.toContain(',"=');
  expect(row).toContain('""quoted""');
  expect(page.exported(lines, ["head"], String, false)).toMatch(/^head\n\n/);
});

test("a robot that is stopped without a link, or stops its program, counts once: offline, stopped, then in a program", () => {
  const audit = [entry(0, "RUN_PROGRAM"), entry(10, "STOP"), entry(40, "RESET")];
  const events = [event(20, "link.lost", Severity.ERROR), event(30, "link.up", Severity.INFO)];
  const totals = { program: 10_000, stopped: 20_000, offline: 10_000, unknown: WHOLE - 40_000 };
  expect(page.totalsOf(of({ audit, events }))).toEqual(totals);
});

test("a request that is refused again and again is one line that needs attention", () => {
  const refused = { outcome: Outcome.REFUSED, text: "busy" };
  const audit = [entry(1, "HOME", refused), entry(2, "HOME", refused), entry(3, "HOME")];
  const lines = page.linesOf(of({ audit })).map(({ text, bad }) => [text, bad]);
  expect(lines).toEqual([
    ["li: Home – busy", true],
    ["li: Home", false],
  ]);
});

test("an alarm is told with how long it lasted, or who acknowledged it; what the audit log says is told once", () => {
  const events = [
    event(1, "joints.limit", Severity.WARNING, { text: "elbow at its limit" }),
    event(3605, "joints.limit.over", Severity.INFO),
    event(5, "alarm.acknowledged", Severity.INFO, { text: "li acknowledged it" }),
    event(6, "stop.latched", Severity.ERROR),
    event(90_000, "link.down"),
  ];
  const texts = page.linesOf(of({ events })).map(({ text }) => text);
  expect(texts).toEqual(["elbow at its limit (over after 1 h 0 min)", "li acknowledged it"]);
  expect(page.lastedText(9400)).toBe("9 s");
});
