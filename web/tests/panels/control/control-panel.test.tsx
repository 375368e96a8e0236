// The commands of who is in control, and what says why none can be sent.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ControllerState_Activity as Activity,
  CommandRequest_Command as Command,
  CommandAnswerSchema,
  CommandRequestSchema,
  ControllerStateSchema,
  DescriptionSchema,
  ControllerState_Known as Known,
  LeaseAnswerSchema,
  LeaseSchema,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
  Recover_Recovery as Recovery,
} from "../../../src/gen/robomesh_pb";
import type { Latest } from "../../../src/mesh/state/topics";
import { answer, connect, newPage, next, read, requests } from "../../console";
import { button, find, pass, press, pressable, send, submit, texts, type } from "../../hands";
import { show } from "../../shown";

const ROBOT = "robomesh/hall/arm";
const at = (ms: number) => timestampFromMs(1e12 + ms);
const STOP = { id: 7n, by: "wang", since: at(0), sent: true, reason: "smoke" };
type State = MessageInitShape<typeof ControllerStateSchema>;
let panel: typeof import("../../../src/panels/control/control-panel");
let control: typeof import("../../../src/mesh/control/control");
let connection: typeof import("../../../src/mesh/console/connection");
let freshness: typeof import("../../../src/mesh/control/display-freshness");
let account: typeof import("../../../src/mesh/console/account");
let draw: (state?: State | null, disobeyed?: boolean) => void;

beforeEach(async () => {
  newPage();
  panel = await import("../../../src/panels/control/control-panel");
  control = await import("../../../src/mesh/control/control");
  connection = await import("../../../src/mesh/console/connection");
  freshness = await import("../../../src/mesh/control/display-freshness");
  account = await import("../../../src/mesh/console/account");
  await connect();
  control.setOperator("li");
  const place = show(null);
  draw = (state = {}, disobeyed = false) => {
    const message = create(ControllerStateSchema, {
      link: Link.UP,
      mode: Mode.REMOTE,
      activity: Activity.IDLE,
      timestamp: at(500),
      ...state,
    });
    const holder = control.holds(ROBOT) ? "li" : "";
    show(
      <panel.ControlPanel
        robotKey={ROBOT}
        controller={state ? ({ message } as Latest<typeof message>) : undefined}
        holder={holder}
        lease={create(LeaseSchema, { holder })}
        description={create(DescriptionSchema, {
          joints: [
            { name: "waist", home: 0.5 },
            { name: "z", home: -1 },
          ],
        })}
        motion={{ running: false, stopped: false, positions: [] }}
        disobeyed={disobeyed}
      />,
      place,
    );
  };
});

async function hold(): Promise<void> {
  const taken = control.take(ROBOT);
  answer(await next(), LeaseAnswerSchema, { lease: "l", since: at(0), now: at(0), until: at(60_000) });
  await taken;
}
const commands = () => texts(".command-row button:not(:disabled)");
const idle = () => find(".notice").textContent;
const sent = async () => read(await next(), CommandRequestSchema);
const SLIDER = "input[type=range]";
const slides = () => !find<HTMLInputElement>(SLIDER).disabled;

test("nothing is sent before control is taken", async () => {
  draw();
  expect([commands(), slides(), idle()]).toEqual([[], false, "Take control to command this robot."]);
  await hold();
  draw();
  expect([commands(), slides(), idle()]).toEqual([
    ["Home", "Hold", "Trace on"],
    true,
    "Motion stops when you leave this page.",
  ]);
  expect(find(".panel").className).toContain("mine");
});

test("each button sends its command, under the lease", async () => {
  await hold();
  draw();
  press("Home");
  expect(await sent()).toMatchObject({ command: Command.HOME, lease: "l" });
  press("Hold");
  expect((await sent()).command).toBe(Command.HOLD);
  press("Trace on");
  expect((await sent()).command).toBe(Command.TRACE_ON);
  draw({ trace: Known.YES, activity: Activity.HOLDING });
  expect(button("Trace off").getAttribute("aria-pressed")).toBe("true");
  press("Trace off");
  expect((await sent()).command).toBe(Command.TRACE_OFF);
  press("Resume");
  expect((await sent()).command).toBe(Command.RESUME);
  draw();
  send(SLIDER, new Event("pointerdown", { bubbles: true }));
  type(SLIDER, "30");
  send(SLIDER, new Event("pointerup", { bubbles: true }));
  expect(await sent()).toMatchObject({ command: Command.SPEED, speedPercent: 30 });
});

