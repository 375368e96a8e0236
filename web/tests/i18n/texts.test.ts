// The page's language, its texts, and texts of others between them.

import { h, options } from "preact";
import { beforeEach, expect, test, vi } from "vitest";
import { isolated, shown } from "../../src/i18n/text-isolation";
import { newPage } from "../console";
import { show } from "../shown";

let page: typeof import("../../src/i18n/texts");
const KEY = "robomesh.language";
const prefer = (language: string) => vi.spyOn(navigator, "language", "get").mockReturnValue(language);
const loaded = () => vi.waitFor(() => expect(document.documentElement.lang).not.toBe(""));

beforeEach(async () => {
  newPage();
  vi.useRealTimers();
  document.documentElement.lang = "";
  page = await import("../../src/i18n/texts");
});

test.each([
  ["zh-CN", null, "zh"],
  ["de-DE", null, "en"],
  ["zh-CN", "en", "en"],
  ["en-GB", "zh", "zh"],
  ["zh-CN", "tlh", "zh"],
  ["zh-CN", "constructor", "zh"],
])("a browser in %s that keeps %s begins in %s", async (browser, kept, language) => {
  prefer(browser);
  if (kept) localStorage.setItem(KEY, kept);
  await page.showFirstLanguage();
  expect([page.language.value, document.documentElement.lang]).toEqual([language, page.t("language_tag")]);
  expect(page.t("stop")).toBe(language === "zh" ? "停止请求" : "Stop request");
});

test("a frame without access to kept settings shows the browser's language", async () => {
  prefer("zh-CN");
  vi.stubGlobal("localStorage", { getItem: () => expect.unreachable() });
  await page.showFirstLanguage();
  expect(page.language.value).toBe("zh");
});

test("the language is switched to the next, or to a chosen one, and kept", async () => {
  page.switchLanguage();
  await loaded();
  expect([page.language.value, localStorage.getItem(KEY)]).toEqual(["zh", "zh"]);
  page.switchLanguage();
  expect(localStorage.getItem(KEY)).toBe("en");
  page.switchLanguage("zh");
  page.switchLanguage("en");
  await vi.waitFor(() => expect(document.documentElement.lang).toBe("en"));
  await new Promise((resolve) => setTimeout(resolve));
  expect(page.language.value).toBe("en");
  expect(page.LANGUAGES.map(page.languageName)).toEqual(["English", "中文"]);
});

test("a language whose texts cannot be loaded leaves the page as it is, with its stop", async () => {
  const said = vi.spyOn(console, "error").mockImplementation(() => undefined);
  vi.doMock("../../src/i18n/zh.json", () => {
    throw new Error("newer console");
  });
  await page.showFirstLanguage("zh");
  vi.doUnmock("../../src/i18n/zh.json");
  expect([page.language.value, page.t("stop"), said.mock.calls.length]).toEqual(["en", "Stop request", 1]);
  page.switchLanguage();
  expect(localStorage.getItem(KEY)).toBe("zh");
});

test("the first language is not waited for longer than 2 s", async () => {
  vi.useFakeTimers();
  vi.doMock("../../src/i18n/zh.json", () => new Promise(() => undefined));
  let over = false;
  void page.showFirstLanguage("zh").then(() => (over = true));
  await vi.advanceTimersByTimeAsync(1900);
  expect(over).toBe(false);
  await vi.advanceTimersByTimeAsync(200);
  vi.doUnmock("../../src/i18n/zh.json");
  expect([over, page.t("stop")]).toEqual([true, "Stop request"]);
});

test("values fill their places, isolated where they could turn the sentence around", () => {
  expect(page.t("stop_done", { robot: "arm", id: 7 })).toBe("Stop sent to arm (stop 7).");
  expect(page.t("stop_done", { robot: "עלי" })).toBe("Stop sent to \u2068עלי\u2069 (stop {id}).");
  expect(page.compose("because", { text: "\u2068עלי\u2069", why: "x" })).toBe("\u2068עלי\u2069: x");
  expect(page.placeholders("{a} {b_2} {} a")).toEqual(["a", "b_2"]);
});

test("a section's text comes before the pages', and a key without a text is itself", () => {
  expect(page.recordingsText("by_request")).toBe("on request");
  expect(page.recordingsText("stop")).toBe("Stop request");
  expect(page.recordingsText("no_such" as never)).toBe("no_such");
  expect([page.textIn("recordings", "by_request"), page.textIn("recordings", "no_such")]).toEqual([
    "on request",
    undefined,
  ]);
  expect([page.viewText("front"), page.viewText("mine")]).toEqual(["Front", "mine"]);
  expect(page.noWords()).toBe("");
});

test.each([
  ["plain", "plain", "plain"],
  ["a\u202eb", "a<U+202E>b", "a<U+202E>b"],
  ["\u2068a\u2069", "\u2068a\u2069", "<U+2068>a<U+2069>"],
  ["\u2068a\u202e\u2069", "<U+2068>a<U+202E><U+2069>", "<U+2068>a<U+202E><U+2069>"],
  ["عل", "عل", "\u2068عل\u2069"],
  ["\u061cعل", "<U+061C>عل", "\u2068<U+061C>عل\u2069"],
])("%j is shown as %j, and within a sentence as %j", (text, alone, within) => {
  expect([shown(text), isolated(text)]).toEqual([alone, within]);
});

test("every text of a page that could change the order around it is isolated", async () => {
  const { isolateTexts } = await import("../../src/i18n/text-isolation");
  const before = options.vnode;
  const seen = vi.fn();
  options.vnode = seen;
  isolateTexts();
  const Name = () => h("b", null, "עלי");
  const place = show([
    h("p", null, "a\u202eb", ["עלי", 7]),
    h("i", { title: "a\u202eb" }),
    h("select", null, h("option", null, "x\u202ey")),
    h(Name, null),
    h("p", null, "plain"),
  ]);
  options.vnode = before as never;
  const titled = place.querySelector("i");
  expect(titled?.title).toBe("a<U+202E>b");
  titled?.remove();
  expect(place.innerHTML).toBe(
    "<p><bdi>a&lt;U+202E&gt;b</bdi><bdi>עלי</bdi>7</p>" +
      "<select><option>x&lt;U+202E&gt;y</option></select><b><bdi>עלי</bdi></b><p>plain</p>",
  );
  expect(seen).toHaveBeenCalled();
});
