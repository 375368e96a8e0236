// The robot's page: what its panels say and send, before a robot that reports as each test wants.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { act } from "preact/test-utils";
import { expect, test, vi } from "vitest";
import { CompressedImageSchema } from "../../../src/gen/foxglove/CompressedImage_pb";
import { JointStatesSchema } from "../../../src/gen/foxglove/JointStates_pb";
import {
  ControllerState_Activity as Activity,
  AuditEntrySchema,
  CheckAnswerSchema,
  CommandRequest_Command as Command,
  CommandAnswerSchema,
  CommandRequestSchema,
  ControllerStateSchema,
  DescriptionSchema,
  EventSchema,
  ControllerState_Known as Known,
  LayoutListSchema,
  LayoutRequestSchema,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
  AuditEntry_Outcome as Outcome,
  ProgramState_Outcome as ProgramOutcome,
  ProgramStateSchema,
  RecorderRequest_Action as RecorderAction,
  RecorderRequestSchema,
  RecordingSchema,
  SignalsSchema,
  Capabilities_Stops as Stops,
  Description_Joint_Type as Type,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, publish, read, refuse, requests, say, watched } from "../../console";
import { button, find, key, pass, press, pressable, send, texts, type } from "../../hands";
import { nextTo, ROBOT, takeControl } from "../../mesh/control/operator";
import { show } from "../../shown";

const DEGREE = Math.PI / 180;
const JOINTS = ["waist", "elbow"];
const at = (s: number) => timestampFromMs(1e12 + 1000 * s);
type State = MessageInitShape<typeof ControllerStateSchema>;
let robot: { state: State; degrees: number[]; live: boolean };

/** Let the robot report for a time; a change stays. */
async function reports(change: Partial<typeof robot> = {}, ms = 400): Promise<void> {
  Object.assign(robot, change);
  const header = { live: robot.live };
  for (let left = ms; left > 0; left -= 200) {
    const joints = JOINTS.map((name) => ({ name, type: Type.ROTARY, lower: -110 * DEGREE, upper: 110 * DEGREE }));
    publish(`${ROBOT}/description`, DescriptionSchema, { joints, views: [{ name: "front" }] }, header);
    const state = { link: Link.UP, mode: Mode.REMOTE, activity: Activity.IDLE, homed: Known.YES, ...robot.state };
    publish(`${ROBOT}/controller`, ControllerStateSchema, { timestamp: at(Date.now() / 1000), ...state }, header);
    const positions = JOINTS.map((name, i) => ({ name, position: (robot.degrees[i] ?? 0) * DEGREE }));
    publish(`${ROBOT}/joints`, JointStatesSchema, { joints: positions }, header);
    await pass(200);
  }
}

/** Open the page, in control or only watching; its video and plots are hidden unless a test shows them. */
async function open({ control = false, query = "hide=video,plots", live = true, site = "hall" } = {}): Promise<void> {
  newPage();
  robot = { state: {}, degrees: [0, 0], live };
  location.hash = `#/hall/arm?${query}`;
  const { RobotPage } = await import("../../../src/features/robot/robot-page");
  if (control) await takeControl();
  else
    await connect({
      site,
      stale: [
        { topic: "joints", afterS: 1 },
        { topic: "signals", afterS: 1 },
      ],
    });
  show(<RobotPage site="hall" robot="arm" />);
  await reports();
}

const notice = (panel: string) => find(`.panel.${panel} .notice`).textContent.trim();
const lines = () => texts(".event-list li");
const disabled = (name: string) => button(name).disabled;

/** Type a target of a joint [degrees]; Enter sends it. */
function target(joint: string, degrees: string): void {
  if (!document.querySelector(".value-field")) act(() => find(`[aria-label="${joint}"] .value-button`).click());
  type(".value-field", degrees);
}
const enter = () => key(".value-field", "Enter");
async function accepted(values = {}) {
  const request = await nextTo("/command/");
  answer(request, CommandAnswerSchema, { accepted: true, ...values });
  await pass(0);
  const { command, jointPositions } = read(request, CommandRequestSchema);
  return [command, ...jointPositions.map((each) => Math.round(each / DEGREE))];
}

