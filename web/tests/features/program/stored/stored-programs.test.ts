// Programs that the site stores, and changes of two people at a time.

import { create } from "@bufbuild/protobuf";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ProgramRequest_Action as Action,
  ProgramVersion_Change as Change,
  ProgramAnswerSchema,
  ProgramContentSchema,
  ProgramListSchema,
  ProgramQuerySchema,
  ProgramRequestSchema,
} from "../../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, refuse, requests, say } from "../../../console";
import { ARM } from "../../../recorded";

const WELD = { id: "w", current: { number: 4, name: "weld", sha256: "new" } };
let s: typeof import("../../../../src/features/program/stored/stored-programs");
let d: typeof import("../../../../src/features/program/draft/draft");

beforeEach(async () => {
  newPage();
  s = await import("../../../../src/features/program/stored/stored-programs");
  d = await import("../../../../src/features/program/draft/draft");
  await connect();
  const field = document.createElement("textarea");
  d.openDraft(ARM);
  d.setField(field);
});

const pass = () => vi.advanceTimersByTimeAsync(0);
const said = () => [s.lastAction.value.words(), s.lastAction.value.refused];
const draw = (text: string, version: number | null = 3) =>
  d.replaceDraft({
    text,
    name: "weld",
    base: version === null ? null : { id: "w", version, name: "weld", text: "home" },
  });
const nextChange = async () => {
  const request = await next();
  const { id, basedOn, name, text, action } = read(request, ProgramRequestSchema);
  return { request, asked: [Action[action], id, basedOn, name, text] };
};

test("a draft is saved as the next version of its program, and what is typed meanwhile is unsaved", async () => {
  draw("home\nend");
  const saved = s.save();
  void s.save(); // pressed twice
  const { request, asked } = await nextChange();
  expect([asked, request.key]).toEqual([
    ["SAVE", "w", 3, "weld", "home\nend"],
    "robomesh/test/-/programs/request/page1",
  ]);
  draw("home\nend\n");
  answer(request, ProgramAnswerSchema, { program: WELD, version: { number: 4, name: "weld" } });
  await saved;
  expect([d.draft.value?.base?.version, d.isUnsaved.value, said(), requests]).toEqual([
    4,
    true,
    ["Saved: version 4.", false],
    [],
  ]);
});

test.each([
  ["a program that was never saved", null, "weld"],
  ["one with another name", 3, "cut"],
])("%s is saved as a new program", async (_, version, name) => {
  draw("home", version);
  d.rename(name);
  void s.save();
  expect((await nextChange()).asked).toEqual(["SAVE", "", 0, name, "home"]);
});

test("a save of what is stored says that nothing changed", async () => {
  draw("home");
  const saved = s.save();
  answer((await nextChange()).request, ProgramAnswerSchema, { program: WELD, version: { number: 3, name: "weld" } });
  await saved;
  expect(said()[0]).toMatch(/3/);
  expect(said()[0]).not.toMatch(/^Saved/);
});

test("a save that another person overtook shows both texts, and the draft keeps its base", async () => {
  draw("home\nend");
  const saved = s.save();
  answer((await nextChange()).request, ProgramAnswerSchema, {
    program: WELD,
    version: { number: 5, change: Change.ASIDE },
  });
  for (const [version, text] of [
    [5, "mine"],
    [4, "theirs"],
  ] as const) {
    const request = await next();
    expect(read(request, ProgramQuerySchema)).toMatchObject({ id: "w", version, robot: "arm" });
    answer(request, ProgramContentSchema, { text });
  }
  await saved;
  expect(s.shown.value).toMatchObject({ kind: "conflict", mine: { text: "mine" }, theirs: { text: "theirs" } });
  expect([d.draft.value?.base?.version, d.isUnsaved.value]).toEqual([3, true]);
});

test("a refused save says why, and can be tried again", async () => {
  draw("home\nend");
  const saved = s.save();
  refuse((await nextChange()).request, "the disk is full");
  await saved;
  expect([said(), s.saving.value, d.isUnsaved.value]).toEqual([["the disk is full", true], false, true]);
});

test("nothing is saved by a monitor, or without a text", async () => {
  draw("");
  await s.save();
  draw("home\nend");
  say({ case: "hello", value: { connected: true, account: "eve", mayCommand: false } } as Parameters<typeof say>[0]);
  await s.save();
  await pass();
  expect(requests).toEqual([]);
});

test.each([
  ["the current version is unchanged", 4, "new", false],
  ["an older one is a change of the current one", 2, "old", true],
])("opened, %s", (_, number, sha256, unsaved) => {
  s.open(
    create(ProgramContentSchema, { program: WELD, version: { number, name: "old name", sha256 }, text: "wait 1" }),
  );
  expect(d.draft.value).toMatchObject({ text: "wait 1", name: "weld", base: { id: "w", version: 4 } });
  expect([d.isUnsaved.value, s.shown.value]).toEqual([unsaved, null]);
  d.undo();
  expect(d.draft.value?.text).toBe("");
});

test("a text that ran and was never saved opens as a new program", async () => {
  void s.showHash(ARM, "abc");
  expect(s.shown.value?.kind).toBe("loading");
  const request = await next();
  expect(read(request, ProgramQuerySchema).sha256).toBe("abc");
  answer(request, ProgramContentSchema, { version: { name: "run" }, text: "home" });
  await pass();
  expect(s.shown.value?.kind).toBe("run");
  if (s.shown.value?.kind === "run") s.open(s.shown.value.content);
  expect(d.draft.value).toMatchObject({ text: "home", name: "run", base: null });
});

test("a text that cannot be read leads back to the list", async () => {
  void s.showHash(ARM, "abc");
  refuse(await next(), "gone");
  await pass();
  expect([s.shown.value, said()]).toEqual([{ kind: "list" }, ["gone", true]]);
});

test("a version is shown with the one before it", async () => {
  void s.showVersion(ARM, "w");
  const first = await next();
  answer(first, ProgramContentSchema, { version: { number: 4 }, text: "new" });
  const second = await next();
  expect([first, second].map((each) => read(each, ProgramQuerySchema).version)).toEqual([0, 3]);
  answer(second, ProgramContentSchema, { text: "old" });
  await pass();
  expect(s.shown.value).toMatchObject({ kind: "program", against: 3, content: { text: "new" }, old: { text: "old" } });
});

test("an older version becomes the newest, on which an equal draft is then based", async () => {
  draw("old");
  const content = create(ProgramContentSchema, { program: WELD, version: { number: 2 }, text: "old" });
  void s.restore(ARM, content);
  const { request, asked } = await nextChange();
  expect([asked, read(request, ProgramRequestSchema).version]).toEqual([["RESTORE", "w", 4, "", ""], 2]);
  answer(request, ProgramAnswerSchema, { version: { number: 5, name: "weld" } });
  await pass();
  expect([d.draft.value?.base?.version, d.isUnsaved.value]).toEqual([5, false]);
});

test("a deleted program stays in the list, as deleted, and its name is taken", async () => {
  const deleted = { id: "x", current: { number: 2, name: "program", change: Change.DELETED } };
  s.stored.value = create(ProgramListSchema, { programs: [WELD, deleted] });
  expect(s.stored.value.programs.map(s.isDeleted)).toEqual([false, true]);
  expect(s.unusedProgramName()).toBe("program-2");
  void s.importText(ARM, "weld", "home");
  expect((await nextChange()).asked).toEqual(["SAVE", "w", 4, "weld", "home"]);
  void s.importText(ARM, "program", "home");
  expect((await nextChange()).asked).toEqual(["SAVE", "", 0, "program", "home"]);
});
