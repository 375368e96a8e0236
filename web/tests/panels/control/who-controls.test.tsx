// Who is in control of a robot, and how an operator gets, offers and gives it back.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import {
  LeaseRequest_Action as Action,
  LeaseAnswerSchema,
  LeaseRequestSchema,
  LeaseSchema,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read, requests } from "../../console";
import { button, find, key, pass, press, pressable, submit, texts, type } from "../../hands";
import { show } from "../../shown";

const ROBOT = "robomesh/hall/arm";
const at = (ms: number) => timestampFromMs(1e12 + ms);
let panel: typeof import("../../../src/panels/control/who-controls");
let control: typeof import("../../../src/mesh/control/control");
let connection: typeof import("../../../src/mesh/console/connection");
let account: typeof import("../../../src/mesh/console/account");
let draw: (holder: string | null, lease?: MessageInitShape<typeof LeaseSchema> | null, readOnly?: boolean) => void;

beforeEach(async () => {
  newPage();
  panel = await import("../../../src/panels/control/who-controls");
  control = await import("../../../src/mesh/control/control");
  connection = await import("../../../src/mesh/console/connection");
  account = await import("../../../src/mesh/console/account");
  control.followThisTab();
  await connect();
  control.setOperator("li");
  const place = show(null);
  draw = (holder, more = {}, readOnly = false) => {
    const lease = more
      ? create(LeaseSchema, { holder: holder ?? "", since: at(0), timestamp: at(10_000), ...more })
      : undefined;
    const props = { robotKey: ROBOT, holder, lease };
    show(
      <>
        <panel.Holder {...props} />
        <panel.WhoControls {...props} readOnly={readOnly} />
        <panel.ControlRequests {...props} />
      </>,
      place,
    );
  };
});

async function hold(): Promise<void> {
  const taken = control.take(ROBOT);
  answer(await next(), LeaseAnswerSchema, { lease: "l", since: at(0), now: at(0), until: at(60_000) });
  await taken;
}
/** The next request: its sender, its action, and its values. */
async function nextAsked(): Promise<unknown[]> {
  const request = await next();
  const { action, reason, to } = read(request, LeaseRequestSchema);
  return [request.key.split("/").at(-1), Action[action], reason, to];
}
const notice = () => control.controlNotice.value?.text;
const wishes = () => texts(".wish p");
const asker = (operator: string, since = 4000, reason = "") => ({ operator, since: at(since), reason });

test.each([
  [null, "", "Who is in control is not known", ["Ask for control", "Take over…"]],
  ["", "", "Nobody is in control", ["Take control"]],
  ["wang", "", "wang is in control", ["Ask for control", "Take over…"]],
  ["li", "", "You (li) are in control in another window", ["Take over…"]],
  ["li", "mine", "You are in control", ["Release"]],
])("of the holder %o (%s) the page says %o and offers %o", async (holder, mine, says, offers) => {
  if (mine) await hold();
  draw(holder, { holder: holder ?? "wang" });
  expect(texts(".holder")).toEqual([says]);
  expect(texts(".holder .shape.mine")).toHaveLength(mine ? 1 : 0);
  expect(texts(".since")).toHaveLength(holder ? 1 : 0);
  expect(find(".holder").classList.contains("mine")).toBe(mine !== "");
  expect(pressable()).toEqual(offers);
});

test.each(["", "wang"])(
  "without a connection, and of a robot that is only watched, nothing is asked for (%o)",
  (holder) => {
    draw(holder, {}, true);
    expect(pressable()).toEqual([]);
    draw(holder);
    expect(pressable()).not.toEqual([]);
    connection.lostAt.value = 1;
    draw(holder);
    expect(pressable()).toEqual([]);
  },
);

test("the name is the operator's own, and fixed while it is in control or the account's", async () => {
  draw("");
  const field = find<HTMLInputElement>("input[name=operator]");
  type("input[name=operator]", "chen");
  expect(control.operator.value).toBe("chen");
  await hold();
  draw("chen");
  expect(field.disabled).toBe(true);
  void control.release();
  draw("");
  expect(field.disabled).toBe(false);
  await connect({ operator: "chen.hall" });
  draw("");
  expect([field.disabled, field.value]).toEqual([true, "chen.hall"]);
});