test("without control nothing on the page can move the arm", async () => {
  await open();
  expect(texts("button[data-moves=true]:not(:disabled)")).toEqual([]);
  expect(pressable().filter((each) => /^[+−]|^Home|^Hold/.test(each))).toEqual([]);
  expect(texts(".panel.joints .step").length).toBe(2 * JOINTS.length);
  expect([texts("[role=slider]"), texts(".value-button")]).toEqual([[], []]);
  for (const kind of ["pointerdown", "pointerup", "click"]) send(".track", new Event(kind, { bubbles: true }));
  await pass(500);
  expect(requests.filter((each) => each.key.includes("/command/"))).toEqual([]);
});

test("a target that homing left behind moves no joint that nobody touched", async () => {
  await open({ control: true });
  target("waist", "60");
  enter();
  expect(await accepted()).toEqual([Command.MOVE_ABSOLUTE, 60, 0]);
  await reports({ state: { activity: Activity.MOVING }, degrees: [30, 0] });
  await reports({ state: { activity: Activity.HOMING }, degrees: [10, 0] });
  await reports({ state: {}, degrees: [0, 0] });
  target("elbow", "20");
  enter();
  expect(await accepted()).toEqual([Command.MOVE_ABSOLUTE, 0, 20]);
});

test("a running motion keeps its other targets", async () => {
  await open({ control: true });
  target("waist", "60");
  enter();
  await accepted();
  await reports({ state: { activity: Activity.MOVING }, degrees: [30, 0] });
  target("elbow", "20");
  enter();
  expect(await accepted()).toEqual([Command.MOVE_ABSOLUTE, 60, 20]);
});

test("a target that would collide is told while it is chosen, before it is sent", async () => {
  await open({ control: true });
  target("waist", "45");
  const hit = { violations: [{ text: "arm/wrist hits post", pair: ["arm/wrist", "post"], refuses: true }] };
  answer(await nextTo("/kinematics/check/"), CheckAnswerSchema, hit);
  await pass();
  expect(notice("joints")).toBe("Target waist: 45.00°, not sent yet. arm/wrist hits post");
  target("waist", "-20");
  await reports();
  answer(await nextTo("/kinematics/check/"), CheckAnswerSchema, {});
  await pass();
  expect(notice("joints")).toBe("Target waist: −20.00°, not sent yet");
  key(".value-field", "Escape");
  expect(notice("joints")).not.toContain("Target");
  key('[aria-label="Target of waist"]', "PageUp");
  expect(notice("joints")).toMatch(/^Target waist: .*, not sent yet$/);
  key('[aria-label="Target of waist"]', "Escape");
  expect(requests.filter((each) => each.key.includes("/command/"))).toEqual([]);
});

test("a step beyond a limit is refused at its row with value and limit, until the next step", async () => {
  await open({ control: true });
  await reports({ degrees: [0, -110] });
  press("elbow −1°");
  refuse(await nextTo("/command/"), "joint elbow at −111.00° is beyond its limit −110.00°");
  await pass();
  expect(notice("joints")).toBe("Not sent: joint elbow at −111.00° is beyond its limit −110.00°.");
  expect(texts('[aria-label="elbow"] .limit.refused')).toEqual(["−110"]);
  expect(texts(".limit.refused")).toHaveLength(1);
  press("elbow +1°");
  await accepted();
  expect(texts(".limit.refused")).toEqual([]);
});

test("a fault of the controller leaves only its reset to press", async () => {
  await open({ control: true });
  await reports({ state: { activity: Activity.FAULT, fault: "axis 2 overheated" } });
  expect(texts(".headline .state")).toEqual(["Fault"]);
  expect(["Home", "waist +1°", "waist −1°"].map(disabled)).toEqual([true, true, true]);
  expect(texts("[role=slider], .value-button")).toEqual([]);
  expect(notice("joints")).toBe("See to it, then reset: no motion until then.");
  press("Reset");
  expect(await accepted()).toEqual([Command.RESET]);
  await reports({ state: {} });
  expect(["Home", "waist +1°"].map(disabled)).toEqual([false, false]);
});

