// The editor of a program: its keys.

import { beforeEach, expect, test } from "vitest";
import { ProgramRequest_Action as Action, ProgramRequestSchema } from "../../../src/gen/robomesh_pb";
import { connect, newPage, next, read } from "../../console";
import { key, pass, type } from "../../hands";
import { ARM } from "../../recorded";
import { show } from "../../shown";

const FIELD = ".editor-field";
let d: typeof import("../../../src/features/program/draft/draft");

beforeEach(async () => {
  newPage();
  d = await import("../../../src/features/program/draft/draft");
  const { Editor } = await import("../../../src/features/program/editor");
  const { setOperator } = await import("../../../src/mesh/control/control");
  await connect();
  setOperator("li");
  d.openDraft(ARM);
  show(<Editor />);
  type(FIELD, "home\n");
  await pass(5000);
});

test.each(["z", "Z"])("Ctrl+%s undoes the last step, and redoes it with Shift or as Ctrl+Y", (letter) => {
  const text = () => d.draft.value?.text;
  key(FIELD, letter, { ctrlKey: true });
  expect(text()).toBe("");
  key(FIELD, letter, { ctrlKey: true, shiftKey: true });
  expect(text()).toBe("home\n");
  key(FIELD, letter, { metaKey: true });
  key(FIELD, "y", { ctrlKey: true });
  expect(text()).toBe("home\n");
  for (const more of [{}, { ctrlKey: true, altKey: true }]) key(FIELD, letter, more);
  expect(text()).toBe("home\n");
});

test("Ctrl+S saves the program", async () => {
  key(FIELD, "s", { ctrlKey: true });
  expect(read(await next(), ProgramRequestSchema)).toMatchObject({ action: Action.SAVE, text: "home\n" });
});
