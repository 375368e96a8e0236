// What the sender's page showed when a request was sent, found again in a recording.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create, toBinary } from "@bufbuild/protobuf";
import { durationFromMs, timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import { CompressedVideoSchema } from "../../src/gen/foxglove/CompressedVideo_pb";
import type { RecordingSchema } from "../../src/gen/robomesh_pb";
import {
  AuditEntrySchema,
  RangeRequestSchema,
  RecordedMessagesSchema,
  RecordingListSchema,
} from "../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, refuse, requests } from "../console";
import { find, key, pass, press, texts } from "../hands";
import { show } from "../shown";
import { keyPicture, stubDecoder } from "./pictures";

const TIME = "2026-11-29T06:02:11.123456Z";
const MS = Date.parse(TIME) + 0.456;
const SHOWN = { page_view: "front", page_picture_time: TIME, page_picture: "42", page_picture_age_s: "0.034" };

beforeEach(async () => {
  newPage();
  stubDecoder();
  await connect();
  HTMLDialogElement.prototype.show ??= () => undefined;
});

async function seen(values: Record<string, string>): Promise<void> {
  const { SeenPicture } = await import("../../src/video/seen-picture");
  show(<SeenPicture site="hall" robot="arm" entry={create(AuditEntrySchema, { values })} />);
}
const open = async (values: Record<string, string>) => {
  await seen(values);
  press(texts("button")[0] ?? "");
  await pass();
};
const says = () => texts(".seen-still p, .seen-body > p");
const facts = () => texts(".seen-body dd");
const recording = (more: MessageInitShape<typeof RecordingSchema> = {}) => ({
  ...{ file: "a.mcap", start: timestampFromMs(Math.floor(MS) - 60_000), duration: durationFromMs(120_000) },
  topics: [{ topic: "robomesh/hall/arm/video/front" }],
  ...more,
});
async function answerList(...recordings: MessageInitShape<typeof RecordingSchema>[]): Promise<void> {
  const request = await next();
  expect(request.key).toBe("robomesh/hall/-/recordings/list");
  answer(request, RecordingListSchema, { recordings: recordings as never });
  await pass();
}
const stamp = (ms: number) => ({
  seconds: BigInt(Math.floor(ms / 1000)),
  nanos: Math.round((ms % 1000) * 1000) * 1000,
});
async function answerRange(...times: number[]): Promise<void> {
  const data = toBinary(CompressedVideoSchema, create(CompressedVideoSchema, { data: keyPicture() }));
  answer(await next(), RecordedMessagesSchema, { messages: times.map((ms) => ({ source: stamp(ms), data })) });
  await pass();
}

test.each([
  [{}, []],
  [SHOWN, ["screen: Front, 0.03\u202fs old"]],
  [{ page_view: "3d" }, ["screen: 3-D view, unknown time old"]],
  [{ page_view: "", page_state_age_s: "1.5" }, ["screen: state 1.50\u202fs old"]],
])("an entry with %o has the summary %o", async (values, summary) => {
  await seen(values);
  expect(texts("button")).toEqual(summary);
});

test("the picture is found by its time to the microsecond, and its facts are listed", async () => {
  await open({ ...SHOWN, page_state_age_s: "0.1" });
  expect(says()[0]).toMatch(/^Looking for this picture/);
  expect(facts()).toEqual(["Front", "42", expect.stringMatching(/:02:11\.123/), "0.03\u202fs", "0.10\u202fs"]);
  await answerList(recording());
  const request = requests[0];
  expect(request?.key).toBe("robomesh/hall/-/recordings/range/page1");
  expect(request && read(request, RangeRequestSchema)).toMatchObject({
    ...{ file: "a.mcap", topic: "robomesh/hall/arm/video/front", fromKeyFrame: true },
    start: timestampFromMs(Math.floor(MS) - 2000),
    end: timestampFromMs(Math.ceil(MS) + 2000),
  });
  await answerRange(MS - 40, MS, MS + 40);
  expect([find("[data-found]").dataset.found, says()]).toEqual([
    "true",
    [expect.stringMatching(/^From the recording a\.mcap\. /)],
  ]);
});

test("a picture that was not recorded is replaced by the one before, and says so", async () => {
  await open(SHOWN);
  await answerList(recording());
  await answerRange(MS - 40, MS + 0.02);
  expect(says()[0]).toMatch(/: the picture before it, because this one was not recorded/);
});

test("a recording without the picture is passed over, and the next one is read", async () => {
  await open(SHOWN);
  await answerList(
    recording({ file: "other view", topics: [{ topic: "robomesh/hall/arm/video/top" }] }),
    recording({ file: "later", start: timestampFromMs(Math.floor(MS) + 2100) }),
    recording({ file: "earlier", start: timestampFromMs(Math.floor(MS) - 10_000), duration: durationFromMs(7900) }),
    recording({ file: "gap" }),
    recording({
      file: "open",
      start: timestampFromMs(Math.floor(MS) - 10_000),
      duration: durationFromMs(0),
      open: true,
    }),
  );
  await answerRange(MS + 1);
  await answerRange(MS);
  expect(says()[0]).toMatch(/^From the recording open\./);
});

test.each<[string, Record<string, string>, RegExp]>([
  ["no picture", { page_view: "", page_state_age_s: "1" }, /^The page showed no picture/],
  ["a picture without a time", { page_view: "front" }, /^The page showed no picture/],
  ["its own drawing", { ...SHOWN, page_view: "3d" }, /^The page drew this picture itself/],
])("a page that showed %s says so, and asks nobody", async (_, values, text) => {
  await open(values);
  expect([says()[0], requests]).toEqual([expect.stringMatching(text), []]);
  expect(facts()[0]).toBe(values.page_view === "3d" ? "3-D view" : values.page_view ? "Front" : "–");
});

test("a picture that no recording has is not shown", async () => {
  await open({ ...SHOWN, page_picture_time: "2026-11-29T06:02:11Z" });
  expect(facts()[2]).toMatch(/:02:11\.000/);
  await answerList();
  expect(says()[0]).toBe("No recording of this site has this picture.");
});

test("a picture that cannot be read is explained", async () => {
  await open(SHOWN);
  refuse(await next(), "disk full");
  await pass();
  expect(says()[0]).toBe("The picture could not be read: disk full");
});

test.each([
  ["Close", () => press("Close")],
  ["Escape", () => key("dialog", "Escape")],
])("%s closes it, and a late answer shows nothing", async (_, close) => {
  await open(SHOWN);
  key("dialog", "a");
  expect(texts("dialog")).toHaveLength(1);
  close();
  await pass();
  expect(texts("dialog")).toEqual([]);
  await answerList(recording());
  await answerRange(MS);
  expect(texts("dialog")).toEqual([]);
});
