// Alarms and the journal: what a person acknowledges, shelves, looks for and withdraws.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  AlarmRequest_Action as Action,
  AlarmListSchema,
  AlarmRequestSchema,
  AuditEntrySchema,
  AuditListSchema,
  AuditQuerySchema,
  EventSchema,
  NoteRequest_Action as NoteAction,
  NoteRequestSchema,
  AuditEntry_Outcome as Outcome,
  Alarm_Priority as Priority,
  Event_Severity as Severity,
  Alarm_State as State,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, publish, read, say } from "../../console";
import { button, find, pass, press, send, texts, type } from "../../hands";
import { nextTo } from "../../mesh/control/operator";
import { show } from "../../shown";

type EventFields = MessageInitShape<typeof EventSchema>;
const at = (second: number) => timestampFromMs(Date.now() - 60_000 + 1000 * second);
let language: typeof import("../../../src/i18n/texts");

beforeEach(async () => {
  newPage();
  const observer = class {
    observe() {}
    disconnect() {}
  };
  vi.stubGlobal("ResizeObserver", observer);
  language = await import("../../../src/i18n/texts");
  const [{ EventsPage }, { followAlarms }] = await Promise.all([
    import("../../../src/features/events/events-page"),
    import("../../../src/mesh/services/alarms"),
  ]);
  await connect({ site: "hall", stale: [{ topic: "alarms", afterS: 60 }] });
  for (const robot of ["arm", "crane"])
    say({ case: "presence", value: { key: `robomesh/hall/${robot}/alive/gateway/1`, alive: true } });
  followAlarms();
  show(<EventsPage />);
  await pass(300);
});

async function alarms(...states: State[]): Promise<void> {
  const list = states.map((state, number) => ({
    ...{
      id: `arm:joints.gone${number || ""}`,
      site: "hall",
      robot: "arm",
      state,
      priority: Priority.HIGH,
      since: at(0),
    },
    ...{ code: "joints.gone", text: "no positions come from it", by: "li", at: at(1), reason: "the cell is cleaned" },
  }));
  publish("robomesh/hall/-/alarms", AlarmListSchema, { site: "hall", alarms: list });
  await pass(300);
}
const lines = () => texts(".alarm-line");
const acknowledge = "Acknowledge: no positions come from it";

test("an alarm is acknowledged by a person with a name, and everybody sees by whom", async () => {
  await alarms(State.UNACKNOWLEDGED);
  expect(texts(".alarm-state, .alarm-line code")).toEqual(["not acknowledged", "hall/arm:joints.gone"]);
  expect(button(acknowledge).disabled).toBe(true);
  type("input[name=operator]", "li");
  press(acknowledge);
  const request = await nextTo("/alarms/request/li");
  expect(read(request, AlarmRequestSchema)).toMatchObject({ action: Action.ACKNOWLEDGE });
  answer(request, AlarmListSchema, {});
  await pass();
  expect(find(".panel.alarms > .notice").textContent.trim()).toBe("Acknowledged: 1");
  await alarms(State.ACKNOWLEDGED);
  expect([texts(".alarm-state"), lines()[0]]).toEqual([
    ["acknowledged"],
    expect.stringContaining("acknowledged by li at"),
  ]);
});

test("an alarm is shelved for a time with a reason, and comes back when it is asked for", async () => {
  await alarms(State.UNACKNOWLEDGED);
  type("input[name=operator]", "li");
  const box = find<HTMLInputElement>('[aria-label="Select: no positions come from it"]');
  box.checked = true;
  send('[aria-label="Select: no positions come from it"]', new Event("change", { bubbles: true }));
  press("Shelve selected…");
  expect(find<HTMLButtonElement>("form button[type=submit]").disabled).toBe(true);
  press("8 h");
  type("form input[aria-label=Reason], form .reason input, form.reason input", "the cell is cleaned");
  send("form.reason", new Event("submit", { bubbles: true, cancelable: true }));
  const request = await nextTo("/alarms/request/li");
  expect(read(request, AlarmRequestSchema)).toMatchObject({
    ...{ action: Action.SHELVE, reason: "the cell is cleaned", shelveS: 28_800 },
  });
  answer(request, AlarmListSchema, {});
  await alarms(State.SHELVED);
  expect(lines()).toEqual([]);
  press("Shelved 1");
  expect(lines()).toEqual([expect.stringContaining("the cell is cleaned")]);
  press("Unshelve: no positions come from it");
  expect(read(await nextTo("/alarms/request/li"), AlarmRequestSchema).action).toBe(Action.UNSHELVE);
});

test("an alarm that the filter hides is not selected", async () => {
  await alarms(State.ACKNOWLEDGED);
  type("input[name=operator]", "li");
  find<HTMLInputElement>('[aria-label="Select: no positions come from it"]').checked = true;
  send('[aria-label="Select: no positions come from it"]', new Event("change", { bubbles: true }));
  expect(button("Shelve selected…").disabled).toBe(false);
  press("Unacknowledged 0");
  expect([lines(), button("Shelve selected…").disabled]).toEqual([[], true]);
});

