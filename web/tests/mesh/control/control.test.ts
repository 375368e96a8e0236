// Control of a robot from a page: the steps between its states.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import type { LeaseSchema } from "../../../src/gen/robomesh_pb";
import {
  LeaseRequest_Action as Action,
  LeaseRequest_Cause as Cause,
  LeaseAnswerSchema,
  LeaseRequestSchema,
  ReasonSchema,
} from "../../../src/gen/robomesh_pb";
import type { Request } from "../../console";
import { answer, connect, newPage, next, read, refuse, requests, stall } from "../../console";

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
  expect(state()).toEqual([
    undefined,
    expect.stringMatching(/^Control ended: the gateway has not answered for 2 s\. .*the arm may still be moving/),
  ]);
  published("", 10, { ended: "not renewed within 2 s" });
  expect(state()).toEqual([undefined, expect.stringMatching(/not renewed within 2 s/)]);
});

test.each([
  ["nothing", "", /Enter your name/],
  ["a name with a blank", "li wang", /“li wang” cannot be used/],
  ["a path", "li/x", /cannot be used/],
])("%s is no operator's name, and asks for nothing", async (_, name, why) => {
  page.setOperator(name);
  await page.take(ROBOT);
  await page.requestControl(ROBOT, "wang", "");
  expect(requests).toEqual([]);
  expect(page.controlNotice.value).toEqual({ kind: "refused", text: expect.stringMatching(why) });
});

test("a name is kept for the next page without its blanks, but not an account's", async () => {
  page.setOperator(" li ");
  expect([page.ownName(), localStorage.getItem("robomesh.operator")]).toEqual(["li", "li"]);
  connection.hello.value = { ...connection.hello.value, operator: "li.hall" } as never;
  expect([page.operator.value, page.ownName(), localStorage.getItem("robomesh.operator")]).toEqual([
    "li.hall",
    "li.hall",
    "li",
  ]);
});

test("control is taken over with a reason, or accepted", async () => {
  void page.takeOver(ROBOT, "smoke");
  expect(await nextRequest()).toMatchObject({ action: Action.TAKE, reason: "smoke", session: "page1", ttlS: 2 });
  requests.length = 0;
  await vi.advanceTimersByTimeAsync(3000);
  void page.accept(ROBOT);
  expect(await nextAction()).toBe("ACCEPT");
});

test("control of another robot is given back before the new one is asked for", async () => {
  await hold();
  const taken = page.take("robomesh/hall/other");
  const first = await next();
  expect([first.key, read(first, LeaseRequestSchema).action]).toEqual([`${ROBOT}/lease/request/li`, Action.RELEASE]);
  answer(first, LeaseAnswerSchema, {});
  grant(await next());
  await taken;
  expect([page.holds(ROBOT), page.holds("robomesh/hall/other")]).toEqual([false, true]);
});

test.each([
  [
    "a question",
    () => page.requestControl(ROBOT, "wang", "mine now"),
    { action: Action.ASK, reason: "mine now" },
    "wang is told that you ask for control.",
  ],
  ["an offer", () => page.offer("wang"), { action: Action.OFFER, to: "wang", lease: "l" }, "Control offered to wang."],
  ["its withdrawal", () => page.offer(null), { action: Action.OFFER, to: "li", lease: "l" }, "Offer withdrawn."],
])("%s says what became of it", async (_, say, request, text) => {
  await hold();
  for (const reply of [answer, null]) {
    const said = say();
    const sent = await next();
    expect(read(sent, LeaseRequestSchema)).toMatchObject(request);
    if (reply) reply(sent, LeaseAnswerSchema, {});
    else refuse(sent, "gone");
    await said;
    expect(page.controlNotice.value?.text).toEqual(reply ? text : expect.stringMatching(/^Not (asked|done): gone/));
  }
});

test("without control there is nothing to offer or release", async () => {
  await page.offer("wang");
  await page.release();
  expect([requests, page.controlNotice.value]).toEqual([[], null]);
});

test("what another robot publishes, or was published before, ends no control", async () => {
  await hold();
  const lease = { holder: "wang", since: at(9), timestamp: at(10) };
  page.handleLease("robomesh/hall/other", lease as never);
  published("wang", -5);
  published("li", 0);
  expect(state()).toEqual(["l", undefined]);
});

test("control that the gateway no longer knows is lost with that reason", async () => {
  await hold();
  published("", 10);
  expect(state()).toEqual([undefined, expect.stringContaining("the gateway no longer knows of it")]);
});

test("a newer lease of the same operator is another window's, and ends this one's control", async () => {
  await hold();
  published("li", 10);
  expect(state()).toEqual([undefined, expect.stringMatching(/^Control ended/)]);
});

test.each([
  ["too slow", { code: "lease.gone", text: "not renewed" }, /too slow/],
  [
    "not the cause, if another operator took control",
    { code: "lease.ended.taken", text: "taken by wang" },
    /taken by wang/,
  ],
])("a page that stood still when its lease ended was %s", async (_, endedReason, why) => {
  await hold();
  await vi.advanceTimersByTimeAsync(200);
  stall(59_000);
  published("wang", 10, { endedReason: create(ReasonSchema, endedReason) });
  expect(state()).toEqual([undefined, expect.stringMatching(why)]);
});

test("a page that stood still for half a second asks for longer leases", async () => {
  await hold();
  stall(600);
  await vi.advanceTimersByTimeAsync(100);
  expect((await nextRequest()).ttlS).toBe(4);
});

test.each([
  ["is too slow", "lease.expired", /too slow/],
  ["has lost it to another", "lease.held", /li has it/],
])("a page that stood still past its lease, and whose renewal is refused, %s", async (_, code, why) => {
  const taken = page.take(ROBOT);
  grant(await next(), 2000);
  await taken;
  stall(3000);
  refuse(await next(), "li has it", { code, text: "li has it" });
  await vi.advanceTimersByTimeAsync(0);
  expect(state()).toEqual([undefined, expect.stringMatching(why)]);
});

test("the answer to a renewal of a lease that has ended changes nothing", async () => {
  await hold();
  const renewal = await next();
  void page.release();
  grant(renewal);
  await vi.advanceTimersByTimeAsync(0);
  expect(page.heldLease.value).toBeNull();
});
