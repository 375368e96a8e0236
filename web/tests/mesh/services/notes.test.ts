// Notes on a robot's time, and requests to its recorder.

import { timestampFromMs, timestampMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import {
  EventListSchema,
  EventSchema,
  NoteQuerySchema,
  NoteRequest_Action,
  NoteRequestSchema,
  RecorderRequestSchema,
  RecordingSchema,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, refuse, say } from "../../console";

let page: typeof import("../../../src/mesh/services/notes");
let account: typeof import("../../../src/mesh/console/account");
const ARM = "robomesh/hall/arm";
const note = (author: string) => ({ id: "7", author }) as never;

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/services/notes");
  account = await import("../../../src/mesh/console/account");
  await connect({ operator: "li" } as never);
});

async function asked(request: Promise<unknown>) {
  const sent = await next();
  answer(sent, EventSchema, {});
  await request;
  return { key: sent.key, ...read(sent, NoteRequestSchema) };
}

test("a note is written on a time or on now, each with an id of its own", async () => {
  const range = await asked(page.writeNote(ARM, "slips", { begin: 1e12 + 0.6, end: 2e12 }));
  expect(range).toMatchObject({
    key: "robomesh/hall/-/notes/request/li",
    action: NoteRequest_Action.WRITE,
    robot: "arm",
    text: "slips",
  });
  expect([range.begin, range.end].map((stamp) => stamp && timestampMs(stamp))).toEqual([1e12 + 1, 2e12]);
  const moment = await asked(page.writeNote(ARM, "slips", { begin: 1e12 }));
  const now = await asked(page.writeNote(ARM, "slips", null));
  expect([moment.begin && timestampMs(moment.begin), moment.end, now.begin]).toEqual([1e12, undefined, undefined]);
  expect([range.id, moment.id].every((id) => /^[0-9a-f]{16}$/.test(id))).toBe(true);
  expect(range.id).not.toBe(moment.id);
});

test("a note is withdrawn by its author, or by an administrator in his own right", async () => {
  expect(await asked(page.withdrawNote(ARM, note("li")))).toMatchObject({
    key: "robomesh/hall/-/notes/request/li",
    id: "7",
    action: NoteRequest_Action.WITHDRAW,
  });
  expect((await asked(page.withdrawNote(ARM, note("wang")))).key).toBe("robomesh/hall/-/notes/withdraw/li");
});

test.each([
  ["its author", "li", "operator", {}, true],
  ["another operator", "wang", "operator", {}, false],
  ["an administrator", "wang", "admin", {}, true],
  ["an author whose right to act is suspended", "li", "operator", { account: "li" }, false],
  ["a person without a name", "", "operator", { operator: "" }, false],
] as const)("a note may be withdrawn by %s: %s wrote it", (_, author, role, more, may) => {
  account.me.value = { accounts: true, account: "li", role } as never;
  say({ case: "hello", value: { operator: "li", ...more } } as never);
  expect(page.mayWithdraw(note(author))).toBe(may);
});

test("notes are read for a part of the time that contains its ends", async () => {
  const events = page.readNotes(ARM, { since: 1000.7, until: 2000.2 });
  const request = await next();
  const { since, until, robot } = read(request, NoteQuerySchema);
  expect([request.key, robot, since && timestampMs(since), until && timestampMs(until)]).toEqual([
    "robomesh/hall/-/notes/read",
    "arm",
    1000,
    2001,
  ]);
  answer(request, EventListSchema, {
    events: [
      { code: page.WITHDRAWN, note: { id: "7" } },
      { code: page.WRITTEN, note: { id: "8" } },
      { code: page.WITHDRAWN },
    ],
  });
  expect([...page.withdrawnIds(await events)]).toEqual(["7"]);
  void page.readNotes(ARM);
  expect(read(await next(), NoteQuerySchema).since).toBeUndefined();
});

test.each([
  ["without an answer the store is named", "", /^The site's store does not answer/],
  ["a refusal says why", "text too long", /^text too long$/],
])("%s", async (_, error, text) => {
  const failed = page.writeNote(ARM, "slips", null);
  refuse(await next(), error);
  await expect(failed).rejects.toThrow(text);
});

test("a note's time is a moment or a range", () => {
  const begin = timestampFromMs(1000);
  expect(page.timeOfNote({ begin } as never)).toEqual({ begin: 1000 });
  expect(page.timeOfNote({ begin, end: timestampFromMs(2000) } as never)).toEqual({ begin: 1000, end: 2000 });
});

test("a recorder is asked for a recording, and named if it does not answer", async () => {
  const { Action, askRecorder } = await import("../../../src/mesh/services/recorder");
  const recording = askRecorder(ARM, Action.TRACE_ON, { name: "trial", views: ["front"] });
  const request = await next();
  expect(request.key).toBe(`${ARM}/recorder/request`);
  expect(read(request, RecorderRequestSchema)).toMatchObject({
    action: Action.TRACE_ON,
    name: "trial",
    views: ["front"],
  });
  answer(request, RecordingSchema, { name: "trial" });
  expect((await recording).name).toBe("trial");
  const failed = askRecorder(ARM, Action.SAVE);
  refuse(await next());
  await expect(failed).rejects.toThrow("The recorder does not answer.");
});
