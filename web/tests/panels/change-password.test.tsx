// The form for an account's new password.

import { beforeEach, expect, test, vi } from "vitest";
import { newPage } from "../console";
import { find, pass, press, submit, texts, type } from "../hands";
import { show } from "../shown";

const close = vi.fn();
const post = vi.fn();
let account: typeof import("../../src/mesh/console/account");

beforeEach(async () => {
  newPage();
  const { ChangePassword } = await import("../../src/panels/change-password");
  account = await import("../../src/mesh/console/account");
  account.me.value = { account: "li" } as typeof account.me.value;
  close.mockReset();
  post.mockReset();
  vi.stubGlobal("fetch", post);
  show(<ChangePassword close={close} />);
});

const OLD = "input[name=current-password]";
const [NEW, AGAIN] = [".field:nth-of-type(2) input", ".field:nth-of-type(3) input"] as const;
const values = () => [OLD, NEW, AGAIN].map((each) => find<HTMLInputElement>(each).value);
const outcome = () => find("form > p").textContent;
function fill(old: string, wanted: string, again = wanted): void {
  for (const [field, text] of [
    [OLD, old],
    [NEW, wanted],
    [AGAIN, again],
  ] as const)
    type(field, text);
}
const answered = (status: number, body: object) =>
  post.mockResolvedValue(
    new Response(JSON.stringify(body), { status, headers: { "Content-Type": "application/json" } }),
  );

test("it begins in its first visible field, with the account's name for password managers", () => {
  expect(document.activeElement).toBe(find(OLD));
  expect(find<HTMLInputElement>("input[name=username]").value).toBe("li");
});

test("two different passwords are not sent; a change of one takes the message back", () => {
  fill("old", "new", "nwe");
  submit();
  expect([outcome(), find("form > p").className]).toEqual(["These are two different passwords.", "sign-in-problem"]);
  expect(post).not.toHaveBeenCalled();
  type(AGAIN, "new");
  expect(outcome()).toBe("\u00a0");
});

test("a changed password is sent once and said, and the form has nothing more to do", async () => {
  answered(200, { account: "li", role: "operator" });
  fill("old", "new");
  submit();
  submit();
  expect(texts("button[type=submit]")).toEqual(["Changing…"]);
  await pass();
  expect(post.mock.calls).toEqual([
    ["/account/password", expect.objectContaining({ body: JSON.stringify({ password: "old", new: "new" }) })],
  ]);
  expect([outcome(), texts("button[type=submit]")]).toEqual([expect.stringMatching(/^Changed\./), []]);
  expect(find("form > p").className).toBe("");
  expect(account.me.value?.role).toBe("operator");
  press("Close");
  expect(close).toHaveBeenCalledOnce();
});

test.each([
  ["account.password_wrong", ["", "new", "new"]],
  ["account.password_short", ["old", "new", "new"]],
])("of a refusal (%s) the reason is shown, and only a wrong password is typed again", async (code, left) => {
  answered(403, { text: "no", refusal: { code, values: {}, causes: [], text: "no" } });
  fill("old", "new");
  find(AGAIN).focus();
  submit();
  await pass();
  expect(outcome()).toBe("Not changed: no");
  expect(values()).toEqual(left);
  expect(document.activeElement).toBe(find(left[0] ? AGAIN : OLD));
  expect(find<HTMLButtonElement>("button[type=submit]").disabled).toBe(false);
});

test("without an answer nothing was changed", async () => {
  post.mockRejectedValue(new TypeError("network"));
  fill("old", "new");
  submit();
  await pass();
  expect(outcome()).toBe("Not changed: the console does not answer: try again");
});
