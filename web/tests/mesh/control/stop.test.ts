// Stop requests: each robot's outcome is said, and a press that did not arrive is not forgotten.

import { beforeEach, expect, test, vi } from "vitest";
import { StopAnswerSchema, StopRequestSchema } from "../../../src/gen/robomesh_pb";
import type { Request } from "../../console";
import { answer, connect, newPage, next, read, refuse, requests, say, sockets } from "../../console";
import { showState } from "./operator";

let page: typeof import("../../../src/mesh/control/stop");
let connection: typeof import("../../../src/mesh/console/connection");
const ARM = "robomesh/hall/arm";
const OTHER = "robomesh/hall/other";
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);

/** Press stop, and answer each robot's request. */
async function press(...replies: ((request: Request) => void)[]): Promise<string> {
  const done = page.stop([ARM, OTHER].slice(0, replies.length));
  for (const reply of replies) reply(await next());
  await done;
  return page.stopNotice.value?.text ?? "";
}
const sent = (request: Request) => answer(request, StopAnswerSchema, { sent: true, stopId: 7n });
const latched = (request: Request) => answer(request, StopAnswerSchema, { stopId: 7n, text: "no link" });
const never = (request: Request) => answer(request, StopAnswerSchema, { text: "only watched" });
const refused = (request: Request) => refuse(request, "no right");
const silent = (request: Request) => refuse(request);

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/control/stop");
  connection = await import("../../../src/mesh/console/connection");
  await connect();
});

test("a stop needs no control, names who pressed it, and reports what the page showed", async () => {
  const { setOperator } = await import("../../../src/mesh/control/control");
  setOperator(" li ");
  await showState(9);
  void page.stop([ARM]);
  expect(page.stopNotice.value).toEqual({ kind: "busy", text: "Asking hall/arm to stop…" });
  const request = await next();
  expect([request.key, request.path]).toEqual([`${ARM}/stop`, "/mesh/stop"]);
  expect(read(request, StopRequestSchema)).toMatchObject({ by: "li", page: { stateAgeS: expect.closeTo(9, 0) } });
});

test("a stop that was sent says so for 15 s", async () => {
  expect(await press(sent, sent)).toBe("Stop sent to hall/arm (stop 7).\nStop sent to hall/other (stop 7).");
  expect(page.stopNotice.value?.kind).toBe("done");
  await after(14_900);
  expect(page.stopNotice.value).not.toBeNull();
  await after(200);
  expect(page.stopNotice.value).toBeNull();
});

test.each([
  ["latched", latched, "Stop latched for hall/other, but it did not reach the controller: no link"],
  ["refused", refused, "Stop request to hall/other failed: no right"],
  ["never possible", never, "Cannot be stopped from here, use the robot's panel: hall/other."],
])("a stop that is %s is said first, with its time, until it is dismissed", async (_, outcome, text) => {
  const [first, second] = (await press(sent, outcome)).split("\n");
  expect(first).toMatch(/^\d\d:\d\d:\d\d/);
  expect(first).toContain(text);
  expect(second).toContain("hall/arm");
  expect([page.stopNotice.value?.kind, page.unsentStop.value]).toEqual(["refused", null]);
  await after(60_000);
  expect(page.stopNotice.value).not.toBeNull();
  page.dismissStop();
  expect(page.stopNotice.value).toBeNull();
});

test("a robot without an answer delays no other's stop", () => {
  void page.stop([ARM, OTHER]);
  expect(requests.map(({ key }) => key)).toEqual([`${ARM}/stop`, `${OTHER}/stop`]);
});

test("the message of a newer press stays", async () => {
  await press(sent);
  await after(10_000);
  await press(latched);
  await after(10_000);
  expect(page.stopNotice.value?.text).toContain("latched");
});

test("a stop without an answer can be sent again, for the robots that did not answer", async () => {
  await press(sent, silent);
  expect(page.unsentStop.value).toEqual({ robotKeys: [OTHER], at: expect.any(Number) });
  page.stopAgain();
  expect((await next()).key).toBe(`${OTHER}/stop`);
  expect(page.unsentStop.value).toBeNull();
  page.dismissStop();
  requests.length = 0;
  page.stopAgain();
  expect(requests).toEqual([]);
});

test("a connection that swallowed a stop is not used again", async () => {
  const first = sockets.find(({ path }) => path === "/mesh");
  await after(100);
  void page.stop([ARM]);
  await after(3100);
  expect(first?.readyState).toBe(3);
  expect(page.unsentStop.value?.robotKeys).toEqual([ARM]);
});

test.each([
  ["of the last seconds is sent with its own time", 9000, 1],
  ["of longer ago is offered", 11_000, 0],
])("when the connection returns, a press %s", async (_, ms, count) => {
  connection.lostAt.value = 1;
  const at = Date.now();
  await press(silent);
  const text = page.stopNotice.value?.text;
  await after(ms - (Date.now() - at));
  requests.length = 0;
  say({ case: "hello", value: { connected: true } } as never);
  expect(requests).toHaveLength(count);
  if (!count) expect(page.unsentStop.value?.at).toBe(at);
  for (const request of requests.splice(0)) latched(request);
  await after(0);
  expect(page.stopNotice.value?.text.slice(0, 8)).toBe(text?.slice(0, 8));
});

test("a connection that returns sends nothing that nobody pressed", async () => {
  connection.lostAt.value = 1;
  connection.lostAt.value = null;
  await press(silent);
  await after(0);
  expect(requests).toEqual([]);
});