test("Enter in the name takes free control, and never another operator's", async () => {
  draw("wang");
  key("input[name=operator]", "Enter");
  draw("");
  key("input[name=operator]", "a");
  expect(requests).toEqual([]);
  key("input[name=operator]", "Enter");
  expect(await nextAsked()).toEqual(["li", "ACQUIRE", "", ""]);
});

test("the buttons take control and release it", async () => {
  draw("");
  press("Take control");
  answer(await next(), LeaseAnswerSchema, { lease: "l", since: at(0), now: at(0), until: at(60_000) });
  await pass();
  press("Release");
  expect(await nextAsked()).toEqual(["li", "RELEASE", "", ""]);
});

test("who has no name is told so, and gets no form", () => {
  control.setOperator(" ");
  draw("wang");
  press("Take over…");
  expect(texts("form")).toEqual([]);
  expect(notice()).toMatch(/^Enter your name first/);
});

test("control is asked for with or without a reason", async () => {
  draw("wang");
  press("Ask for control");
  submit();
  expect(await nextAsked()).toEqual(["li", "ASK", "", ""]);
  press("Ask for control");
  type(".reason input", " lunch ");
  submit();
  expect(await nextAsked()).toEqual(["li", "ASK", "lunch", ""]);
  expect(texts("form")).toEqual([]);
});

