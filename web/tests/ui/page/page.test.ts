// Undo, the theme, and files that the browser saves.

import { beforeEach, expect, test, vi } from "vitest";
import { newPage } from "../../console";

beforeEach(() => newPage());

test("undo and redo restore each state, and a new change ends the redo", async () => {
  const { undoHistory } = await import("../../../src/ui/page/undo-history");
  const history = undoHistory<string>(2);
  const can = () => [history.canUndo.value, history.canRedo.value];
  expect([can(), history.undo("a"), history.redo("a")]).toEqual([[false, false], undefined, undefined]);
  history.keep("a", false);
  history.keep("b", false);
  history.keep("b2", true); // a part of the change before
  expect([history.undo("c"), can(), history.redo("b"), history.undo("c"), history.undo("b"), can()]).toEqual([
    ...["b", [true, true], "c", "b", "a", [false, true]],
  ]);
  history.keep("a", false);
  expect([can(), history.redo("x")]).toEqual([[true, false], undefined]);
  history.undo("b");
  history.keep("a", true);
  expect(can()).toEqual([false, false]);
  for (const state of ["b", "c", "d"]) history.keep(state, false);
  expect([history.undo("e"), history.undo("d"), history.undo("c")]).toEqual(["d", "c", undefined]);
  history.clear();
  expect(can()).toEqual([false, false]);
});

test.each([
  [null, false, "dark"],
  [null, true, "light"],
  ["dark", true, "dark"],
  ["light", false, "light"],
  ["pink", false, "dark"],
])("of the stored theme %o and a light system (%s) the page is %s", async (stored, light, theme) => {
  vi.stubGlobal("matchMedia", () => ({ matches: light }));
  if (stored) localStorage.setItem("robomesh.theme", stored);
  const page = await import("../../../src/ui/page/theme");
  page.applyTheme();
  expect([page.theme.value, document.documentElement.dataset.theme]).toEqual([theme, theme]);
  page.switchTheme();
  const other = theme === "dark" ? "light" : "dark";
  expect([document.documentElement.dataset.theme, localStorage.getItem("robomesh.theme")]).toEqual([other, other]);
});

test("a saved file has its name, and its address for as long as the download may need it", async () => {
  const { saveFile } = await import("../../../src/ui/page/save-file");
  const revoke = vi.spyOn(URL, "revokeObjectURL");
  const clicked: string[] = [];
  vi.spyOn(HTMLAnchorElement.prototype, "click").mockImplementation(function (this: HTMLAnchorElement) {
    clicked.push(this.download, this.href.slice(0, 5));
  });
  saveFile(new Blob(["x"]), "a.csv");
  await vi.advanceTimersByTimeAsync(9900);
  expect([clicked, revoke.mock.calls.length]).toEqual([["a.csv", "blob:"], 0]);
  await vi.advanceTimersByTimeAsync(200);
  expect(revoke).toHaveBeenCalledOnce();
});
