// Accounts, sessions and signing in: who may press what, and what the console is asked.

import { beforeEach, expect, test, vi } from "vitest";
import { connect, newPage } from "../../console";
import { button, find, pass, press, submit, texts, type } from "../../hands";
import { show } from "../../shown";

const ANA = { name: "ana", role: "admin", created: "2026-11-01T08:00:00Z", disabled: false, sessions: 1 };
const LI = { name: "li", role: "operator", created: "2026-11-02T08:00:00Z", disabled: false, sessions: 0 };
let account: typeof import("../../../src/mesh/console/account");
/** What was posted, and what the console answers to it. */
let posted: [path: string, body: unknown][];
let answers: Record<string, { status?: number; body: unknown }>;

beforeEach(async () => {
  newPage();
  posted = [];
  answers = {
    accounts: { body: { accounts: [ANA, LI] } },
    sessions: {
      body: {
        sessions: [
          { id: "1", account: "ana", address: "10.0.0.1", agent: "", began: ANA.created, resting: false, this: true },
          { id: "2", account: "li", address: "10.0.0.2", agent: "", began: ANA.created, resting: true, this: false },
        ],
      },
    },
  };
  vi.stubGlobal("fetch", async (address: string, request: RequestInit = {}) => {
    const path = address.replace("/account/", "");
    if (request.method === "POST") posted.push([path, JSON.parse(String(request.body))]);
    const { status = 200, body } = answers[path] ?? { body: {} };
    return new Response(JSON.stringify(body), { status, headers: { "Content-Type": "application/json" } });
  });
  account = await import("../../../src/mesh/console/account");
});
const signedIn = (role: string, more: object = {}) =>
  (account.me.value = {
    accounts: true,
    site: "hall",
    account: "ana",
    operator: "ana",
    role,
    may_command: true,
    ...more,
  } as typeof account.me.value);
async function accounts(): Promise<void> {
  const { Accounts } = await import("../../../src/features/settings/accounts");
  signedIn("admin");
  show(<Accounts />);
  await pass();
}
const row = (name: string) => [...document.querySelectorAll("tr")].find((each) => each.textContent.startsWith(name));

test("an administrator cannot change or remove the own account", async () => {
  await accounts();
  expect([row("ana"), row("li")].map((each) => each?.querySelectorAll("button, select").length)).toEqual([0, 4]);
});

test("an account is removed only after a second press, and the list is what the console answers", async () => {
  await accounts();
  await press("Remove");
  expect(posted).toEqual([]);
  await press("Cancel");
  await press("Remove");
  answers.accounts = { body: { accounts: [ANA] } };
  await press("Remove");
  await pass();
  expect(posted).toEqual([["accounts", { action: "remove", name: "li" }]]);
  expect(row("li")).toBeUndefined();
});

test("a refused change says why and changes nothing in the list", async () => {
  await accounts();
  answers.accounts = { status: 409, body: { text: "li is the last operator" } };
  await press("Disable");
  await pass();
  expect(posted).toEqual([["accounts", { action: "disable", name: "li" }]]);
  expect(find(".notice").textContent).toContain("li is the last operator");
  expect(button("Disable").disabled).toBe(false);
});

test("a disabled account is marked, and can be enabled", async () => {
  answers.accounts = { body: { accounts: [ANA, { ...LI, disabled: true }] } };
  await accounts();
  expect(row("li")?.className).toBe("gone");
  await press("Enable");
  expect(posted).toEqual([["accounts", { action: "enable", name: "li" }]]);
});

test("an account is added with a name and a password, as a monitor unless another role is chosen", async () => {
  await accounts();
  const add = () => [...document.querySelectorAll<HTMLButtonElement>("form button")].at(-1);
  type('form input[maxlength="40"]', "  wang ");
  expect(add()?.disabled).toBe(true);
  type('form input[type="password"]', "secret");
  expect(add()?.disabled).toBe(false);
  submit();
  await pass();
  expect(posted).toEqual([["accounts", { action: "add", name: "wang", role: "monitor", password: "secret" }]]);
  expect(find<HTMLInputElement>('form input[type="password"]').value).toBe("");
});

