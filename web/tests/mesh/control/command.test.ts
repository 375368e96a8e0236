// Commands under a lease: what is sent, and what the page says of it.

import { timestampMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  CommandRequest_Command as Command,
  CommandAnswerSchema,
  CommandRequestSchema,
} from "../../../src/gen/robomesh_pb";
import type { Notice } from "../../../src/mesh/control/control";
import { answer, connect, newPage, read, refuse, requests } from "../../console";
import { GATEWAY_MS, nextTo, ROBOT, showState, takeControl } from "./operator";

let page: typeof import("../../../src/mesh/control/command");
let told: Notice[];
const send = (name: Command, values = {}, robot = ROBOT) =>
  page.command(robot, name, "Home", values, (notice) => told.push(notice));
const sent = async () => read(await nextTo("/command/"), CommandRequestSchema);
const commands = () => requests.filter(({ key }) => key.includes("/command/"));

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/control/command");
  told = [];
});

test("without control, or with that of another robot, nothing is sent", async () => {
  await connect();
  expect(await send(Command.HOME)).toBe(false);
  await takeControl("robomesh/hall/other");
  expect(await send(Command.HOME)).toBe(false);
  expect(commands()).toEqual([]);
  expect(told).toEqual(Array(2).fill({ kind: "refused", text: "Not sent: Take control to command this robot." }));
});

test("from an old picture no motion starts, but one is held and a stop is reset", async () => {
  await takeControl();
  await showState(5);
  for (const name of [Command.HOME, Command.MOVE_RELATIVE, Command.JOG, Command.RUN_PROGRAM, Command.RESUME])
    expect(await send(name)).toBe(false);
  expect(told.every(({ text }) => text.includes("the robot's state is 5\u202fs old"))).toBe(true);
  expect(commands()).toEqual([]);
  for (const name of [Command.HOLD, Command.RESET]) {
    void send(name);
    expect((await sent()).command).toBe(name);
  }
});

test("a command has the lease, a rising number, what the page showed, and soon ends", async () => {
  await takeControl();
  await showState(0.5);
  void send(Command.HOME);
  const first = await sent();
  expect(first).toMatchObject({
    lease: "l",
    command: Command.HOME,
    page: { view: "", stateAgeS: expect.closeTo(0.5, 1) },
  });
  expect(first.notAfter && timestampMs(first.notAfter)).toBeCloseTo(GATEWAY_MS + performance.now() + 1000, -2);
  void send(Command.RUN_PROGRAM, { program: "home" });
  const second = await sent();
  expect(second.id).toBe(first.id + 1n);
  expect(second.notAfter && timestampMs(second.notAfter)).toBeCloseTo(GATEWAY_MS + performance.now() + 30_000, -2);
  expect(page.newestCommand()).toBe(second.id);
});

async function outcome(name: Command, values: object, reply: object): Promise<Notice | undefined> {
  await takeControl();
  const done = send(name, values);
  answer(await nextTo("/command/"), CommandAnswerSchema, reply);
  await done;
  return told.at(-1);
}

test("an accepted motion says where it goes, and supersedes earlier ones", async () => {
  const joints = [1, 2];
  expect(await outcome(Command.MOVE_ABSOLUTE, { jointPositions: joints }, { accepted: true })).toEqual({
    kind: "done",
    text: "Sent: Home",
    target: { what: "Home", positions: joints, id: 1n },
  });
  expect(told[0]).toEqual({ kind: "busy", text: "Sending Home…" });
  expect(page.newestMotion.value).toBe(1n);
});

test("what is no motion supersedes none, and has no target", async () => {
  expect(await outcome(Command.HOLD, { jointPositions: [1] }, { accepted: true })).toEqual({
    kind: "done",
    text: "Sent: Home",
  });
  expect(page.newestMotion.value).toBe(0n);
});

test.each([
  ["a gateway's", { warning: { code: "x", text: "close to the table" } }],
  ["an older gateway's", { text: "accepted; mind: close to the table" }],
])("%s warning stays with the message", async (_, reply) => {
  const notice = await outcome(Command.HOME, {}, { accepted: true, ...reply });
  expect(notice).toEqual({ kind: "done", text: "Sent: Home", warning: "close to the table" });
});

test("a motion that was not accepted supersedes none", async () => {
  expect(await outcome(Command.HOME, {}, { text: "busy" })).toEqual({ kind: "refused", text: "Not sent: busy" });
  expect(page.newestMotion.value).toBe(0n);
});

test.each(["the arm moves", "the arm moves.", "手臂在动。"])(
  "a refusal that says %s ends with one full stop",
  async (why) => {
    await takeControl();
    const done = send(Command.HOME);
    refuse(await nextTo("/command/"), why);
    expect(await done).toBe(false);
    expect(told.at(-1)).toEqual({
      kind: "refused",
      text: `Not sent: ${why.replace(/[.。]$/, "")}${why.endsWith("。") ? "。" : "."}`,
    });
  },
);

test("a command without an answer says so, and is not repeated", async () => {
  await takeControl();
  const done = send(Command.HOME);
  await nextTo("/command/");
  await vi.advanceTimersByTimeAsync(3100);
  expect(await done).toBe(false);
  expect(told.at(-1)).toMatchObject({ kind: "refused", text: expect.stringContaining("2") });
  expect(commands()).toEqual([]);
});
