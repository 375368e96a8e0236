// Alarms, events and audit entries as sentences in the page's language.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create, fromBinary } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { afterEach, expect, test } from "vitest";
import {
  AlarmSchema,
  AuditEntrySchema,
  DescriptionSchema,
  EventSchema,
  AuditEntry_Outcome as Outcome,
  Event_Severity as Severity,
} from "../../src/gen/robomesh_pb";
import { alarmAdvice, alarmText } from "../../src/i18n/alarm-text";
import { entrySentence } from "../../src/i18n/audit-text";
import { eventText } from "../../src/i18n/event-text";
import { stampWhen, whenText } from "../../src/i18n/format";
import { showFirstLanguage } from "../../src/i18n/texts";
import { ARM, messages, payloads } from "../recorded";

const AT = 1_795_932_131_000;
const timestamp = timestampFromMs(AT);
const HELD = { code: "lease.held", values: { holder: "wang" }, text: "wang is in control" };
const JOINTS = [
  { name: "waist", type: 1 },
  { name: "rail", type: 2 },
] as never;
const { ACCEPTED, REFUSED } = Outcome;

afterEach(() => showFirstLanguage("en"));

async function inBoth(show: () => string): Promise<[string, string]> {
  await showFirstLanguage("en");
  const english = show();
  await showFirstLanguage("zh");
  return [english, show()];
}

test.each<[string, MessageInitShape<typeof AuditEntrySchema>, string, string?]>([
  ["a request", { request: "HOME" }, "li: Home", "li：回零"],
  [
    "a request of a program without a name",
    { request: "HOME", operator: "", source: "legacy 10.0.0.9" },
    "legacy 10.0.0.9: Home",
  ],
  ["a request of a newer program", { request: "FLY" }, "li: FLY", "li：FLY"],
  [
    "a motion",
    { request: "MOVE_ABSOLUTE", values: { joint_positions: "0.5 -0.01" } },
    "li: move to waist 28.65°, rail −10.0\u202fmm",
  ],
  ["a step", { request: "MOVE_RELATIVE", values: { joint_positions: "0.0873 0" } }, "li: waist +5.00°"],
  ["a step back", { request: "MOVE_RELATIVE", values: { joint_positions: "0 -0.01" } }, "li: rail −10.0\u202fmm"],
  [
    "a motion of other joints",
    { request: "MOVE_ABSOLUTE", values: { joint_positions: "1 2 3" } },
    "li: move to a target",
    "li：移动到目标",
  ],
  ["a request without its value", { request: "TAKE" }, "li: take over control"],
  ["a request with its value", { request: "TAKE", values: { reason: "smoke" } }, "li: take over control: smoke"],
  ["a request without its value that no words describe", { request: "SPEED" }, "li: SPEED"],
  ["a refusal", { request: "HOME", outcome: REFUSED, reason: HELD }, "li: Home – wang is in control"],
  ["a refusal without a reason", { request: "HOME", outcome: REFUSED }, "li: Home"],
  ["a refusal of an older gateway", { request: "HOME", outcome: REFUSED, text: "busy" }, "li: Home – busy"],
  [
    "a warning of a check",
    { request: "HOME", reason: { code: "check.near", text: "close" } },
    "li: Home; warning: close",
  ],
  ["an accepted request's own words are not repeated", { request: "HOME", reason: HELD }, "li: Home"],
  ["an end of control", { request: "EXPIRE", text: "not renewed" }, "li: not renewed"],
  ["an end without a reason", { request: "EXPIRE" }, "li: EXPIRE"],
])("%s is one sentence", async (_, values, english, chinese) => {
  const entry = create(AuditEntrySchema, { operator: "li", outcome: ACCEPTED, ...values } as never);
  const found = await inBoth(() => entrySentence(entry, JOINTS));
  expect(found[0]).toBe(english);
  if (chinese) expect(found[1]).toBe(chinese);
});

test("a motion that is done says how long it took", () => {
  const entry = create(AuditEntrySchema, { operator: "li", request: "HOME", outcome: ACCEPTED });
  expect(entrySentence(entry, [], 4.56)).toBe("li: Home, done in 4.6\u202fs");
});

const event = (values: MessageInitShape<typeof EventSchema>) =>
  create(EventSchema, { timestamp, text: "told", ...values } as never);