test("everybody sees the speed that was set, and a low one stands out", async () => {
  await open();
  for (const [speedPercent, hint] of [
    [2, "Low: the arm moves slowly."],
    [100, ""],
  ] as const) {
    await reports({ state: { speedPercent } });
    expect([texts(".speed .value"), find(".speed-hint").textContent.trim()]).toEqual([
      [`${speedPercent}\u202f%`],
      hint,
    ]);
  }
});

test("stored values look as old as they may be", async () => {
  await open({ live: false });
  expect(texts(".value.stale")).toHaveLength(JOINTS.length);
  expect(texts(".panel.joints .age")).toEqual(["stale, age unknown"]);
  await reports({ live: true });
  expect(texts(".value.stale, .panel.joints .age")).toEqual([]);
});

test("a link that is lost is said", async () => {
  await open();
  await reports({ state: { link: Link.SILENT, linkText: "nothing comes" } });
  expect([texts(".headline .state"), texts(".messages .trouble")]).toEqual([["Silent"], ["nothing comes"]]);
});

test("a controller that floods the gateway is told in words while it does", async () => {
  await open();
  await reports({ state: { health: { flooding: true } } });
  expect(texts(".messages .trouble")).toEqual([expect.stringMatching(/^flooded: more units come than are taken/)]);
  await reports({ state: {} });
  expect(texts(".messages .trouble")).toEqual([]);
});

test("a flood of refusals is one line with its count", async () => {
  await open();
  press("Requests");
  publish(`${ROBOT}/audit`, AuditEntrySchema, {
    number: 7n,
    timestamp: at(0),
    operator: "mallory",
    request: "OFFER",
    values: { to: "eve" },
    outcome: Outcome.REFUSED,
    repeatedCount: 199n,
  });
  await pass();
  expect(lines()).toEqual([expect.stringMatching(/refused.*mallory: offer control to eve.* × 199$/)]);
  expect(texts(".event-list strong")).toEqual(["× 199"]);
});

test("signals are in groups that can be closed, and never look live when they are stale", async () => {
  await open();
  expect(texts(".panel.events button")).not.toContain("Signals");
  publish(`${ROBOT}/signals`, SignalsSchema, {
    signals: [
      { name: "io.digital_in.3", value: { case: "on", value: true } },
      { name: "payload.mass", unit: "kg", value: { case: "number", value: 1.25 } },
      { name: "safety.mode", value: { case: "text", value: "protective_stop" } },
    ],
  });
  await reports();
  press("Signals");
  const list = () => find(".signal-list").textContent;
  for (const each of ["protective stop", "1.250kg", "digital input 3"]) expect(list()).toContain(each);
  expect(texts(".signal-list .stale")).toEqual([]);
  const [payload = ""] = texts(".signal-group").filter((each) => each.includes("Payload (1)"));
  press(payload);
  expect(button(payload.replace("▾", "▸")).getAttribute("aria-expanded")).toBe("false");
  expect(list()).not.toContain("1.250");
  await reports({}, 1600);
  expect(texts(".signal-list dd.stale")).toHaveLength(2);
  expect(find(".signal-age").textContent).toMatch(/^stale/);
});

test("how the link does is told in figures, what its driver can do in words, and old clients are counted", async () => {
  await open();
  press("Link");
  const commands = [Command.MOVE_ABSOLUTE, Command.JOG, Command.HOLD, Command.SPEED, Command.HOME];
  const capabilities = { commands, stops: Stops.ANY };
  const counters = { unitsReceived: 1234n, unitsMalformed: 5n, unitsLost: 6n };
  await reports({ state: { capabilities, rateHz: 25, counters } });
  const facts = () => texts(".facts-list > div");
  expect(facts()).toEqual(expect.arrayContaining(["Units25.0/s", "Units received1,234", "Lost6", "Malformed5"]));
  expect(facts()[0]).toContain(
    "reads · moves joints · jogs · holds · sets the speed · homes · stops any motion · without the gateway: unknown",
  );
  expect(facts().join()).not.toContain("Old clients");
  await reports({ state: { legacyClients: { attached: 1 } } });
  expect(facts()).toContain("Old clients attached1");
  expect(texts(".facts")).toEqual([expect.stringContaining("old clients: 1")]);
});

