// A console without a network: it takes what the page sends, and the test answers.

import type { DescMessage, MessageInitShape, MessageShape } from "@bufbuild/protobuf";
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { vi } from "vitest";
import { FromPageSchema, ToPageSchema } from "../src/gen/robomesh_pb";

type ToPage = NonNullable<MessageInitShape<typeof ToPageSchema>["message"]>;

/** A request of the page without an answer. */
export interface Request {
  id: bigint;
  key: string;
  payload: Uint8Array;
  /** Over which connection it came: "/mesh" or "/mesh/stop". */
  path: string;
}

/** A WebSocket without a network. */
class Socket {
  static readonly CONNECTING = 0;
  static readonly OPEN = 1;
  static readonly CLOSED = 3;
  binaryType = "";
  readyState = Socket.CONNECTING;
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: ArrayBuffer }) => void) | null = null;
  onclose: ((event: { code: number; reason: string }) => void) | null = null;
  readonly path: string;

  constructor(address: string) {
    this.path = new URL(address).pathname;
    sockets.push(this);
  }

  send(bytes: Uint8Array): void {
    const { message } = fromBinary(FromPageSchema, bytes);
    if (message.case === "watch") watched.add(message.value.key);
    else if (message.case === "unwatch") watched.delete(message.value.key);
    else if (message.case === "ask" && message.value.key) requests.push({ ...message.value, path: this.path });
  }

  close(): void {
    this.readyState = Socket.CLOSED;
  }
}

export const sockets: Socket[] = [];
export const requests: Request[] = [];
/** Key expressions that the page watches. */
export const watched = new Set<string>();

/** Begin a page anew: its modules are loaded again, and nothing has been sent. Its time is simulated. */
export function newPage(): void {
  vi.resetModules();
  vi.useFakeTimers();
  const now = performance.now.bind(performance);
  stalledMs = 0;
  vi.spyOn(performance, "now").mockImplementation(() => now() + stalledMs);
  vi.stubGlobal("WebSocket", Socket);
  localStorage.clear();
  sessionStorage.clear();
  sockets.length = requests.length = 0;
  watched.clear();
  forgetListeners();
}

/** Let time go on while the page's own thread stands still [ms]. */
export function stall(ms: number): void {
  stalledMs += ms;
  vi.setSystemTime(Date.now() + ms);
}
let stalledMs = 0;

/** Remove the listeners of earlier pages from window and document, and remember those of the next. */
function forgetListeners(): void {
  for (const remove of listeners.splice(0)) remove();
  for (const target of [window, document] as EventTarget[]) {
    const add = target.addEventListener.bind(target);
    vi.spyOn(target, "addEventListener").mockImplementation((...given) => {
      add(...given);
      listeners.push(() => target.removeEventListener(...given));
    });
  }
}
const listeners: (() => void)[] = [];

/** Open the page's connections and greet it. */
export async function connect(hello: MessageInitShape<typeof ToPageSchema> | object = {}): Promise<void> {
  const { keepConnected } = await import("../src/mesh/console/connection");
  keepConnected(
    async () => true,
    () => undefined,
  );
  await vi.advanceTimersByTimeAsync(0);
  for (const path of ["/mesh", "/mesh/stop"]) open(path);
  say({ case: "hello", value: { connected: true, presenceKnown: true, session: "page1", ...hello } } as ToPage);
}

function open(path: string): void {
  const socket = sockets.findLast((each) => each.path === path);
  if (!socket) throw new Error(`the page opened no connection to ${path}`);
  socket.readyState = Socket.OPEN;
  socket.onopen?.();
}

/** Send the page a message of the console. */
export const say = (message: ToPage): void => deliver(toBinary(ToPageSchema, create(ToPageSchema, { message })));

/** Deliver a message to the page, as it was received. */
export function deliver(bytes: Uint8Array): void {
  const socket = sockets.findLast((each) => each.path === "/mesh");
  socket?.onmessage?.({ data: Uint8Array.from(bytes).buffer });
}

/** Send the page a publication. */
export function publish<S extends DescMessage>(
  key: string,
  schema: S,
  value: MessageInitShape<S>,
  header: { publisher?: bigint; sequence?: bigint; timeMs?: number; live?: boolean; ageS?: number } = {},
): void {
  const { publisher = 1n, sequence = ++published, timeMs = Date.now(), live = true, ageS } = header;
  const attachment = new DataView(new ArrayBuffer(24));
  attachment.setBigUint64(0, publisher, true);
  attachment.setBigUint64(8, sequence, true);
  attachment.setBigInt64(16, BigInt(Math.round(timeMs * 1e6)), true);
  const payload = toBinary(schema, create(schema, value));
  const sample = {
    key,
    payload,
    attachment: new Uint8Array(attachment.buffer),
    live,
    ...(ageS !== undefined && { ageS }),
  };
  say({ case: "sample", value: sample });
}
let published = 0n;

/** Let time pass [s] in which the console goes on sending. */
export async function stayConnected(seconds: number): Promise<void> {
  for (let left = 1000 * seconds; left > 0; left -= 200) {
    await vi.advanceTimersByTimeAsync(Math.min(200, left));
    say({ case: "answer", value: { id: 0n } } as ToPage);
  }
}

/** Take the page's oldest request without an answer; wait for it. */
export async function next(): Promise<Request> {
  for (let left = 1000; left && !requests.length; left--) await vi.advanceTimersByTimeAsync(5);
  const request = requests.shift();
  if (!request) throw new Error("the page sent no request within 5 s of its time");
  return request;
}

/** Read a request's message. */
export function read<S extends DescMessage>(request: Request, schema: S): MessageShape<S> {
  return fromBinary(schema, request.payload);
}

/** Answer a request. */
export function answer<S extends DescMessage>(request: Request, schema: S, value: MessageInitShape<S>): void {
  say({ case: "answer", value: { id: request.id, ok: true, payload: toBinary(schema, create(schema, value)) } });
}

/** Refuse a request; without `error` nothing answered it. */
export function refuse(request: Request, error = "", refusal?: object): void {
  const value = { id: request.id, error: error || "no answer", noAnswer: !error, ...(refusal && { refusal }) };
  say({ case: "answer", value } as ToPage);
}
