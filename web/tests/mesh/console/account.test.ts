// The page's account: what its role permits, and how its session ends.

import { effect } from "@preact/signals";
import { beforeEach, expect, test, vi } from "vitest";
import type { Me } from "../../../src/mesh/console/account";
import { connect, newPage, say } from "../../console";

let page: typeof import("../../../src/mesh/console/account");
const LI = {
  accounts: true,
  account: "li",
  role: "operator",
  operator: "li.hall",
  may_command: true,
  session: "s",
} as Me;
const NOBODY = { ...LI, account: "", role: "", operator: "", may_command: false, session: "" } as Me;
const asked: string[] = [];
let reply: () => Promise<Response>;
const replies =
  (body: unknown, status = 200) =>
  async () =>
    new Response(JSON.stringify(body), { status, headers: { "Content-Type": "application/json" } });
const greet = (value: object) => say({ case: "hello", value } as never);

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/console/account");
  asked.length = 0;
  reply = replies(LI);
  vi.stubGlobal("fetch", (address: string, init: RequestInit) => {
    asked.push(`${address}${init.body ? ` ${String(init.body)}` : ""}`);
    return reply();
  });
});

test.each([
  ["monitor", false, "isMonitor"],
  ["operator", true, "mayAct"],
  ["operator", false, "commandSuspended"],
  ["engineer", true, "isEngineer mayAct"],
  ["admin", true, "isAdministrator isEngineer mayAct"],
] as const)("the role %s that may command (%s) is %s", async (role, mayCommand, expected) => {
  await connect({ account: "li", mayCommand } as never);
  page.me.value = { ...LI, role };
  const names = ["isAdministrator", "isEngineer", "isMonitor", "mayAct", "commandSuspended", "mustSignIn"] as const;
  expect(names.filter((name) => page[name].value).join(" ")).toBe(expected);
});

test("a console without accounts forbids nothing, one with accounts wants a sign-in", async () => {
  await connect();
  expect([page.mayAct.value, page.isEngineer.value, page.mustSignIn.value]).toEqual([true, true, false]);
  page.me.value = { ...NOBODY, accounts: false };
  expect([page.isEngineer.value, page.mustSignIn.value]).toEqual([true, false]);
  page.me.value = NOBODY;
  expect([page.isEngineer.value, page.mustSignIn.value]).toEqual([false, true]);
});

test("an account that the console no longer knows ended with its restart, unless it ended before", async () => {
  expect(await page.fetchAccount()).toEqual(LI);
  expect(page.endedBy.value).toBe("");
  reply = replies(NOBODY);
  await page.fetchAccount();
  expect(page.endedBy.value).toBe("restart");
  page.me.value = LI;
  page.endedBy.value = "role";
  await page.fetchAccount();
  expect(page.endedBy.value).toBe("role");
});

test.each([
  ["an error", replies({}, 500)],
  ["no answer", () => Promise.reject(new Error("cut"))],
])("after %s the page knows what it knew", async (_, answer) => {
  page.me.value = LI;
  reply = answer;
  expect([await page.fetchAccount(), page.me.value]).toEqual([null, LI]);
});

test("a page that was signed out has no rights at once, and asks whose it is", async () => {
  page.me.value = LI;
  reply = replies(NOBODY);
  page.signedOut("");
  expect(page.me.value).toEqual(NOBODY);
  expect(page.endedBy.value).toBe("signed_out");
  expect(asked).toEqual(["/account/me"]);
  page.me.value = null;
  page.signedOut("role");
  expect([page.me.value, page.endedBy.value]).toEqual([null, "role"]);
});

test("a sign-in connects the page, a sign-out ends its rights", async () => {
  const connects = vi.fn();
  page.reportActivity(connects);
  page.endedBy.value = "idle";
  await page.signIn("li", "secret");
  expect([page.me.value?.account, page.endedBy.value, connects.mock.calls.length]).toEqual(["li", "", 1]);
  reply = replies({ ...LI, resting: false });
  await page.unlock("secret");
  await page.signOut(true);
  expect(page.me.value?.account).toBe("");
  expect(asked.slice(0, 3)).toEqual([
    '/account/sign-in {"name":"li","password":"secret"}',
    '/account/unlock {"password":"secret"}',
    '/account/sign-out {"everywhere":true}',
  ]);
});

test("a refused sign-in says why, and signs nobody in", async () => {
  reply = replies({ text: "wrong password" }, 401);
  await expect(page.signIn("li", "x")).rejects.toMatchObject({ message: "wrong password", status: 401 });
  reply = () => Promise.reject(new Error("cut"));
  await expect(page.post("sign-in")).rejects.toMatchObject({ status: 0, message: expect.stringMatching(/console/i) });
  expect(page.me.value).toBeNull();
});

test("activity is reported at most once a minute, by who can command", async () => {
  page.reportActivity(() => undefined);
  await vi.advanceTimersByTimeAsync(60_000);
  const touch = (kind = "keydown") => dispatchEvent(new Event(kind));
  touch();
  page.me.value = { ...LI, role: "monitor" };
  touch();
  expect(asked).toEqual([]);
  page.me.value = LI;
  touch();
  touch("pointerdown");
  await vi.advanceTimersByTimeAsync(59_000);
  touch();
  expect(asked).toEqual(["/account/active {}"]);
  reply = () => Promise.reject(new Error("cut"));
  await vi.advanceTimersByTimeAsync(1000);
  touch("pointerdown");
  expect(asked).toHaveLength(2);
});

test("a right that the console gives or takes while the page is open is shown", async () => {
  page.me.value = LI;
  page.reportActivity(() => undefined);
  await connect({ account: "li", mayCommand: true } as never);
  expect(asked).toEqual([]);
  reply = replies({ ...LI, may_command: false, resting: true });
  greet({ account: "li", mayCommand: false });
  const resting: boolean[] = [];
  effect(() => void resting.push(!!page.me.value?.resting));
  await vi.advanceTimersByTimeAsync(0);
  expect([asked, resting.at(-1)]).toEqual([["/account/me"], true]);
});