test("control is taken over only with a reason, after a warning of a motion that it stops", async () => {
  draw("wang");
  press("Take over…");
  expect(texts(".reason > p")).toEqual([expect.not.stringMatching(/^wang's motion is running/)]);
  draw("wang", { motion: true });
  expect(texts(".reason > p")).toEqual([expect.stringMatching(/^wang's motion is running: it will be stopped/)]);
  type(".reason input", "  ");
  submit();
  expect(button("Take over from wang").disabled).toBe(true);
  expect(requests).toEqual([]);
  type(".reason input", "fire");
  submit();
  expect(await nextAsked()).toEqual(["li", "TAKE", "fire", ""]);
});

test.each([
  ["Cancel", () => press("Cancel")],
  ["Escape", () => key(".reason input", "Escape")],
  ["another operator in control", () => draw("chen")],
  ["the same operator in control again", () => draw("wang", { since: at(1) })],
  ["the end of control", () => draw("")],
])("%s closes a form: its reason was for one operator", (_, change) => {
  for (const form of ["Ask for control", "Take over…"]) {
    draw("wang");
    press(form);
    type(".reason input", "because");
    expect(texts("form")).toHaveLength(1);
    change();
    expect(texts("form")).toEqual([]);
  }
});

test("a reason stays while it is not known who is in control, and Escape gives the focus back", () => {
  draw("wang");
  button("Take over…").focus();
  press("Take over…");
  type(".reason input", "smoke");
  draw(null, { holder: "wang" });
  expect(texts(".holder")).toEqual(["Who is in control is not known"]);
  draw("wang");
  expect([find<HTMLInputElement>(".reason input").value, document.activeElement]).toEqual([
    "smoke",
    find(".reason input"),
  ]);
  key(".reason input", "Escape");
  expect(document.activeElement).toBe(button("Take over…"));
});

test("a name that is in control in another window takes over from itself", async () => {
  draw("li");
  press("Take over…");
  type(".reason input", "I sit here now");
  submit();
  expect(await nextAsked()).toEqual(["li", "TAKE", "I sit here now", ""]);
});

test("a monitor's account is offered no control, and sees no requests for it", () => {
  account.me.value = { account: "gu", role: "monitor" } as typeof account.me.value;
  draw("wang", { askedBy: [asker("chen")] });
  expect(texts("button, .wish")).toEqual([]);
  expect(texts(".no-control")).toEqual([expect.stringContaining("gu is a monitor’s account")]);
});

test("an account whose right rests can release, and take no control before its password", async () => {
  await hold();
  await connect({ account: "li", mayCommand: false });
  draw("li");
  expect(pressable()).toEqual(["Release"]);
  draw("li", { askedBy: [asker("chen")] });
  expect(wishes()).toHaveLength(1);
  void control.release();
  draw("", {});
  expect(pressable()).toEqual(["Show", "Give the right back"]);
});

test("every page shows requests for control, and only who is in control can answer them", async () => {
  const lease = { askedBy: [asker("chen", 4000, "lunch"), asker("li", 7000)] };
  draw("wang", lease);
  expect(wishes()).toEqual([
    "chen asks for control: “lunch”",
    "You asked wang for control 3\u202fs ago; no answer yet",
  ]);
  expect(texts(".wish button, .wish.strong")).toEqual([]);
  draw("wang", { askedBy: [asker("li", 11_000)] });
  expect(wishes()).toEqual(["You asked wang for control 0\u202fs ago; no answer yet"]);
  await hold();
  draw("li", { askedBy: [asker("chen")] });
  expect(texts(".wish.strong button")).toEqual(["Hand over to chen", "Not now"]);
});

test.each([
  ["nobody is in control", "", {}],
  ["who is in control is not known", null, {}],
  ["no lease was received", "wang", null],
])("no request is shown while %s", (_, holder, lease) => {
  draw(holder, lease && { ...lease, askedBy: [asker("chen")] });
  expect(texts(".wishes")).toEqual([]);
});

test("a request that was declined stays away, and a later one of the same operator comes", async () => {
  await hold();
  draw("li", { askedBy: [asker("chen", 1), asker("sun", 2)] });
  press("Not now");
  expect(wishes()).toEqual(["sun asks for control"]);
  draw("li", { askedBy: [asker("chen", 3), asker("sun", 2)] });
  expect(wishes()).toEqual(["chen asks for control", "sun asks for control"]);
});

test("three requests are shown, and how many more there are", async () => {
  const askedBy = ["a", "b", "c", "d", "e"].map((name) => asker(name));
  draw("wang", { askedBy });
  expect(wishes().slice(2)).toEqual(["c asks for control", "and 2 more"]);
  draw("wang", { askedBy: askedBy.slice(2) });
  expect(wishes()).toHaveLength(3);
});

test("control is handed over by an offer, which can be withdrawn", async () => {
  await hold();
  const askedBy = [asker("chen")];
  draw("li", { askedBy });
  press("Hand over to chen");
  expect(await nextAsked()).toEqual(["li", "OFFER", "", "chen"]);
  draw("li", { askedBy, offeredTo: "chen" });
  expect(wishes()).toEqual(["Offered to chen, no answer yet: you are in control until chen accepts."]);
  press("Withdraw");
  expect(await nextAsked()).toEqual(["li", "OFFER", "", "li"]);
  draw("li", { askedBy });
  expect(wishes()).toEqual([]); // its request was answered
});

test("offered control is accepted, or not now; an offer that is repeated is a new one", async () => {
  draw("wang", { offeredTo: "li" });
  expect(wishes()).toEqual(["wang offers you control."]);
  press("Not now");
  expect(wishes()).toEqual([]);
  draw("wang");
  draw("wang", { offeredTo: "li" });
  press("Accept");
  expect(await nextAsked()).toEqual(["li", "ACCEPT", "", ""]);
  connection.lostAt.value = 1;
  await pass();
  expect(button("Accept").disabled).toBe(true);
});

test("an offer to another operator is shown without buttons", () => {
  draw("wang", { offeredTo: "chen" });
  expect(wishes()).toEqual(["wang offers control to chen."]);
  expect(texts(".wish button, .wish.strong")).toEqual([]);
});

const expired = expect.stringMatching(/^wang did not answer your request/);
test.each<[string, unknown, () => void | Promise<void>]>([
  ["that ended", expired, () => draw("wang")],
  ["of an operator with another name now", undefined, () => void (control.setOperator("chen"), draw("wang"))],
  ["that was answered by an offer", undefined, () => draw("wang", { offeredTo: "li" })],
  ["after which another is in control", undefined, () => draw("sun")],
  ["after which control began anew", undefined, () => draw("wang", { since: at(1) })],
  ["of which no more is known", undefined, () => draw("wang", null)],
])("a request %s is called expired only if nobody answered it", async (_, says, change) => {
  draw("wang", { askedBy: [asker("sun"), asker("li")] });
  draw("wang", { askedBy: [asker("li")] });
  expect(notice()).toBeUndefined();
  await change();
  expect(notice()).toEqual(says);
});

test("the request of who has got control has not expired", async () => {
  draw("wang", { askedBy: [asker("li")] });
  await hold();
  draw("wang");
  expect(notice()).toBeUndefined();
});
