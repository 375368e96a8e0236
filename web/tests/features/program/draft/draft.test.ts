// The draft of a program: kept while it is typed, with undo and redo of whole steps.

import { beforeEach, expect, test, vi } from "vitest";
import { readProgramFile } from "../../../../src/features/program/draft/program-files";
import { newPage } from "../../../console";
import { ARM } from "../../../recorded";

const KEPT = `robomesh.program/${ARM}`;
const BASE = { id: "1", version: 3, name: "weld", text: "home\n" };
let d: typeof import("../../../../src/features/program/draft/draft");
let field: HTMLTextAreaElement;

beforeEach(async () => {
  newPage();
  d = await import("../../../../src/features/program/draft/draft");
  field = document.body.appendChild(document.createElement("textarea"));
  d.openDraft(ARM);
  d.setField(field);
  return () => {
    d.setField(null);
    field.remove();
  };
});

const text = () => d.draft.value?.text;
/** Type, after a pause [ms]. */
function type(all: string, pause = 100): void {
  vi.advanceTimersByTime(pause);
  field.value = all;
  d.recordTyping();
}

test("text that is typed without a pause is one step, and undo and redo restore text and field", () => {
  type("ho", 5000);
  type("home");
  type("home\n", 5000);
  const steps = [d.undo, d.undo, d.undo, d.redo, d.redo, d.redo].map((step) => {
    step();
    return [text(), field.value];
  });
  expect(steps).toEqual(["home", "", "", "home", "home\n", "home\n"].map((each) => [each, each]));
});

test("what is typed after an undo is a step of its own, and nothing is redone over it", () => {
  type("a", 5000);
  d.undo();
  type("b", 0);
  expect([d.canUndo.value, d.canRedo.value]).toEqual([true, false]);
  d.undo();
  expect(text()).toBe("");
});

test("200 steps can be undone, the newest", () => {
  for (let i = 1; i <= 210; i++) type(String(i), 1000);
  for (let i = 0; i < 300; i++) d.undo();
  expect(text()).toBe("10");
});

test("a paste replaces the selection as one step of its own", () => {
  type("one two", 5000);
  field.setSelectionRange(4, 7);
  d.insert("2");
  expect([text(), field.value, field.selectionStart]).toEqual(["one 2", "one 2", 5]);
  d.undo();
  expect(text()).toBe("one two");
});

test("a text that the page writes puts the cursor at the end of the line", () => {
  d.replace("home\nwait 1\nend", 2);
  expect([text(), field.selectionStart, d.cursorLine()]).toEqual(["home\nwait 1\nend", 11, 2]);
  d.replace("home\nwait 1\nend");
  d.undo();
  expect([text(), d.canUndo.value]).toEqual(["", false]);
});

test("a line that is shown is selected whole", () => {
  d.replace("home\nwait 1\nend");
  d.goToLine(2);
  expect(field.value.slice(field.selectionStart, field.selectionEnd)).toBe("wait 1");
});

test("a draft outlives a reload, with the version that it is based on", () => {
  d.replaceDraft({ text: "home", name: "weld", base: BASE });
  d.draft.value = null;
  expect(d.openDraft(ARM)).toBe(true);
  expect(d.draft.value).toEqual({ robotKey: ARM, name: "weld", text: "home", base: BASE });
  expect(d.canUndo.value).toBe(false);
});

test.each([
  ["nothing", null],
  ["no JSON", "{"],
  ["no text", '{"name": "a"}'],
])("a stored draft with %s is an empty one", (_, stored) => {
  if (stored) localStorage.setItem(KEPT, stored);
  expect(d.openDraft(ARM)).toBe(false);
  expect([text(), d.draft.value?.base]).toEqual(["", null]);
});

test("a stored draft with an unreadable base was never saved", () => {
  localStorage.setItem(KEPT, JSON.stringify({ name: "a", text: "home", base: { ...BASE, version: "3" } }));
  d.openDraft(ARM);
  expect([text(), d.draft.value?.base]).toEqual(["home", null]);
});

test("a draft that the browser cannot keep says why, until it can", () => {
  const full = vi.spyOn(localStorage, "setItem").mockImplementation(() => {
    throw new Error("full");
  });
  type("home");
  expect(d.storageError.value).toContain("full");
  full.mockRestore();
  type("home\n");
  expect(d.storageError.value).toBe("");
});

test.each([
  ["the saved text", {}, false],
  ["another text", { text: "end" }, true],
  ["another name", { name: "cut" }, true],
  ["a text that was never saved", { base: null }, true],
  ["no text", { text: "", base: null }, false],
])("%s is unsaved: %#", (_, change, unsaved) => {
  d.replaceDraft({ text: BASE.text, name: BASE.name, base: BASE, ...change });
  expect(d.isUnsaved.value).toBe(unsaved);
});

test("a version that was saved stays saved when a step is undone; another program's does not", () => {
  d.replaceDraft({ text: "home\nend", name: "weld", base: BASE });
  type("home\nwait 1\nend", 5000);
  d.setBase({ ...BASE, version: 4, text: "home\nwait 1\nend" });
  d.undo();
  expect([text(), d.draft.value?.base?.version]).toEqual(["home\nend", 4]);
  d.startProgram("wait 2", "new");
  expect(d.draft.value?.base).toBeNull();
  d.undo();
  expect(d.draft.value?.base?.version).toBe(4);
});

test.each([
  [new File(["home\r\nend\rwait"], "weld.v2.prog"), { name: "weld.v2", text: "home\nend\nwait" }],
  [new File(["x".repeat(64 * 1024)], "a"), { name: "a", text: "x".repeat(64 * 1024) }],
  [new File(["x".repeat(64 * 1024 + 1)], "a"), { problem: "too_large" }],
  [new File(["a\0b"], "a.prog"), { problem: "no_text" }],
])("a file is read as a program, or refused with the reason: %#", async (file, expected) => {
  expect(await readProgramFile(file)).toEqual(expected);
});