test("another account gets a new password once one is typed, and the field closes when it is set", async () => {
  await accounts();
  const place = row("li");
  await press("Set password");
  const set = () => [...(place?.querySelectorAll<HTMLButtonElement>("form button") ?? [])][0];
  expect(set()?.disabled).toBe(true);
  type('td input[type="password"]', "new");
  expect(set()?.disabled).toBe(false);
  submit();
  await pass();
  expect([posted, place?.querySelector("form")]).toEqual([
    [["accounts", { action: "password", name: "li", password: "new" }]],
    null,
  ]);
});

test("another session can be ended, this one cannot", async () => {
  const { Sessions } = await import("../../../src/features/settings/sessions");
  signedIn("operator");
  show(<Sessions />);
  await pass();
  expect(texts("li button")).toHaveLength(1);
  find("li button").click();
  await pass();
  expect(posted).toEqual([["sessions", { end: "2" }]]);
});

test.each([
  ["monitor", {}, /watch/i],
  ["operator", {}, /ana/],
  ["operator", { resting: true, may_command: false }, /password|again/i],
])("the menu tells a %s %j what the account may do", async (role, more, text) => {
  const { AccountMenu } = await import("../../../src/features/account/account-menu");
  signedIn(role, more);
  await connect({ account: "ana", operator: "ana", mayCommand: role === "operator" && !("resting" in more) });
  show(<AccountMenu />);
  expect(find(".account-sheet p.dim").textContent).toMatch(text);
});

test("the menu is not there without an account, and signs out here or everywhere", async () => {
  const { AccountMenu } = await import("../../../src/features/account/account-menu");
  const place = show(<AccountMenu />);
  expect(place.textContent).toBe("");
  signedIn("operator");
  await pass();
  await press("Sign out everywhere");
  await pass();
  expect(posted[0]).toEqual(["sign-out", { everywhere: true }]);
});

async function signIn(): Promise<void> {
  const { SignIn } = await import("../../../src/features/account/sign-in");
  account.me.value = { accounts: true, site: "hall", insecure: true } as typeof account.me.value;
  show(<SignIn />);
  await pass();
  type('[name="username"]', "li");
  type('input[type="password"]', "wrong");
}

test("a wrong password is told, and is typed again; the name stays", async () => {
  await signIn();
  answers["sign-in"] = {
    status: 403,
    body: { text: "wrong", refusal: { code: "account.wrong", values: {}, causes: [], text: "wrong" } },
  };
  submit();
  await pass();
  expect(posted).toEqual([["sign-in", { name: "li", password: "wrong" }]]);
  expect(find(".sign-in-problem").textContent).not.toBe("");
  expect(["[name='username']", "input[type='password']"].map((each) => find<HTMLInputElement>(each).value)).toEqual([
    "li",
    "",
  ]);
});

test("after too many attempts nothing is sent for the seconds that are counted down", async () => {
  await signIn();
  const refusal = { code: "account.wait", values: { seconds: "3" }, causes: [], text: "try again in 3 s" };
  answers["sign-in"] = { status: 429, body: { text: "wait", refusal, seconds: 3 } };
  submit();
  await pass();
  const left = () => /\d/.exec(find(".sign-in-problem").textContent)?.[0];
  expect([left(), find<HTMLButtonElement>("[type=submit]").disabled]).toEqual(["3", true]);
  await pass(1000);
  expect(left()).toBe("2");
  submit();
  expect(posted).toHaveLength(1);
  await pass(2500);
  expect([left(), find<HTMLButtonElement>("[type=submit]").disabled]).toEqual([undefined, false]);
});

test("a page whose session ended says that nothing is live, and why; after a sign-out it warns of nothing", async () => {
  account.endedBy.value = "restart";
  await signIn();
  expect(find(".sign-in-ended").className).toContain("warning");
  account.endedBy.value = "signed_out";
  await pass();
  expect(find(".sign-in-ended").className).not.toContain("warning");
});