async function happened(more: EventFields = {}): Promise<void> {
  publish("robomesh/hall/arm/events/recorder", EventSchema, {
    ...{ timestamp: at(1), code: "recorder.note", source: "recorder", severity: Severity.INFO, ...more },
  });
  await pass(600);
}
const journal = () => texts(".journal-text");
async function choose(label: string, value: string): Promise<void> {
  const selector = `.journal select[aria-label="${label}"]`;
  find<HTMLSelectElement>(selector).value = value;
  send(selector, new Event("change", { bubbles: true }));
  await pass();
}

test("the journal is narrowed by what one looks for, pauses, and shows all of a line", async () => {
  await happened({ text: "a note of the recorder" });
  await happened({ code: "disk.low", text: "the disk is nearly full", severity: Severity.WARNING });
  expect(journal()).toHaveLength(2);
  await choose("Severity", "from_warning");
  expect(journal()).toEqual([expect.stringContaining("the disk is nearly full")]);
  await choose("Severity", "any_severity");
  type(".journal input[type=search]", "recorder.note");
  expect(journal()).toEqual([expect.stringContaining("a note of the recorder")]);
  press("Pause");
  await happened({ text: "another note" });
  button("Go on (1 new)");
  expect(journal()).toEqual([expect.stringContaining("a note of the recorder")]);
  send(".journal-line", new Event("click"));
  expect(find(".entry-details").textContent).toContain("recorder.note");
});

test("requests of every robot are there, and the logs of the chosen one are searched when asked", async () => {
  press("Requests");
  const entry = { operator: "wang", source: "mesh", timestamp: at(1), number: 1n };
  publish("robomesh/hall/arm/audit", AuditEntrySchema, { ...entry, request: "ACQUIRE", outcome: Outcome.ACCEPTED });
  await pass(600);
  expect(journal()).toEqual([expect.stringContaining("wang: take control")]);
  await choose("Robot", "arm");
  press("Search the audit logs");
  const request = await nextTo("/audit/find");
  expect([request.key, read(request, AuditQuerySchema)]).toMatchObject(["robomesh/hall/arm/audit/find", {}]);
  const refused = { ...entry, number: 2n, request: "OFFER", values: { to: "zhao" }, outcome: Outcome.REFUSED };
  const reason = { code: "lease.none", text: "no operator is in control: take control first (ACQUIRE)" };
  answer(request, AuditListSchema, { entries: [{ ...refused, reason, text: reason.text }] });
  await pass(600);
  expect(find(".journal > .notice").textContent).toMatch(/^Found in the logs: 1/);
  const of = () => journal().find((each) => each.includes("zhao"));
  expect(of()).toMatch(/^refused wang: offer control to zhao – no operator is in control/);
  await language.switchLanguage();
  await vi.dynamicImportSettled();
  await pass(300);
  expect(of()).toMatch(/^已拒绝 wang：提出将控制权移交给 zhao——/);
  send(".journal-line", new Event("click"));
  expect([find('.entry-details [lang="en"]').textContent]).toEqual([
    expect.stringMatching(/^no operator is in control/),
  ]);
});

test("a program that ran leads to its text", async () => {
  press("Requests");
  publish("robomesh/hall/arm/audit", AuditEntrySchema, {
    ...{ operator: "li", timestamp: at(1), number: 1n, request: "RUN_PROGRAM", values: { program_sha256: "abc" } },
  });
  await pass(600);
  send(".journal-line", new Event("click"));
  expect(find(".entry-details a").getAttribute("href")).toBe("#/program/hall/arm/abc");
});

test("a note is withdrawn by its author only, and then struck through for everybody", async () => {
  const { setOperator } = await import("../../../src/mesh/control/control");
  setOperator("wang");
  press("Notes");
  const note = { id: "n1", author: "li", text: "gripper slips", begin: at(0), end: at(1) };
  await happened({ code: "note.written", note });
  expect(journal()).toEqual([expect.stringMatching(/^\s*li noted on [\d:+-]+ – [\d:+-]+: gripper slips$/)]);
  send(".journal-line", new Event("click"));
  expect(texts("button")).not.toContain("Withdraw this note");
  setOperator("li");
  await pass();
  press("Withdraw this note");
  expect(read(await nextTo("/notes/request/li"), NoteRequestSchema)).toMatchObject({
    action: NoteAction.WITHDRAW,
    id: "n1",
  });
  await happened({ code: "note.withdrawn", note: { id: "n1" }, timestamp: at(2) });
  expect(texts(".journal-line del")).toEqual([expect.stringContaining("gripper slips")]);
});
