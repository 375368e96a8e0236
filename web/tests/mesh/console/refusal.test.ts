// Refusals of HTTP requests, in the page's language.

import { expect, test } from "vitest";
import { showFirstLanguage } from "../../../src/i18n/texts";
import { readRefusal } from "../../../src/mesh/console/refusal";

const refused = (body: string, type: string, status = 409) =>
  readRefusal(new Response(body, { status, headers: { "Content-Type": type } }));
const held = { code: "lease.held", values: { holder: "li" }, causes: [], text: "li has control" };
const json = JSON.stringify({ text: "told", refusal: held, more: 7 });
const parameters = new URLSearchParams({
  code: "program.line",
  line: "3",
  "cause.code": "lease.held",
  "cause.holder": "li",
});

test.each([
  ["JSON with a reason has the reason's sentence", json, "application/json; charset=utf-8", "li has control"],
  ["JSON without a reason has its own", '{"text": "told"}', "application/json", "told"],
  ["JSON without a text has the status", '{"text": 7}', "application/json", "HTTP 409"],
  ["JSON that is none has the status", "{", "application/json", "HTTP 409"],
  ["JSON that is no object has the status", "7", "application/json", "HTTP 409"],
  ["a sentence is itself", "told", "text/plain", "told"],
  ["an empty sentence has the status", "", "text/plain", "HTTP 409"],
  ["a proxy's page has the status", "<h1>Bad</h1>", "text/html", "HTTP 409"],
])("%s", async (_, body, type, text) => {
  expect((await refused(body, type)).message).toBe(text);
});

test("a program finds the code, the status and the whole answer", async () => {
  expect(await refused(json, "application/json", 423)).toMatchObject({
    status: 423,
    reason: { code: "lease.held" },
    reply: { more: 7 },
  });
  expect((await refused("told", "text/plain")).reason).toBeUndefined();
});

test("a sentence's parameters name its code, values and cause, and are translated", async () => {
  const type = `text/plain; refusal="${parameters}"`;
  await showFirstLanguage("zh");
  const { message, reason } = await refused("line 3: li has control", type);
  await showFirstLanguage("en");
  expect(reason).toMatchObject({ code: "program.line", values: { line: "3" }, causes: [{ code: "lease.held" }] });
  expect(message).toMatch(/^第 3 行：.*li/);
  expect((await refused("line 3: li has control", type)).message).toBe("line 3: li has control");
});

test("an answer that is cut has the status", async () => {
  const cut = {
    headers: new Headers({ "Content-Type": "text/plain" }),
    status: 500,
    text: () => Promise.reject(new Error("cut")),
  };
  expect((await readRefusal(cut as unknown as Response)).message).toBe("HTTP 500");
});