test("the program that runs is on the page with its line and time, and that it is done for a minute", async () => {
  await open();
  const program = { name: "to-and-fro", operator: "li", line: 2, statement: "move_joints 0 80", step: 1, steps: 3 };
  const run = { ...program, since: at(0), timestamp: at(9), leftS: 4.2 };
  publish(`${ROBOT}/program`, ProgramStateSchema, { ...run, outcome: ProgramOutcome.RUNNING });
  await reports();
  expect(texts(".program-line")).toEqual(["to-and-fro: step 1 of 3, line 2: move_joints 0 80; li; 00:09, 00:05 left"]);
  publish(`${ROBOT}/program`, ProgramStateSchema, { ...run, timestamp: at(20), outcome: ProgramOutcome.DONE });
  publish(`${ROBOT}/events`, EventSchema, { code: "program.done", timestamp: at(20) });
  await reports();
  expect(texts(".program-line")).toEqual([expect.stringContaining("to-and-fro: done")]);
  publish(`${ROBOT}/program`, ProgramStateSchema, { ...run, timestamp: at(81), outcome: ProgramOutcome.DONE });
  await reports();
  expect(texts(".program-line")).toEqual([]);
});

test("a recording is begun and ended on the robot's page, which leads to it; a refusal is said", async () => {
  await open();
  say({ case: "presence", value: { key: "robomesh/hall/-/alive/recorder/1", alive: true } });
  await pass(100);
  press("Record…");
  type('[aria-label="Name of the recording"]', "from/here");
  press("Record");
  refuse(await nextTo("/recorder/request"), "from/here is no name");
  await pass();
  expect(texts(".record-panel [role=alert]")).toEqual([expect.stringContaining("from/here")]);
  type('[aria-label="Name of the recording"]', "from the page");
  press("Record");
  const begun = await nextTo("/recorder/request");
  expect(read(begun, RecorderRequestSchema)).toMatchObject({ action: RecorderAction.TRACE_ON, name: "from-the-page" });
  const recording = { name: "from-the-page", file: "x.mcap", site: "hall", robot: "arm" };
  answer(begun, RecordingSchema, { ...recording, open: true });
  publish(`${ROBOT}/recording`, RecordingSchema, { ...recording, open: true });
  await pass(200);
  expect(texts(".record-panel")).toEqual([expect.stringMatching(/from-the-page.*nothing lost/)]);
  expect(texts(".record-button")).toEqual([expect.stringMatching(/^recording now/)]);
  press("Stop recording");
  const ended = await nextTo("/recorder/request");
  expect(read(ended, RecorderRequestSchema).action).toBe(RecorderAction.TRACE_OFF);
  answer(ended, RecordingSchema, recording);
  publish(`${ROBOT}/recording`, RecordingSchema, recording);
  await pass(200);
  expect(find(".record-panel a").getAttribute("href")).toBe("#/recordings/hall/x.mcap");
});

test("an invalid layout is named, and the page stays whole until the default one is chosen", async () => {
  await open({ query: "plot=60,%00&camera=x" });
  expect(texts(".layout-problem")).toEqual([expect.stringMatching(/^The layout in the address cannot be used/)]);
  expect(texts(".joint-row")).toHaveLength(JOINTS.length);
  press("Default layout");
  expect([texts(".layout-problem"), location.hash]).toEqual([[], "#/hall/arm"]);
});

