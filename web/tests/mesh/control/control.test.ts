// Control of a robot from a page: the steps between its states.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import type { LeaseSchema } from "../../../src/gen/robomesh_pb";
import {
  LeaseRequest_Action as Action,
  LeaseRequest_Cause as Cause,
  LeaseAnswerSchema,
  LeaseRequestSchema,
} from "../../../src/gen/robomesh_pb";
import type { Request } from "../../console";
import { answer, connect, newPage, next, read, refuse, requests } from "../../console";

const ROBOT = "robomesh/hall/arm";
let page: typeof import("../../../src/mesh/control/control");
let connection: typeof import("../../../src/mesh/console/connection");
const at = (ms: number) => timestampFromMs(1e12 + ms);

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/control/control");
  connection = await import("../../../src/mesh/console/connection");
  page.followThisTab();
  await connect();
  page.setOperator("li");
  return () => hide(false);
});

function grant(request: Request, until = 60_000): void {
  answer(request, LeaseAnswerSchema, { lease: "l", since: at(0), now: at(0), until: at(until) });
}
async function hold(): Promise<void> {
  const taken = page.take(ROBOT);
  grant(await next());
  await taken;
}
const nextRequest = async () => read(await next(), LeaseRequestSchema);
const nextAction = async () => Action[(await nextRequest()).action];
const state = () => [page.heldLease.value?.lease, page.controlNotice.value?.text];
function published(holder: string, since: number, more: Partial<MessageInitShape<typeof LeaseSchema>> = {}): void {
  const lease = { holder, since: at(since), timestamp: at(since + 1), ended: "", ...more };
  page.handleLease(ROBOT, lease as Parameters<typeof page.handleLease>[1]);
}
function hide(hidden: boolean): void {
  Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}

test("a lease is renewed until it is released", async () => {
  await hold();
  expect(await nextAction()).toBe("RENEW");
  void page.release();
  expect(await nextAction()).toBe("RELEASE");
  expect(state()).toEqual([undefined, "Control released."]);
});

test("a refused request leaves this tab without a lease", async () => {
  const taken = page.take(ROBOT);
  refuse(await next(), "no");
  await taken;
  expect(state()).toEqual([undefined, expect.stringContaining("no")]);
});

test("a release before the answer gives the lease back", async () => {
  void page.take(ROBOT);
  const request = await next();
  void page.release();
  grant(request);
  expect(await nextAction()).toBe("RELEASE");
  expect(state()).toEqual([undefined, "Control released."]);
});

test("a page that is hidden gives its lease back with the cause", async () => {
  void page.take(ROBOT);
  const request = await next();
  hide(true);
  hide(false);
  grant(request);
  expect((await nextRequest()).cause).toBe(Cause.HIDDEN);
  await hold();
  hide(true);
  expect((await nextRequest()).cause).toBe(Cause.HIDDEN);
  expect(state()).toEqual([undefined, "Control released because this page was hidden."]);
});

test("only one request is on its way", async () => {
  void page.take(ROBOT);
  await next();
  await page.take(ROBOT);
  expect(requests).toEqual([]);
});

test("the message of a lost lease stays until control changes again", async () => {
  await hold();
  published("wang", 10, { ended: "taken over by wang" });
  const lost = state();
  expect(lost).toEqual([undefined, expect.stringContaining("taken over by wang")]);
  published("wang", 10);
  expect(state()).toEqual(lost);
  published("", 20);
  expect(state()).toEqual([undefined, undefined]);
});

test("control that was offered is handed over", async () => {
  await hold();
  void page.offer("wang");
  await next();
  published("wang", 10);
  const [lease, text] = state();
  expect(lease).toBeUndefined();
  expect(text).toContain("wang");
  expect(text).not.toMatch(/lost/i);
});

test("a lost connection ends control", async () => {
  await hold();
  connection.lostAt.value = 1;
  expect(state()).toEqual([undefined, expect.stringMatching(/lost/i)]);
});

test("a renewal without an answer is tried again, and control ends when the lease does", async () => {
  const taken = page.take(ROBOT);
  grant(await next(), 2000);
  await taken;
  for (let left = 30; left && page.heldLease.value; left--) {
    await vi.advanceTimersByTimeAsync(100);
    for (const request of requests.splice(0)) refuse(request);
  }
  expect(state()).toEqual([undefined, expect.stringMatching(/2 s/)]);
});