test("the message of Home knows where home is", async () => {
  await hold();
  draw();
  press("Home");
  answer(await next(), CommandAnswerSchema, { accepted: true });
  await pass(1);
  expect(control.controlNotice.value).toMatchObject({ kind: "done", target: { positions: [0.5, -1] } });
  expect(idle()).toBe("Sent: Home");
  await pass(1600); // no motion began
  expect(idle()).toBe("Ended before its target: Home");
});

test.each<[string, State | null, string[], boolean, string]>([
  ["held", { activity: Activity.HOLDING }, ["Resume", "Trace on"], true, "On hold: press Resume first."],
  [
    "running a program",
    { program: {} },
    ["Hold", "Trace on"],
    false,
    "A program runs: wait for its end, or hold or stop it.",
  ],
  ["without a link", { link: Link.DOWN }, ["Hold", "Trace on"], true, "No motion: there is no link to the controller."],
  [
    "held without a link",
    { link: Link.DOWN, activity: Activity.HOLDING },
    ["Trace on"],
    true,
    "No motion: there is no link to the controller.",
  ],
  [
    "read-only",
    { readOnly: true },
    [],
    false,
    "Read-only: no proven stop for this controller, so nothing is ever sent to it.",
  ],
  [
    "of a controller without commands",
    { capabilities: { commands: [] } },
    [],
    false,
    "Motion stops when you leave this page.",
  ],
  ["not known", null, ["Home", "Hold", "Trace on"], true, "Motion stops when you leave this page."],
])("a robot %s takes only what it can", async (_, state, can, speed, says) => {
  await hold();
  draw(state);
  expect([commands(), slides(), idle()]).toEqual([can, speed, says]);
});

test("a button that the controller lacks says so, and one that waits says why", async () => {
  await hold();
  draw({ capabilities: { commands: [Command.HOLD], absolute: true }, activity: Activity.IDLE });
  expect(button("Home").title).toBe("Its encoders are absolute: it is always homed.");
  expect(button("Trace on").title).toBe("This controller has no such command.");
  draw({ program: {} });
  expect(button("Home").title).toMatch(/^A program runs/);
});

test("an old state on the screen starts no motion, and holds one all the same", async () => {
  await hold();
  vi.spyOn(freshness, "whyFrozen").mockReturnValue("No new motion: the robot's state is 3 s old.");
  draw();
  expect([commands(), idle()]).toEqual([["Hold", "Trace on"], "No new motion: the robot's state is 3 s old."]);
  draw({ activity: Activity.HOLDING });
  expect(commands()).toEqual(["Trace on"]);
});

test("without a connection nothing can be sent, and the panel says so", async () => {
  await hold();
  draw();
  connection.lostAt.value = 1;
  await pass();
  expect([commands(), slides(), idle()]).toEqual([[], false, "No connection: nothing can be sent."]);
});

test("of a read-only robot nobody takes control", () => {
  draw({ readOnly: true });
  expect(button("Take control").disabled).toBe(true);
});

test("of a robot that is only watched there is the reason, and no button", () => {
  const causes = [{ code: "robot.reads_only" }];
  draw({ readOnly: true, linkReasons: [{ code: "link.read_only", causes }] });
  expect(texts("button")).toEqual([]);
  expect(texts(".no-control")).toEqual([
    "Read-only: robomesh reads this kind of controller and never sends it a command.",
  ]);
});

test("a monitor's account sees a stop, and no commands", () => {
  account.me.value = { account: "gu", role: "monitor" } as typeof account.me.value;
  draw();
  expect(texts("button, input")).toEqual([]);
  expect([texts("p.no-control"), idle()]).toEqual([[expect.stringMatching(/^gu is a monitor/)], ""]);
  draw({ stop: STOP });
  expect(texts(".stopped strong")).toEqual([expect.stringContaining("wang")]);
  expect(pressable()).toEqual([]);
});

test.each<[string, State, string, string]>([
  [
    "that was sent, of an arm at rest",
    { activity: Activity.STOPPED, stop: STOP },
    "Stopped by wang",
    "Reason: “smoke”. No motion until it is reset.",
  ],
  [
    "that a moving arm has not obeyed yet",
    { activity: Activity.MOVING, stop: STOP },
    "Stop sent by wang",
    "Reason: “smoke”. It can be reset when the arm rests.",
  ],
  [
    "that was not sent",
    { stop: { ...STOP, sent: false, reason: "" } },
    "Stop asked for by wang",
    "The stop did not reach the controller. No motion until it is reset.",
  ],
  [
    "of the controller itself",
    { activity: Activity.STOPPED },
    "The controller has stopped by itself",
    "See to it, then reset: no motion until then.",
  ],
  [
    "by a fault",
    { activity: Activity.FAULT, fault: "E42 overload" },
    "The controller has a fault",
    "E42 overload. See to it, then reset: no motion until then.",
  ],
])("a stop %s stands in the place of the speed", async (_, state, what, needs) => {
  await hold();
  draw(state);
  expect(texts(SLIDER)).toEqual([]);
  expect(texts(".stopped strong")).toEqual([expect.stringMatching(new RegExp(`^${what}`))]);
  expect(texts(".stopped p")).toEqual([needs]);
});

