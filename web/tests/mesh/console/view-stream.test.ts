// The stream of a view's page: it shows nothing as live that no longer arrives.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create, toBinary } from "@bufbuild/protobuf";
import { beforeEach, expect, test, vi } from "vitest";
import { ToPageSchema } from "../../../src/gen/robomesh_pb";
import { newPage } from "../../console";

let page: typeof import("../../../src/mesh/console/view-stream");
let connection: typeof import("../../../src/mesh/console/connection");
const streams: { push: (bytes: Uint8Array) => void; end: () => void; signal: AbortSignal }[] = [];
let refusal: Response | null = null;
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);

function framed(message: MessageInitShape<typeof ToPageSchema>["message"]): number[] {
  const bytes = toBinary(ToPageSchema, create(ToPageSchema, { message: message as never }));
  return [0, 0, 0, bytes.length, ...bytes];
}
const HELLO = framed({ case: "hello", value: { site: "hall", connected: true } });
const hide = (state: "hidden" | "visible") => {
  Object.defineProperty(document, "visibilityState", { value: state, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
};

beforeEach(async () => {
  newPage();
  streams.length = 0;
  refusal = null;
  vi.stubGlobal("fetch", async (_: string, { signal }: { signal: AbortSignal }) => {
    if (refusal) return refusal;
    const body = new ReadableStream<Uint8Array>({
      start(stream) {
        streams.push({ push: (bytes) => stream.enqueue(bytes), end: () => stream.close(), signal });
        signal.addEventListener("abort", () => stream.error(new Error("aborted")));
      },
    });
    return { ok: true, body };
  });
  page = await import("../../../src/mesh/console/view-stream");
  connection = await import("../../../src/mesh/console/connection");
  page.followView("/view");
  await after(0);
  return () => hide("visible");
});

test("messages are read however the network cuts them", async () => {
  const sites: (string | undefined)[] = [];
  connection.hello.subscribe((hello) => sites.push(hello?.site));
  for (const byte of HELLO) streams[0]?.push(new Uint8Array([byte])), await after(0);
  streams[0]?.push(new Uint8Array([...HELLO, ...HELLO.slice(0, 5)]));
  await after(0);
  streams[0]?.push(new Uint8Array(HELLO.slice(5)));
  await after(0);
  expect(sites).toEqual([undefined, "hall", "hall", "hall"]);
  expect(connection.lostAt.value).toBeNull();
});

test("a stream that ends is lost, and begun again after 2 s", async () => {
  streams[0]?.push(new Uint8Array(HELLO));
  await after(0);
  streams[0]?.end();
  await after(0);
  const lostAt = connection.lostAt.value;
  expect(lostAt).toBe(Date.now());
  await after(1990);
  expect(streams).toHaveLength(1);
  await after(20);
  expect(streams).toHaveLength(2);
  streams[1]?.end();
  await after(0);
  expect(connection.lostAt.value).toBe(lostAt);
});

test("a stream that is silent for 5 s is lost", async () => {
  await after(4000);
  streams[0]?.push(new Uint8Array(HELLO));
  await after(4900);
  expect(connection.lostAt.value).toBeNull();
  await after(200);
  expect([connection.lostAt.value !== null, streams[0]?.signal.aborted]).toEqual([true, true]);
});

test.each([
  [403, "no such view", 30_000],
  [503, "starting", 2000],
])("a stream refused with %i says %s and is tried again after %i ms", async (status, text, retryMs) => {
  refusal = new Response(text, { status, headers: { "Content-Type": "text/plain" } });
  streams[0]?.end();
  await after(2000);
  expect(page.refused.value).toBe(text);
  refusal = null;
  await after(retryMs - 10);
  expect(streams).toHaveLength(1);
  await after(20);
  expect([streams.length, page.refused.value]).toEqual([2, ""]);
});

test("a hidden page receives nothing until it is shown again", async () => {
  hide("hidden");
  await after(60_000);
  expect([streams.length, streams[0]?.signal.aborted]).toEqual([1, true]);
  hide("visible");
  hide("visible");
  await after(0);
  expect(streams).toHaveLength(2);
});
