// Reasons on the page: in English the mesh's own sentence, in Chinese the catalogue's.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { afterEach, expect, test } from "vitest";
import { ReasonSchema } from "../../src/gen/robomesh_pb";
import * as page from "../../src/i18n/reasons";
import { isSaid, operatorText } from "../../src/i18n/stop-words";
import { showFirstLanguage } from "../../src/i18n/texts";

type Init = MessageInitShape<typeof ReasonSchema>;
const LIMIT: Init = {
  code: "joints.limit",
  values: { name: "elbow", value: "-131.0°", limit: "-120.0°" },
  text: "joint elbow at -131.0° is beyond its limit -120.0°",
};
const HELD: Init = { code: "lease.held", values: { holder: "עלי" }, text: "עלי is in control" };
const WAIT: Init = { code: "account.wait", values: { seconds: "30" }, text: "too many attempts: try again in 30 s" };

async function inBoth(show: () => string): Promise<string[]> {
  await showFirstLanguage("en");
  const english = show();
  await showFirstLanguage("zh");
  return [english, show()];
}
const shown = (reason: Init) => inBoth(() => page.reasonText(create(ReasonSchema, reason)));

afterEach(() => showFirstLanguage("en"));

test.each<[string, Init, string, string]>([
  [
    "numbers have the page's minus sign",
    LIMIT,
    "joint elbow at −131.0° is beyond its limit −120.0°",
    "关节 elbow 的 −131.0° 超出限位 −120.0°",
  ],
  [
    "a stop without a reason names only its sender",
    { code: "program.stopped", values: { by: "li", reason: "console" }, text: "stopped by li: console" },
    "stopped by li",
    "由 li 停止",
  ],
  [
    "a stop's reason is said",
    { code: "program.stopped", values: { by: "li", reason: "smoke" }, text: "stopped by li: smoke" },
    "stopped by li: smoke",
    "li 请求停止：smoke",
  ],
  [
    "a cause is in the page's language",
    { code: "program.line", values: { line: "3" }, causes: [LIMIT], text: `line 3: ${LIMIT.text}` },
    "line 3: joint elbow at −131.0° is beyond its limit −120.0°",
    "第 3 行：关节 elbow 的 −131.0° 超出限位 −120.0°",
  ],
  [
    "a cause that has no translation is in English",
    { code: "program.line", values: { line: "3" }, causes: [{ code: "x", text: "new" }], text: "line 3: new" },
    "line 3: new",
    "第 3 行：new",
  ],
  [
    "a code of one kind of controllers is translated",
    { code: "fanuc.state_old", text: "old" },
    "old",
    "控制器的最新状态已过时",
  ],
  [
    "an unknown code shows its English",
    { code: "future.code", text: "something new" },
    "something new",
    "something new",
  ],
  [
    "a code that is a word of the program's shows its English",
    { code: "constructor", text: "something new" },
    "something new",
    "something new",
  ],
  [
    "a reason without a value shows its English",
    { code: "joints.limit", values: { name: "elbow" }, text: "elbow at its limit" },
    "elbow at its limit",
    "elbow at its limit",
  ],
])("%s", async (_, reason, english, chinese) => {
  expect(await shown(reason)).toEqual([english, chinese]);
});

test("a line to be typed into a site file keeps its numbers", async () => {
  const values = { height_mm: "-240", below_mm: "-250" };
  const text = "if the floor is lower than -240 mm, write floor = -250.0 for the robot";
  const [english, chinese] = await shown({ code: "check.floor_advice", values, text });
  expect(english).toBe(text.replace("-240", "−240"));
  expect(chinese).toMatch(/−240 mm.*floor = -250\.0/);
});

test("only whole numbers that are values get the page's minus sign", async () => {
  const text = "-7 is none of -71, a-7 and 1.-7";
  expect((await shown({ code: "x", values: { given: "-7" }, text }))[0]).toBe(text.replace("-7", "−7"));
});

test("a value has the words of its language, also with a robot's name", async () => {
  const values = { work: "the controller of arm1", seconds: "0.50" };
  const [, chinese] = await shown({ code: "gateway.occupied", values, text: "occupied" });
  expect(chinese).toMatch(/^arm1 的控制器 占用/);
});

test("a hyphen of the sentence stays", async () => {
  const values = { word: "speed", name: "x", given: "-7", most: "5" };
  const text = "'speed': x is -7; must be between -5 and 5";
  expect((await shown({ code: "program.number_too_large", values, text }))[0]).toBe(text.replace("-7", "−7"));
});

test("a name from right to left is isolated, also in a cause, and once", async () => {
  for (const text of await shown({
    code: "program.control_ended",
    causes: [HELD],
    text: `control ended: ${HELD.text}`,
  })) {
    expect(text).toContain("\u2068עלי\u2069");
    expect(text).not.toContain("U+2068");
  }
});

test("seconds are counted down, in the sentence and in its translation", async () => {
  const reason = create(ReasonSchema, WAIT);
  expect(await inBoth(() => page.reasonText(page.withValue(reason, "seconds", "29")))).toEqual([
    "too many attempts: try again in 29 s",
    "尝试次数过多：请在 29 秒后重试",
  ]);
  expect(page.withValue(create(ReasonSchema, { code: "x", text: "29" }), "seconds", "29").text).toBe("29");
});

test("without a reason the text is shown, and several reasons are one text", () => {
  const reasons = [LIMIT, { code: "x", text: "new" }].map((each) => create(ReasonSchema, each));
  expect([page.reasonText(undefined, "old"), page.reasonText(undefined)]).toEqual(["old", ""]);
  expect([page.reasonsText([], "old"), page.reasonsText(undefined, "old")]).toEqual(["old", "old"]);
  expect(page.reasonsText(reasons, "old")).toBe("joint elbow at −131.0° is beyond its limit −120.0°; new");
});

test("a code that only one kind of controllers has is known as such", () => {
  expect([page.isOfKind("fanuc.state_old"), page.isOfKind("lease.held"), page.isOfKind("constructor")]).toEqual([
    true,
    false,
    false,
  ]);
});

test("words that programs write are no person's name or reason", () => {
  expect(["li", "", "anonymous", "somebody"].map((name) => operatorText(name))).toEqual([
    "li",
    ...Array(3).fill("an operator without a name"),
  ]);
  expect(operatorText("", "unnamed_operator_first")).toMatch(/^An/);
  expect([undefined, "", "console", "the page", "smoke"].map(isSaid)).toEqual([false, false, false, false, true]);
});
