// Renewal of a lease while the page's own thread is busy, and the measure of how busy it was.

import { fromBinary } from "@bufbuild/protobuf";
import { beforeEach, expect, test, vi } from "vitest";
import { LeaseRequest_Action as Action, FromPageSchema, LeaseRequestSchema } from "../../../src/gen/robomesh_pb";
import { newPage, next, requests, sockets, stall } from "../../console";
import { ROBOT, takeControl } from "./operator";

interface Work {
  posted: unknown[];
  ended: boolean;
}
const workers: Work[] = [];
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const hide = (hidden: boolean) => Object.defineProperty(document, "hidden", { value: hidden, configurable: true });

beforeEach(() => {
  newPage();
  workers.length = 0;
  vi.stubGlobal(
    "Worker",
    class implements Work {
      posted: unknown[] = [];
      ended = false;
      constructor() {
        workers.push(this);
      }
      postMessage(message: unknown) {
        this.posted.push(message);
      }
      terminate() {
        this.ended = true;
      }
    },
  );
  return () => hide(false);
});

test("who is in control has a worker that can renew the lease, and nobody else", async () => {
  const { renewWhileBusy } = await import("../../../src/mesh/control/renewal");
  const { release } = await import("../../../src/mesh/control/control");
  renewWhileBusy();
  expect(workers).toEqual([]);
  await takeControl();
  const [posted] = workers[0]?.posted ?? [];
  const { address, message } = posted as { address: string; message: Uint8Array };
  const { value } = fromBinary(FromPageSchema, message).message as { value: { key: string; payload: Uint8Array } };
  expect([new URL(address).pathname, value.key]).toEqual(["/mesh", `${ROBOT}/lease/request/li`]);
  expect(fromBinary(LeaseRequestSchema, value.payload)).toMatchObject({
    action: Action.RENEW,
    lease: "l",
    ttlS: 2,
    session: "page1",
  });
  void release();
  await next();
  expect(workers).toMatchObject([{ ended: true }]);
  await takeControl();
  expect(workers).toHaveLength(2);
});

test("the worker hears four times a second that the page runs, but not of a hidden page", async () => {
  const { renewWhileBusy } = await import("../../../src/mesh/control/renewal");
  renewWhileBusy();
  await takeControl();
  const heard = () => (workers[0]?.posted.length ?? 0) - 1;
  const before = heard();
  await after(1000);
  expect(heard() - before).toBe(4);
  hide(true);
  await after(1000);
  expect(heard() - before).toBe(4);
});

test("the worker renews only while the page is busy for 0.9 s to 2 s", async () => {
  await import("../../../src/mesh/control/renewal-worker");
  const post = (data: unknown) => dispatchEvent(new MessageEvent("message", { data }));
  const alive = () => post(performance.timeOrigin + performance.now());
  await after(300);
  const { askMessage } = await import("../../../src/mesh/console/connection");
  post({ address: "ws://h/mesh", message: askMessage("k", LeaseRequestSchema, {}) });
  alive();
  await after(1000);
  expect(requests).toEqual([]);
  if (sockets[0]) sockets[0].readyState = 1;
  alive();
  for (let s = 0; s < 5; s++) {
    await after(800);
    alive();
  }
  expect(requests).toEqual([]);
  await after(1000);
  expect(requests.length).toBeGreaterThan(0);
  await after(1000);
  const renewed = requests.length;
  expect(renewed).toBeLessThanOrEqual(4);
  await after(5000);
  expect(requests).toHaveLength(renewed);
});

async function standStill(ms: number): Promise<void> {
  stall(ms);
  await after(100);
}

test("a page that stood still for half a second is slow for a minute", async () => {
  const { isSlow, measureStalls } = await import("../../../src/mesh/control/page-stalls");
  measureStalls();
  await standStill(350);
  expect(isSlow()).toBe(false);
  await standStill(600);
  expect(isSlow()).toBe(true);
  await after(59_000);
  expect(isSlow()).toBe(true);
  await after(1500);
  expect(isSlow()).toBe(false);
});

test("a delay was the page's own if it stood still for most of it", async () => {
  const { measureStalls, wasStalled } = await import("../../../src/mesh/control/page-stalls");
  measureStalls();
  await after(1000);
  expect(wasStalled(2000)).toBe(false);
  await standStill(700);
  await after(300);
  expect([1000, 2000].map(wasStalled)).toEqual([true, false]);
  await standStill(700);
  expect([1000, 2000].map(wasStalled)).toEqual([true, true]);
  await after(4100);
  await standStill(600);
  expect(wasStalled(8000)).toBe(false);
});
