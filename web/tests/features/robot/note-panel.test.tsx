// The note on the robot's page: its choice of time.

import { expect, test } from "vitest";
import { NoteRequestSchema } from "../../../src/gen/robomesh_pb";
import { connect, newPage, next, read } from "../../console";
import { press, submit, type } from "../../hands";
import { show } from "../../shown";

test.each([
  ["Now", undefined],
  ["Last 10 s", 10],
  ["Last minute", 60],
])("a note on %s is on these seconds", async (choice, seconds) => {
  newPage();
  const { NoteButton, NotePanel } = await import("../../../src/features/robot/note-panel");
  await connect();
  (await import("../../../src/mesh/control/control")).setOperator("li");
  show(
    <>
      <NoteButton />
      <NotePanel robotKey="robomesh/hall/arm" />
    </>,
  );
  press("Note…");
  press(choice);
  type("input[aria-label=Text]", "slipped");
  submit();
  const { begin, end } = read(await next(), NoteRequestSchema);
  expect(begin && end && Number(end.seconds - begin.seconds)).toBe(seconds);
});