test("a layout is saved under a name, opened, replaced and deleted by whoever has a name", async () => {
  await open({ query: "hide=video" });
  const { setOperator } = await import("../../../src/mesh/control/control");
  setOperator("li");
  press("Layout…");
  const saved = { name: "night", text: "hide=video,plots", author: "wang", timestamp: at(0) };
  const list = (...layouts: (typeof saved)[]) => publish("robomesh/hall/-/layouts", LayoutListSchema, { layouts });
  list();
  await pass(200);
  type(".saved-layouts input", "night");
  press("Save layout");
  const request = await nextTo("/layouts/request/li");
  expect(read(request, LayoutRequestSchema)).toMatchObject({ name: "night", text: "hide=video", replace: false });
  answer(request, LayoutListSchema, { layouts: [saved] });
  await pass();
  expect(notice("layout-panel")).toBe("Saved: “night”.");
  list(saved);
  await pass(200);
  const select = find<HTMLSelectElement>(".saved-layouts select");
  select.value = "night";
  send(".saved-layouts select", new Event("change", { bubbles: true }));
  await pass();
  expect(location.hash).toBe("#/hall/arm?hide=video,plots");
  expect(notice("layout-panel")).toMatch(/^“night” was saved by wang, /);
  expect(disabled("Replace layout")).toBe(true);
  act(() => find(".layout-panel input[type=checkbox]").click());
  await pass();
  press("Replace layout");
  expect(read(await nextTo("/layouts/request/li"), LayoutRequestSchema)).toMatchObject({
    name: "night",
    replace: true,
  });
});

test("a refused step of the tool says why; its program is one straight line at most at a quarter of the speed", async () => {
  await open({ control: true });
  await reports({ state: { speedPercent: 100 } });
  press("Base");
  press("Base X +5\u202fmm");
  const request = await nextTo("/command/");
  expect(read(request, CommandRequestSchema)).toMatchObject({
    command: Command.RUN_PROGRAM,
    program: "speed 25\ntool_speed 250\nmove_line_by base 5 0 0 0 0 0\nspeed 100\n",
    programName: "Base X +5\u202fmm",
  });
  refuse(request, "five joints: move a joint instead");
  await pass();
  expect(notice("tool")).toContain("move a joint instead");
  press("Tool");
  press("20");
  press("Tool yaw +20°");
  const run = await nextTo("/command/");
  expect(read(run, CommandRequestSchema).program).toContain("move_line_by tool 0 0 0 0 0 20\n");
  answer(run, CommandAnswerSchema, { accepted: true });
  publish(`${ROBOT}/program`, ProgramStateSchema, { since: at(1), outcome: ProgramOutcome.RUNNING });
  await reports();
  publish(`${ROBOT}/program`, ProgramStateSchema, { since: at(1), outcome: ProgramOutcome.DONE });
  await reports();
  expect(notice("tool")).toBe("Done: Tool yaw +20°");
});

test("without a decoder the page shows stills and says so; a refused video is explained", async () => {
  await open({ query: "hide=plots" });
  refuse(await nextTo("/views/"), "no renderer");
  await pass();
  publish(`${ROBOT}/image/front`, CompressedImageSchema, { data: new Uint8Array(9), format: "jpeg" });
  await reports();
  expect([texts(".panel.camera .age"), texts(".panel.camera img")]).toEqual([[], [""]]);
  expect(texts(".panel.camera .footnote")).toEqual([expect.stringMatching(/^Still pictures, one after another/)]);
  const refused = { status: 503, headers: { "Content-Type": "text/plain" } };
  vi.stubGlobal("fetch", async () => new Response("no renderer answers for hall/arm", refused));
  press("Save MP4");
  await pass();
  expect(texts(".panel.camera .footnote")).toEqual(["The video was not saved: no renderer answers for hall/arm"]);
});

test("a robot of another site is shown from its slow states and a small picture until all is asked for", async () => {
  await open({ query: "hide=plots", site: "yard" });
  expect([watched.has(`${ROBOT}/joints/slow`), watched.has(`${ROBOT}/joints`)]).toEqual([true, false]);
  expect(find<HTMLSelectElement>('.panel.camera select[aria-label="View"]').value).toBe("far");
  press("All");
  await pass(200);
  expect([watched.has(`${ROBOT}/joints/slow`), watched.has(`${ROBOT}/joints`)]).toEqual([false, true]);
});

test("a robot that is only watched offers no command and no step", async () => {
  await open();
  const causes = [{ code: "robot.reads_only" }];
  await reports({ state: { readOnly: true, linkReasons: [{ code: "link.connected", causes }] } });
  expect(find(".panel.control").textContent).toContain("reads this kind of controller");
  expect(texts("button").filter((each) => /control|Home|Hold/.test(each))).toEqual([]);
  expect(texts(".step")).toEqual([]);
});