test("a stop is reset by its number, by who is in control, when the arm rests", async () => {
  draw({ stop: STOP });
  expect(button("Reset stop 7").title).toBe("Whoever is in control can reset it: take control first.");
  press("Reset stop 7");
  await hold();
  draw({ stop: STOP, activity: Activity.MOVING });
  expect(button("Reset stop 7").title).toBe("It can be reset when the arm rests.");
  press("Reset stop 7");
  draw({ stop: STOP }, true);
  press("Reset stop 7"); // it disobeys
  expect(requests).toEqual([]);
  draw({ stop: STOP });
  expect(idle()).toBe("");
  expect(button("Reset stop 7").title).toBe("");
  press("Reset stop 7");
  expect(await sent()).toMatchObject({ command: Command.RESET, stopId: 7n });
  draw({ activity: Activity.STOPPED });
  press("Reset");
  expect(await sent()).toMatchObject({ command: Command.RESET, stopId: 0n });
  draw({ stop: STOP });
  connection.lostAt.value = 1;
  await pass();
  expect(button("Reset stop 7").disabled).toBe(true);
});

const RECOVERIES = [Recovery.SERVO_ON, 99 as Recovery, Recovery.CONFIRM_TOOL];
const recoverable = { capabilities: { commands: [], recoveries: RECOVERIES } };

test("only what the site file allows, and this page knows, recovers a controller", async () => {
  const { recoveryNames } = await import("../../../src/panels/control/recover");
  draw();
  expect(texts(".recover")).toEqual([]);
  await hold();
  draw(recoverable);
  expect(texts("form.reason")).toEqual([]);
  press("Recover…");
  expect(texts(".recoveries label")).toEqual([
    "Servo on",
    "Confirm the changed tool, payload or frame (sends nothing)",
  ]);
  expect(recoveryNames(create(ControllerStateSchema, recoverable))).toEqual(["Servo on"]);
});

test("a controller is recovered by who is in control, when the arm rests", async () => {
  draw({ ...recoverable, activity: Activity.MOVING });
  expect([button("Recover…").disabled, button("Recover…").title]).toEqual([true, ""]);
  await hold();
  draw({ ...recoverable, activity: Activity.MOVING });
  expect([button("Recover…").disabled, button("Recover…").title]).toEqual([
    true,
    "The controller can be recovered when the arm rests.",
  ]);
  draw(recoverable);
  press("Recover…");
  void control.release();
  draw(recoverable);
  expect(texts("form.reason")).toEqual([]);
});

test("a recovery needs a choice, a look and a reason: none is given before", async () => {
  await hold();
  draw(recoverable);
  press("Recover…");
  type(".reason input[type=text]", "popup closed");
  expect(button("Send to the controller").disabled).toBe(true);
  submit();
  find<HTMLInputElement>("[type=radio]").click();
  await pass();
  submit();
  expect(button("Send to the controller").disabled).toBe(true);
  find<HTMLInputElement>("[type=checkbox]").click();
  await pass();
  expect(requests).toEqual([]);
  submit();
  const recover = { recovery: Recovery.SERVO_ON, looked: true, reason: "popup closed" };
  expect(await sent()).toMatchObject({ command: Command.RECOVER, recover });
  expect(texts("form.reason")).toEqual([]);
});

const answers = (status: number, body: object) =>
  vi.fn(async () => new Response(JSON.stringify(body), { status, headers: { "Content-Type": "application/json" } }));

test("a right that rests comes back with the password, and a wrong one is refused with its reason", async () => {
  await connect({ account: "li", mayCommand: false });
  draw();
  const post = answers(403, { text: "wrong password" });
  vi.stubGlobal("fetch", post);
  type("[type=password]", "hunter1");
  submit();
  submit(); // once
  expect(pressable()).toEqual(["Show"]);
  await pass();
  expect(texts("[role=alert]")).toContain("wrong password");
  expect(find<HTMLInputElement>("[type=password]").value).toBe("");
  vi.stubGlobal("fetch", answers(200, { account: "li", role: "operator" }));
  type("[type=password]", "hunter2");
  submit();
  await pass();
  expect(post.mock.calls).toEqual([["/account/unlock", expect.objectContaining({ body: '{"password":"hunter1"}' })]]);
  expect(texts("[role=alert]")).not.toContain("wrong password");
  expect(account.me.value?.role).toBe("operator");
});
