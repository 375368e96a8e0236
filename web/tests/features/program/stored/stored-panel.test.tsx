// The site's programs on the program's page: files that are taken in and given out, and drafts that opening would lose.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ProgramRequest_Action as Action,
  ProgramAnswerSchema,
  ProgramContentSchema,
  ProgramListSchema,
  ProgramQuerySchema,
  ProgramRequestSchema,
} from "../../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, requests } from "../../../console";
import { find, pass, press, texts } from "../../../hands";
import { ARM } from "../../../recorded";
import { show } from "../../../shown";

const WELD = { id: "w", current: { number: 4, name: "weld", sha256: "new" } };
let s: typeof import("../../../../src/features/program/stored/stored-programs");
let d: typeof import("../../../../src/features/program/draft/draft");

beforeEach(async () => {
  newPage();
  s = await import("../../../../src/features/program/stored/stored-programs");
  d = await import("../../../../src/features/program/draft/draft");
  const { StoredPanel } = await import("../../../../src/features/program/stored/stored-panel");
  await connect();
  d.openDraft(ARM);
  d.setField(document.createElement("textarea"));
  s.stored.value = create(ProgramListSchema, { programs: [WELD] });
  s.shown.value = { kind: "list" };
  show(<StoredPanel robotKey={ARM} />);
  await pass();
});

async function take(...files: File[]): Promise<void> {
  const input = find<HTMLInputElement>("input[type=file]");
  Object.defineProperty(input, "files", { value: files, configurable: true });
  await act(() => void input.dispatchEvent(new Event("change", { bubbles: true })));
  await pass();
}

test("files become programs byte for byte, one of a known name its next version, and a large one is refused", async () => {
  await take(new File(["home # ü\n"], "Größe.prog"), new File(["home"], "weld.prog"));
  for (const [name, id, text] of [
    ["Größe", "", "home # ü\n"],
    ["weld", "w", "home"],
  ]) {
    const request = await next();
    expect(read(request, ProgramRequestSchema)).toMatchObject({ action: Action.SAVE, id, name, text });
    answer(request, ProgramAnswerSchema, { program: WELD, version: { number: 1, name: name ?? "" } });
    await pass();
  }
  await take(new File(["#".repeat(70_000)], "big.prog"));
  expect([s.lastAction.value.words(), s.lastAction.value.refused]).toEqual([
    expect.stringMatching(/^big.prog.*more than 64 KiB/),
    true,
  ]);
  expect(requests).toEqual([]);
});

test("a version is saved as a file of its name and text", async () => {
  const saved = vi.spyOn(await import("../../../../src/ui/page/save-file"), "saveFile").mockReturnValue();
  const version = { number: 4, name: "weld", sha256: "new" };
  const content = create(ProgramContentSchema, { program: WELD, version, versions: [version], text: "home # ü\n" });
  s.shown.value = { kind: "program", content, against: null, old: null };
  await pass();
  press("Export file");
  const [blob, name] = saved.mock.calls[0] ?? [];
  expect([await blob?.text(), name]).toEqual(["home # ü\n", "weld.prog"]);
});

test("a program is opened at once over saved work, and after a question over a text that nobody saved", async () => {
  d.startDraft("# another\n");
  await pass();
  press("Open weld");
  expect([texts("[role=alert]").length, requests]).toEqual([1, []]);
  press("Cancel");
  expect(texts("[role=alert]")).toEqual([]);
  press("Open weld");
  press("Open instead");
  const request = await next();
  expect(read(request, ProgramQuerySchema).id).toBe("w");
  answer(request, ProgramContentSchema, { program: WELD, version: WELD.current, text: "# mine\n" });
  await pass();
  expect(d.draft.value?.text).toBe("# mine\n");
  d.undo();
  expect(d.draft.value?.text).toBe("# another\n");
  d.redo();
  s.shown.value = { kind: "list" };
  await pass();
  press("Open weld");
  expect((await next()).key).toContain("/programs/read");
});
