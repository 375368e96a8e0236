// A jog: keep-alives while it is held, and every end of it said.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { beforeEach, expect, test, vi } from "vitest";
import {
  CommandAnswerSchema,
  CommandRequestSchema,
  JogAnswerSchema,
  JogRequestSchema,
} from "../../../src/gen/robomesh_pb";
import type { Notice } from "../../../src/mesh/control/control";
import type { Pressed } from "../../../src/mesh/control/jog";
import type { Request } from "../../console";
import { answer, connect, newPage, read, refuse, requests, stall } from "../../console";
import { nextTo, ROBOT, showState, takeControl } from "./operator";

let page: typeof import("../../../src/mesh/control/jog");
let told: Notice[];
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const press = (earlier?: Pressed) => page.startJog(ROBOT, { speed: 0.1 }, "X", (notice) => told.push(notice), earlier);
const alive = async () => {
  const request = await nextTo("/jog/");
  return { request, ...read(request, JogRequestSchema) };
};
const reply = (request: Request, values: MessageInitShape<typeof JogAnswerSchema>) =>
  answer(request, JogAnswerSchema, values);
const goesOn = (request: Request) => reply(request, { running: true, moved: 0.0123 });
const started = async (values = {}) =>
  answer(await nextTo("/command/"), CommandAnswerSchema, { accepted: true, ...values });
const last = () => told.at(-1);
async function jogging(values = {}): Promise<Pressed> {
  const pressed = press();
  await started(values);
  return pressed;
}

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/control/jog");
  told = [];
  await takeControl();
});

test("while it is held, keep-alives follow each other, none before the last was answered", async () => {
  await jogging();
  const first = await alive();
  expect(first).toMatchObject({ lease: "l", jog: 1n, sequence: 1n, release: false });
  await after(300);
  expect(requests.filter(({ key }) => key.includes("/jog/"))).toEqual([]);
  goesOn(first.request);
  const second = await alive();
  expect(second).toMatchObject({ sequence: 2n, release: false });
  expect(last()).toEqual({ kind: "busy", text: "X: 12.3\u202fmm" });
  const at = performance.now();
  goesOn(second.request);
  goesOn((await alive()).request);
  expect(performance.now() - at).toBeGreaterThanOrEqual(35);
});

test("a release is repeated until the arm rests, and the message stays with its warning", async () => {
  const pressed = await jogging({ warning: { code: "x", text: "close" } });
  goesOn((await alive()).request);
  pressed.release("");
  for (let i = 0; i < 2; i++) {
    const each = await alive();
    expect(each.release).toBe(true);
    goesOn(each.request);
  }
  reply((await alive()).request, { moved: 0.5, rotary: true, reason: { code: "jog.released", text: "released" } });
  await pressed.over;
  expect(last()).toEqual({ kind: "done", text: "X: 28.6°. Ended: released.", warning: "close" });
});

test("a release is sent at once, also while the last answer was just read", async () => {
  const pressed = await jogging();
  goesOn((await alive()).request);
  await after(1);
  pressed.release("");
  await after(0);
  expect(requests.filter(({ key }) => key.includes("/jog/"))).toHaveLength(1);
});

test("what this page knows of an end is said rather than that the operator let go", async () => {
  const pressed = await jogging();
  pressed.release("a dialog opened");
  pressed.release("");
  reply((await alive()).request, { reason: { code: "jog.released", text: "released" } });
  await pressed.over;
  expect(last()?.text).toBe("X: 0.0\u202fmm. Ended: a dialog opened.");
});

test("the gateway's reason is said of an end that this page did not cause", async () => {
  const pressed = await jogging();
  reply((await alive()).request, { reason: { code: "joints.limit", text: "elbow at its limit" } });
  await pressed.over;
  expect(last()?.text).toBe("X: 0.0\u202fmm. Ended: elbow at its limit.");
});

test("a release before the start is answered takes the start back", async () => {
  const pressed = press();
  const start = await nextTo("/command/");
  await after(30);
  expect(requests.filter(({ key }) => key.includes("/jog/"))).toEqual([]);
  pressed.release("");
  const each = await alive();
  expect([each.jog, each.release]).toEqual([read(start, CommandRequestSchema).id, true]);
  refuse(start, "released before it began");
  reply(each.request, {});
  await pressed.over;
  expect(last()).toMatchObject({ kind: "refused", text: "Not sent: released before it began." });
  expect(requests).toEqual([]);
});

test("a jog begins only when the earlier one is over, and not if it was released by then", async () => {
  const first = await jogging();
  const second = press(first);
  const third = press(first);
  third.release("");
  await after(20);
  expect(requests.filter(({ key }) => key.includes("/command/"))).toEqual([]);
  first.release("");
  reply((await alive()).request, {});
  await first.over;
  await third.over;
  expect((await nextTo("/command/")).key).toContain("/command/li");
  expect(requests.filter(({ key }) => key.includes("/command/"))).toEqual([]);
  void second;
});

test("a picture that freezes ends the jog and says so", async () => {
  const pressed = await jogging();
  goesOn((await alive()).request);
  await showState(5);
  const each = await alive();
  expect(each.release).toBe(true);
  reply(each.request, { reason: { code: "jog.released" } });
  await pressed.over;
  expect(last()?.text).toContain("the robot's state is 5\u202fs old");
});

test("lost control ends the jog and says so", async () => {
  const pressed = await jogging();
  goesOn((await alive()).request);
  const { lostAt } = await import("../../../src/mesh/console/connection");
  const { followThisTab } = await import("../../../src/mesh/control/control");
  followThisTab();
  lostAt.value = 1;
  const each = await alive();
  expect([each.release, each.lease]).toEqual([true, "l"]);
  reply(each.request, { reason: { code: "jog.released" } });
  await pressed.over;
  expect(last()?.text).toContain("control ended");
});

test("without answers the jog is released, and after five its end is not known", async () => {
  const pressed = await jogging();
  goesOn((await alive()).request);
  for (let i = 0; i < 5; i++) {
    const each = await alive();
    expect(each.release).toBe(i > 0);
    refuse(each.request);
  }
  await pressed.over;
  expect(last()).toMatchObject({ kind: "refused", text: expect.stringContaining("its end is not known") });
});

test("a refused keep-alive ends the jog at once, with its reason", async () => {
  const pressed = await jogging();
  refuse((await alive()).request, "no such jog");
  await pressed.over;
  expect(last()?.text).toBe("X: its end is not known: no such jog");
});

test("without control nothing is sent", async () => {
  const { release } = await import("../../../src/mesh/control/control");
  void release();
  const pressed = press();
  await pressed.over;
  expect(requests.filter(({ key }) => !key.includes("/lease/"))).toEqual([]);
  expect(last()?.kind).toBe("refused");
  await connect();
});

test.each([
  ["the network", 0, "the network was late by 0.4\u202fs"],
  ["this browser", 400, "this browser was busy for 0.4\u202fs"],
])("an end for want of keep-alives says that %s was late", async (_, stallMs, why) => {
  const pressed = await jogging();
  const first = await alive();
  if (stallMs) stall(stallMs);
  else await after(440);
  goesOn(first.request);
  reply((await alive()).request, { reason: { code: "jog.not_alive", text: "no keep-alive" } });
  await pressed.over;
  expect(last()?.text).toContain(why);
});

test("an end for want of keep-alives has the gateway's reason if this page saw no delay", async () => {
  const pressed = await jogging();
  reply((await alive()).request, { reason: { code: "jog.not_alive", text: "no keep-alive" } });
  await pressed.over;
  expect(last()?.text).toBe("X: 0.0\u202fmm. Ended: no keep-alive.");
});
