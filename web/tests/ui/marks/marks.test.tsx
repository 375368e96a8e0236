// Marks: what needs attention has a shape and a word, never a colour alone.

import { create } from "@bufbuild/protobuf";
import { beforeEach, expect, test } from "vitest";
import {
  ControllerStateSchema,
  AuditEntry_Outcome as Outcome,
  Alarm_Priority as Priority,
  Event_Severity as Severity,
} from "../../../src/gen/robomesh_pb";
import { newPage } from "../../console";
import { find, texts } from "../../hands";
import { show } from "../../shown";

beforeEach(() => newPage());

const UNKNOWN = 99;
test.each([
  [Severity.SEVERITY_UNSPECIFIED, "info", "信息", "normal"],
  [Severity.DEBUG, "debug", "调试", "normal"],
  [Severity.INFO, "info", "信息", "normal"],
  [Severity.WARNING, "warning", "警告", "warning"],
  [Severity.ERROR, "error", "错误", "alarm"],
  [Severity.CRITICAL, "critical", "严重", "alarm"],
  [UNKNOWN as Severity, "99", "99", "warning"],
])("the severity %s is %o, in Chinese %o, with the level %s", async (severity, english, chinese, level) => {
  const { Mark, severityMark } = await import("../../../src/ui/marks/event-mark");
  const { showFirstLanguage } = await import("../../../src/i18n/texts");
  show(<Mark {...severityMark(severity)} />);
  expect([find(".mark").className, texts(".mark")]).toEqual([`mark state ${level}`, [english]]);
  expect(document.querySelectorAll(`.shape.${level}`)).toHaveLength(level === "normal" ? 0 : 1);
  await showFirstLanguage("zh");
  expect(severityMark(severity).text).toBe(chinese);
});

test.each([
  [Outcome.OUTCOME_UNSPECIFIED, "Unknown", "normal"],
  [Outcome.ACCEPTED, "accepted", "normal"],
  [Outcome.REFUSED, "refused", "warning"],
  [Outcome.FAILED, "failed", "alarm"],
  [UNKNOWN as Outcome, "99", "warning"],
])("the outcome %s is %o with the level %s", async (outcome, text, level) => {
  const { outcomeMark } = await import("../../../src/ui/marks/event-mark");
  expect(outcomeMark(outcome)).toEqual({ text, level });
});

test.each([
  [Priority.PRIORITY_UNSPECIFIED, "low", "low"],
  [Priority.LOW, "low", "low"],
  [Priority.MEDIUM, "medium", "medium"],
  [Priority.HIGH, "high", "high"],
  [Priority.CRITICAL, "critical", "critical"],
  [UNKNOWN as Priority, "99", "high"],
])("the priority %s is %o, as urgent as %s", async (priority, text, kind) => {
  const { PriorityMark } = await import("../../../src/ui/marks/priority-mark");
  const place = show(<PriorityMark of={priority} />);
  expect([texts(".priority"), find(".priority").classList.contains(kind)]).toEqual([[text], true]);
  expect(texts(".priority-shape")).toHaveLength(1);
  show(<PriorityMark of={priority}>3 alarms</PriorityMark>, place);
  expect(texts(".priority")).toEqual(["3 alarms"]);
});

test("a state is a word with a shape, of several with their number, and may be read out", async () => {
  const { Age, State } = await import("../../../src/ui/marks/state");
  const state = { word: "state_moving", level: "motion", detail: "waits" } as const;
  const place = show(<State state={state} />);
  expect([texts(".state"), find(".state").getAttribute("role")]).toEqual([["Moving · waits"], null]);
  expect(texts(".shape.motion")).toHaveLength(1);
  show(<State state={state} count={3} told />, place);
  expect([texts(".state"), find(".state").getAttribute("role")]).toEqual([["3 Moving"], "status"]);
  show(<Age stale={false} age={7} />, place);
  expect(place.innerHTML).toBe("");
  show(<Age stale age={null} />, place);
  expect(texts(".age")).toEqual(["stale, age unknown"]);
});

test.each([
  [{}, []],
  [{ readOnly: true }, ["read-only"]],
  [{ capabilities: { slowHz: 2 } }, ["slow: 2/s"]],
  [{ readOnly: true, capabilities: { slowHz: 0.25 } }, ["read-only", "slow: 0.3/s"]],
])("a robot in the state %o has the tags %o", async (state, tags) => {
  const { RobotTags } = await import("../../../src/ui/marks/robot-tags");
  const place = show(<RobotTags state={create(ControllerStateSchema, state)} />);
  expect(texts(".tag")).toEqual(tags);
  show(<RobotTags state={undefined} />, place);
  expect(texts(".tag")).toEqual([]);
});

test("small marks say what they are", async () => {
  const { ReplayTag } = await import("../../../src/ui/marks/replay-tag");
  const { Silhouette } = await import("../../../src/ui/marks/silhouette");
  const { Unit } = await import("../../../src/ui/marks/unit");
  const { Warning } = await import("../../../src/ui/marks/warning");
  const place = show(<ReplayTag robot="arm" start={1e12} />);
  expect(texts(".tag.replay")).toEqual([expect.stringMatching(/^replay of arm, 2001-09-09 .*:46:40/)]);
  show(<Unit of="°" />, place);
  expect(find(".unit").className).toBe("unit degree"); // close to its number
  show(<Unit of="mm" />, place);
  expect(find(".unit").className).toBe("unit");
  show(<Warning class="a" text="mind" />, place);
  expect([find("p.a").textContent, texts("p .shape.warning")]).toEqual(["mind", [""]]);
  show(<Warning as="li" class="a" text="mind" />, place);
  expect(texts("li.a")).toEqual(["mind"]);
  show(<Silhouette label="no picture" />, place);
  expect(find("svg").getAttribute("aria-label")).toBe("no picture");
});
