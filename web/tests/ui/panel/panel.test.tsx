// Outcomes of actions, and popups that close.

import { useRef } from "preact/hooks";
import { beforeEach, expect, test, vi } from "vitest";
import type { Notice } from "../../../src/mesh/control/control";
import { newPage } from "../../console";
import { find, key, pass, texts } from "../../hands";
import { hide, show, use } from "../../shown";

beforeEach(() => newPage());

test.each<[Notice | null, string | undefined, string, string, number]>([
  [null, undefined, "\u00a0", "status", 0],
  [null, "ready", "ready", "status", 0],
  [{ kind: "busy", text: "Sending…" }, "ready", "Sending…", "status", 0],
  [{ kind: "done", text: "Sent" }, "ready", "Sent", "status", 0],
  [{ kind: "refused", text: "Not sent" }, "ready", "Not sent", "alert", 1],
  [{ kind: "lost", text: "Lost" }, "ready", "Lost", "alert", 1],
  [{ kind: "done", text: "Sent", warning: "close" }, "ready", "SentWarning: close", "status", 1],
])("the outcome %o (idle: %o) reads %o, with the role %s", async (notice, idle, text, role, shapes) => {
  const { NoticeLine } = await import("../../../src/ui/panel/notice-line");
  show(<NoticeLine notice={notice} {...(idle && { idle })} />);
  expect([find(".notice").textContent, find(".notice").getAttribute("role")]).toEqual([text, role]);
  expect(find(".notice").classList.contains(notice?.kind ?? "idle")).toBe(true);
  expect(texts(".shape.warning")).toHaveLength(shapes);
});

test("an action is busy until it ends, and its outcome is told or its refusal explained", async () => {
  const { useOutcome } = await import("../../../src/ui/panel/outcome");
  const outcome = use(useOutcome, (text) => `Not done: ${text}`);
  const state = () => [outcome.result.isBusy, outcome.result.notice];
  const perform = async (busy: string, work: () => Promise<string | undefined>) => {
    const done = outcome.result.perform(busy, work);
    await pass();
    return done;
  };
  const work = Promise.withResolvers<string | undefined>();
  const done = outcome.result.perform("Saving…", () => work.promise);
  await pass();
  expect(state()).toEqual([true, { kind: "busy", text: "Saving…" }]);
  work.resolve("Saved");
  await pass();
  expect([await done, state()]).toEqual([true, [false, { kind: "done", text: "Saved" }]]);
  const refused = await perform("", async () => Promise.reject(new Error("disk full")));
  expect([refused, state()]).toEqual([false, [false, { kind: "refused", text: "Not done: disk full" }]]);
  expect([await perform("", async () => undefined), state()]).toEqual([true, [false, null]]);
});

test("a panel has its heading as its name", async () => {
  const { Panel } = await import("../../../src/ui/panel/panel");
  show(<Panel name="tool" title="Tool" end="fresh" children="1" />);
  expect([find("section").getAttribute("aria-label"), texts("h2"), texts(".panel-end")]).toEqual([
    "Tool",
    ["Tool"],
    ["fresh"],
  ]);
});

test("a popup is closed by Escape in it, or by a press or focus elsewhere, until it is gone", async () => {
  const { useDismissal } = await import("../../../src/ui/panel/dismissal");
  const close = vi.fn();
  const Popup = () => {
    const place = useRef<HTMLDivElement>(null);
    useDismissal(place, close);
    return (
      <div ref={place} class="popup">
        <button>head</button>
        <input />
      </div>
    );
  };
  const place = show(<Popup />);
  const closed = (act: () => unknown) => (close.mockReset(), act(), close.mock.calls.length);
  const event = (of: EventTarget, kind: string) => of.dispatchEvent(new Event(kind, { bubbles: true }));
  expect([
    closed(() => event(find("input"), "pointerdown")),
    closed(() => event(document.body, "pointerdown")),
  ]).toEqual([0, 1]);
  expect([closed(() => event(find("input"), "focusin")), closed(() => event(document.body, "focusin"))]).toEqual([
    0, 1,
  ]);
  expect(closed(() => key("body", "Escape"))).toBe(0);
  find("input").focus();
  expect([closed(() => key("input", "a")), closed(() => key("input", "Escape"))]).toEqual([0, 1]);
  expect(document.activeElement).toBe(find(".popup button"));
  expect(closed(() => event(window, "pointerdown"))).toBe(0);
  hide(place);
  expect(closed(() => event(document.body, "pointerdown"))).toBe(0);
});
