// A value that a newer program has added to an enum is shown as its number.

import { expect, test } from "vitest";
import { jointText } from "../src/i18n/format";
import { outcomeMark, severityMark } from "../src/ui/marks/event-mark";
import { priorityWord } from "../src/ui/marks/priority-mark";

const NEW = 77 as never;

test("an unknown severity, outcome, priority or type of joint is its number, and needs attention", () => {
  for (const mark of [severityMark(NEW), outcomeMark(NEW)]) expect(mark).toEqual({ text: "77", level: "warning" });
  expect([priorityWord(NEW), jointText({ type: NEW } as never, 1.5)]).toEqual(["77", "1.5000\u202f"]);
});
