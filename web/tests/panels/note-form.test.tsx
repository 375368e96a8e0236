// The form for a note on a robot's time.

import { beforeEach, expect, test, vi } from "vitest";
import { EventSchema, NoteRequestSchema } from "../../src/gen/robomesh_pb";
import type { NoteTime } from "../../src/mesh/services/notes";
import { answer, connect, newPage, next, read, refuse, requests } from "../console";
import { button, find, key, pass, press, submit, texts, type } from "../hands";
import { show } from "../shown";

const close = vi.fn();
let form: typeof import("../../src/panels/note-form");
let control: typeof import("../../src/mesh/control/control");
let draw: (on?: NoteTime | null) => void;
const TEXT = "input[aria-label=Text]";
const canSave = () => !button("Save note").disabled;
const outcome = () => find(".notice").textContent;

beforeEach(async () => {
  newPage();
  form = await import("../../src/panels/note-form");
  control = await import("../../src/mesh/control/control");
  close.mockReset();
  await connect();
  control.setOperator("li");
  const place = show(null);
  draw = (on = null) =>
    show(<form.NoteForm robotKey="robomesh/hall/arm" on={() => on} children="now" close={close} />, place);
});

test("a note is saved with its text, robot and time, in the operator's name, and the form closes", async () => {
  draw({ begin: 1000.4, end: 2500 });
  expect([document.activeElement, canSave()]).toEqual([find(TEXT), false]);
  type(TEXT, "  ");
  submit();
  expect(requests).toEqual([]);
  type(TEXT, " gripper slipped ");
  submit();
  submit();
  const request = await next();
  expect(request.key).toBe("robomesh/hall/-/notes/request/li");
  expect(read(request, NoteRequestSchema)).toMatchObject({
    text: "gripper slipped",
    robot: "arm",
    begin: { seconds: 1n, nanos: 0 },
    end: { seconds: 2n, nanos: 500_000_000 },
  });
  expect([outcome(), canSave(), requests]).toEqual(["Saving the note…", false, []]);
  answer(request, EventSchema, {});
  await pass();
  expect(close).toHaveBeenCalledOnce();
});

test.each([
  ["no", "no"],
  ["", "The site's store does not answer, so notes cannot be saved or read now."],
])("a note that was refused (%o) stays in the form, with the reason", async (error, why) => {
  draw();
  type(TEXT, "slipped");
  submit();
  refuse(await next(), error);
  await pass();
  expect([outcome(), find<HTMLInputElement>(TEXT).value, canSave()]).toEqual([
    expect.stringContaining(why),
    "slipped",
    true,
  ]);
  expect(close).not.toHaveBeenCalled();
});

test("a note needs a name", () => {
  control.setOperator("");
  draw();
  type(TEXT, "slipped");
  submit();
  expect([outcome(), canSave(), requests]).toEqual(["Enter your name: it is kept with the note.", false, []]);
  type("input[name=operator]", "li");
  expect([outcome(), canSave()]).toEqual(["", true]);
});

test("only operators write notes; an account has its own name", async () => {
  await connect({ account: "gu", operator: "gu.hall", mayCommand: false });
  draw();
  type(TEXT, "slipped");
  submit();
  expect([outcome(), canSave(), requests]).toEqual(["Only operators write notes.", false, []]);
  expect(texts("input[name=operator]")).toEqual([]);
});

test("Escape and Cancel close the form, and no other key", () => {
  draw();
  key(TEXT, "a");
  expect(close).not.toHaveBeenCalled();
  key(TEXT, "Escape");
  press("Cancel");
  expect(close).toHaveBeenCalledTimes(2);
});

test("a withdrawn text is struck through, and says so", () => {
  const place = show(<form.Withdrawable withdrawn={false}>slipped</form.Withdrawable>);
  expect(place.innerHTML).toBe("slipped");
  show(<form.Withdrawable withdrawn>slipped</form.Withdrawable>, place);
  expect([texts("del"), place.textContent]).toEqual([["slipped"], "slipped (withdrawn)"]);
});