test.each<[string, MessageInitShape<typeof EventSchema>, string, string | RegExp]>([
  ["news", { code: "link.up", severity: Severity.INFO }, "told", "与控制器的连接正常。"],
  [
    "news with a value",
    { code: "link.channel_back", severity: Severity.INFO, values: { channel: "status" } },
    "told",
    /控制器的接口 status 已/,
  ],
  ["news without its value", { code: "link.channel_back", severity: Severity.INFO }, "told", "told"],
  ["an unknown event", { code: "x.y", severity: Severity.INFO }, "told", "told"],
  ["an alarm without a reason", { code: "link.down", severity: Severity.ERROR }, "told", "told"],
  [
    "an alarm with a reason",
    { code: "link.down", severity: Severity.ERROR, reason: HELD },
    "told",
    /^与控制器断开：.*wang.*。$/,
  ],
  [
    "a warning with a reason",
    { code: "link.silent", severity: Severity.WARNING, reason: HELD },
    "told",
    /^控制器无数据：/,
  ],
  ["an unknown alarm with a reason", { code: "x.y", severity: Severity.ERROR, reason: HELD }, "told", "told"],
  [
    "an event that is its reason",
    { code: "lease.held", severity: Severity.WARNING, reason: HELD },
    "told",
    /^[^：]*wang.*。$/,
  ],
  ["the end of an alarm", { code: "link.down.over", severity: Severity.INFO }, "told", /与控制器断开/],
  [
    "the end of one of several alarms",
    { code: "link.down.over", severity: Severity.INFO, values: { joint: "waist" } },
    "told",
    /与控制器断开.*waist/,
  ],
  ["a stop that was sent later", { code: "stop.sent" }, "The stop was sent when the link came back.", /^[^a-z]+$/],
  ["a reset", { code: "stop.reset" }, "The stop was reset.", /^[^a-z]+$/],
  ["a note without its text", { code: "note.written" }, "told", "told"],
])("%s is said in the page's language if that has words", async (_, values, english, chinese) => {
  const found = await inBoth(() => eventText(event(values)));
  expect(found[0]).toBe(english);
  expect(found[1]).toEqual(typeof chinese === "string" ? chinese : expect.stringMatching(chinese));
});

test.each([
  ["True", "li asked for a stop at {time}."],
  ["False", "li asked for a stop at {time}. It did NOT reach the controller, and is sent as soon as it can be."],
])("a stop that was sent (%s) says so, with who asked, when and why", (sent, text) => {
  const values = { by: "li", sent, reason: "the page" };
  const expected = text.replace("{time}", stampWhen(timestamp));
  expect(eventText(event({ code: "stop.latched", values }))).toBe(expected);
  expect(eventText(event({ code: "stop.latched", values: { ...values, reason: "smoke" } }))).toBe(
    `${expected} Reason: “smoke”.`,
  );
  expect(eventText(event({ code: "stop.latched", values: {} }))).toMatch(/^An operator without a name asked/);
});

const note = (begin: number, end?: number) =>
  eventText(
    event({
      code: "note.written",
      note: { author: "li", text: "slips", begin: timestampFromMs(begin), ...(end && { end: timestampFromMs(end) }) },
    }),
  );
test("a note on another time than its own names it", () => {
  expect(note(AT - 1999)).toBe("li noted: slips");
  expect(note(AT - 2001)).toBe(`li noted on ${whenText(AT - 2001, AT)}: slips`);
  expect(note(AT, AT + 5000)).toBe(`li noted on ${whenText(AT, AT)} – ${whenText(AT + 5000, AT)}: slips`);
});

test("an alarm is translated with its cause, and its advice too", async () => {
  const known = create(AlarmSchema, { code: "link.down", cause: HELD });
  expect(alarmText(known)).toBeNull();
  expect(alarmAdvice("link.down", "check it")).toBe("check it");
  await showFirstLanguage("zh");
  expect(alarmText(known)).toMatch(/^与控制器断开：.*wang/);
  expect(alarmText(create(AlarmSchema, { code: "link.down" }))).toBe("与控制器断开");
  expect(alarmText(create(AlarmSchema, { code: "x.y", cause: HELD }))).toBeNull();
  expect(alarmAdvice("link.down", "check it")).toMatch(/^检查控制器/);
});

test("a real robot's requests are told as sentences", () => {
  const joints = payloads(`${ARM}/description`).flatMap((each) => fromBinary(DescriptionSchema, each).joints);
  const samples = messages.flatMap(({ message }) =>
    message.case === "sample" && message.value.key === `${ARM}/audit` ? [message.value] : [],
  );
  const told = samples
    .filter(({ live }) => live)
    .map(({ payload }) => entrySentence(fromBinary(AuditEntrySchema, payload), joints));
  const requests = ["take control", "waist +5.00°", "stop request", "reset of stop 1", "release control"];
  expect(told).toEqual(expect.arrayContaining(requests.map((what) => `li: ${what}`)));
  expect(told.find((each) => each.includes("400"))).toMatch(
    /^li: move to waist 400\.00°.* – joint waist at 400\.00° is beyond/,
  );
});
