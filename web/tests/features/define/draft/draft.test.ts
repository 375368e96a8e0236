// The draft of a robot: undo of whole steps, what a reload restores, and what was saved.

import { beforeEach, expect, test, vi } from "vitest";
import { empty } from "../../../../src/features/define/description/description";
import { newPage } from "../../../console";

let d: typeof import("../../../../src/features/define/draft/draft");
/** Load the page again, with what its browser keeps. */
async function reload(): Promise<void> {
  vi.resetModules();
  d = await import("../../../../src/features/define/draft/draft");
}
beforeEach(async () => {
  newPage();
  await reload();
  d.openDraft({ description: empty(), files: {} });
});
const title = () => d.draft.value?.description.title;
function type(...texts: string[]): void {
  for (const text of texts) d.setValue("title", text);
}

test("changes of one field are one step until it is left, and undo and redo restore it", () => {
  type("A", "Ar", "Arm");
  d.endUndoStep();
  type("Arm 2");
  d.setValue("joint", []);
  d.setValue("tool/xyz/1", 5);
  expect(d.valueAt("tool/xyz")).toEqual([0, 5, 0]);
  const steps = [d.undo, d.undo, d.undo, d.undo, d.redo].map((step) => {
    step();
    return [d.valueAt("tool/xyz/1"), title()];
  });
  expect(steps).toEqual([
    [0, "Arm 2"],
    [0, "Arm"],
    [0, ""],
    [0, ""],
    [0, "Arm"],
  ]);
  expect([d.canUndo.value, d.canRedo.value]).toEqual([true, true]);
  type("B");
  expect(d.canRedo.value).toBe(false);
});

test("what is typed after an undo is a step of its own", () => {
  type("A");
  d.endUndoStep();
  type("B");
  d.undo();
  type("C");
  d.undo();
  expect(title()).toBe("A");
});

test("a choice is a step of its own even right after one of the same field", () => {
  d.setValue("title", "A", true);
  d.setValue("title", "B", true);
  d.undo();
  expect(title()).toBe("A");
});

test("a change to the same value is no step", () => {
  type("");
  expect(d.canUndo.value).toBe(false);
});

test("undo keeps 500 steps, and another draft begins without any", () => {
  for (let i = 1; i <= 510; i++) d.setValue("title", String(i), true);
  for (let i = 0; i < 600; i++) d.undo();
  expect(title()).toBe("10");
  d.openDraft({ description: empty(), files: {} });
  expect([d.canUndo.value, d.canRedo.value]).toEqual([false, false]);
});

test("an unsaved draft outlives a reload, and the page says since when", async () => {
  vi.setSystemTime(1e12);
  type("Arm");
  vi.setSystemTime(2e12);
  await reload();
  expect(d.restoreDraft("")).toBe(true);
  expect([title(), d.restoredFrom.value, d.isUnsaved.value, d.canUndo.value]).toEqual(["Arm", 1e12, true, false]);
  expect(d.newDrafts().map(({ at }) => at)).toEqual([1e12]);
});

test("a robot of the site is unsaved from its first change until it is saved or as it was", async () => {
  d.openDraft({ description: empty(), files: {} }, "arm", "site", "r1");
  expect([d.isUnsaved.value, d.hasStoredDraft("arm")]).toEqual([false, false]);
  type("Arm");
  expect([d.isUnsaved.value, d.hasStoredDraft("arm")]).toEqual([true, true]);
  d.undo();
  expect([d.isUnsaved.value, d.hasStoredDraft("arm")]).toEqual([false, false]);
  type("Arm");
  await reload();
  expect([d.restoreDraft("other"), d.restoreDraft("arm"), d.identity.value.revision]).toEqual([false, true, "r1"]);
});

test.each([
  ["library", ["", ""], false],
  ["site", ["arm", "r1"], false],
  [null, ["", ""], true],
] as const)("a robot from %s is saved at the site as %j, unsaved: %s", (origin, [siteName, revision], unsaved) => {
  d.openDraft({ description: empty(), files: {} }, "arm", origin, "r1");
  expect(d.identity.value).toMatchObject({ siteName, revision });
  expect(d.isUnsaved.value).toBe(unsaved);
});

test("what is changed while it is saved stays unsaved", () => {
  type("Arm");
  const [saved, of] = [d.draft.value, d.identity.value];
  type("Arm 2");
  if (saved) d.markSaved(saved, of, "arm", "r1");
  expect([d.isUnsaved.value, d.identity.value.owner, d.newDrafts()]).toEqual([true, "arm", []]);
  expect(d.hasStoredDraft("arm")).toBe(true);
  d.undo();
  if (d.draft.value) d.markSaved(d.draft.value, d.identity.value, "arm", "r2");
  expect([d.isUnsaved.value, d.hasStoredDraft("arm")]).toEqual([false, false]);
});

test("a save that ends after another draft was opened does not name that one", () => {
  type("Arm");
  const [saved, of] = [d.draft.value, d.identity.value];
  d.startNewDraft();
  d.openDraft({ description: empty(), files: {} });
  if (saved) d.markSaved(saved, of, "arm", "r1");
  expect([d.identity.value.owner, d.newDrafts().map(({ name }) => name)]).toEqual(["", ["my-arm"]]);
});

test("new drafts of all tabs are listed, the last changed first, and their files are kept", () => {
  type("One");
  d.startNewDraft();
  vi.advanceTimersByTime(1000);
  d.openDraft({ description: empty(), files: { "a.stl": "abc" } });
  type("Two");
  expect(d.newDrafts().map(({ name }) => name)).toEqual(["Two", "One"]);
  expect([...d.storedFiles()]).toEqual(["abc"]);
  d.deleteDraft();
  expect([d.draft.value, d.newDrafts().map(({ name }) => name)]).toEqual([null, ["One"]]);
});

test.each(["{", '{"draft": {}}', "null"])("an unreadable stored draft is none: %s", (stored) => {
  localStorage.setItem("robomesh.define.draft/arm", stored);
  expect([d.restoreDraft("arm"), d.hasStoredDraft("arm")]).toEqual([false, false]);
});

test("a draft that the browser cannot keep says why", () => {
  vi.spyOn(localStorage, "setItem").mockImplementation(() => {
    throw new Error("full");
  });
  type("Arm");
  expect(d.storageError.value).toContain("full");
});
