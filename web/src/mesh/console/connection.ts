// The page's WebSocket to the console: subscriptions and requests; and another one for its stops.

import type { DescMessage, MessageInitShape, MessageShape } from "@bufbuild/protobuf";
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { computed, signal } from "@preact/signals";
import type { Reason, ToPage_Hello } from "../../gen/robomesh_pb";
import { FromPageSchema, ToPageSchema } from "../../gen/robomesh_pb";
import { reasonText } from "../../i18n/reasons";
import { t } from "../../i18n/texts";
import { ageClock } from "./age-clock";
import { sampleDelay } from "./sample-delay";

/** A received publication. Times are on this page's monotonic clock [ms]; ages on `ageClock`. */
export interface Sample {
  key: string;
  payload: Uint8Array;
  publisher: bigint;
  sequence: bigint;
  /** Publisher's source time in ms since the Unix epoch. */
  sourceTime: number;
  live: boolean;
  arrived: number;
  /** When the data was new, on the clock for ages; null: its age is not known. */
  newAt: number | null;
  /** Video: how much the console reduced it because this browser's connection is slow; 0: not reduced. */
  step: number;
}

/** A request that was refused or not answered; the message is for the operator, in the page's language. */
export class AskError extends Error {
  /** No answer arrived: the request was not refused, and may have been carried out. */
  readonly noAnswer: boolean;
  /** The refusal's reason, if its owner gave a code. */
  readonly reason: Reason | undefined;

  constructor(text: string, noAnswer: boolean, reason?: Reason) {
    super(reasonText(reason, text));
    this.noAnswer = noAnswer;
    this.reason = reason;
  }
}

/** Return why a request failed, in words. */
export function reasonOf(error: unknown): string {
  if (!(error instanceof Error)) return String(error);
  // Older gateways give only a sentence.
  return error.message.replace(/^Not (sent|run): /, "");
}

type Listener = (sample: Sample) => void;

// The console waits as long for this page. A cut connection or a sleeping machine sends no notice.
const QUIET_MS = 300;
/** Without a message for so long, a request may not arrive. */
const SILENT_MS = 800;
const ANSWER_TIMEOUT_MS = 15_000;
const CHECK_INTERVAL_MS = 200;
const PRESENCE_INTERVAL_MS = 20;
/** A stop without an answer for so long is sent over the page's own connection, too. */
const STOP_AGAIN_MS = 500;
const STOPS_REOPEN_MS = 2000;
/** The console ended this page's session; the reason says why. */
const SIGNED_OUT = 4401;

export const hello = signal<ToPage_Hello | null>(null);
/** Keys of the live liveliness tokens. */
export const presence = signal<ReadonlySet<string>>(new Set());
/** When the connection was lost (ms since the Unix epoch); null: connected; 0: not yet connected. */
export const lostAt = signal<number | null>(0);
const silent = signal(false);
/** False as soon as a request, also a stop request, may not arrive at the mesh. */
export const reachable = computed(() => !silent.value && !lostAt.value && hello.value?.connected !== false);

const listeners = new Map<string, Set<Listener>>();
const newest = new Map<string, Sample>();
/** Presence changes that subscribers have not received yet. */
const changes = new Map<string, boolean>();
const pending = new Map<bigint, PromiseWithResolvers<Uint8Array>>();
let socket: WebSocket | null = null;
/** Nothing precedes a stop on this connection: the console reads it before the page's other requests. */
let stopSocket: WebSocket | null = null;
let lastAsk = 0n;
let retryMs = 250;
/** When the last message arrived [ms], and a function that closes an idle connection. */
let receivedAt = 0;
let lastMessageAt = performance.now();
let checkedAt = lastMessageAt;
let closeConnection: () => void = () => undefined;

/** Connect, and reconnect for ever.
 *
 * @param ready Whether the page may connect now; null: the console does not answer.
 * @param ended Called with the reason when the session has ended. */
export function keepConnected(ready: () => Promise<boolean | null>, ended: (why: string) => void): () => void {
  const reconnect = () => {
    setTimeout(begin, retryMs);
    retryMs = Math.min(retryMs * 2, 2000);
  };
  const begin = () =>
    void ready().then((may) => {
      if (may) connect(reconnect, ended);
      else if (may === null) reconnect();
    });
  begin();
  setInterval(checkSilence, CHECK_INTERVAL_MS);
  return begin;
}

function checkSilence(): void {
  const at = performance.now();
  // After a pause of this page, messages may wait behind this timer.
  const late = at - checkedAt > 2 * CHECK_INTERVAL_MS;
  checkedAt = at;
  if (!late || silent.value) silent.value = at - lastMessageAt > SILENT_MS;
}

/** Return the address of the console's WebSocket. */
export function meshAddress(): string {
  return `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/mesh`;
}

function connect(reconnect: () => void, ended: (why: string) => void): void {
  const opened = new WebSocket(meshAddress());
  opened.binaryType = "arraybuffer";
  let queriedAt = performance.now(); // opening counts as an answer
  receivedAt = 0;
  const received = () => {
    receivedAt = lastMessageAt = performance.now();
    silent.value = false;
  };
  const end = (code: number, reason: string) => {
    clearInterval(checkTimer);
    closeConnection = () => undefined;
    opened.onopen = opened.onmessage = opened.onclose = null;
    socket = null;
    stopSocket?.close();
    if (lostAt.value === null) lostAt.value = Date.now();
    for (const { reject } of pending.values()) reject(new AskError(t("not_connected"), true));
    pending.clear();
    if (code === SIGNED_OUT) {
      hello.value = null;
      ended(reason);
    } else reconnect();
  };
  const checkConnection = () => {
    const at = performance.now();
    if (queriedAt > receivedAt) {
      if (at - queriedAt < ANSWER_TIMEOUT_MS) return;
      closeConnection();
    } else if (at - receivedAt > QUIET_MS) {
      queriedAt = at;
      send({ case: "ask", value: { id: ++lastAsk, key: "" } }); // an invalid request is answered immediately
    }
  };
  const checkTimer = setInterval(checkConnection, CHECK_INTERVAL_MS);
  closeConnection = () => {
    opened.close(); // close() waits for the peer's close frame
    end(0, "");
  };
  opened.onopen = () => {
    received();
    socket = opened;
    openStopSocket(opened);
    retryMs = 250;
    changes.clear();
    presence.value = new Set();
    for (const expression of listeners.keys()) send({ case: "watch", value: { key: expression } });
  };
  opened.onmessage = (event: MessageEvent<ArrayBuffer>) => {
    received();
    receive(new Uint8Array(event.data));
  };
  opened.onclose = ({ code, reason }) => end(code, reason);
}

/** Keep the connection for stops open, for as long as the page's own connection is the same. */
function openStopSocket(own: WebSocket): void {
  if (socket !== own) return;
  stopSocket = new WebSocket(`${meshAddress()}/stop`);
  stopSocket.binaryType = "arraybuffer";
  stopSocket.onmessage = (event: MessageEvent<ArrayBuffer>) => receive(new Uint8Array(event.data));
  stopSocket.onclose = () => setTimeout(openStopSocket, STOPS_REOPEN_MS, own);
}

/** Reconnect if nothing was received since a time of `performance.now`. */
export function reopenIfSilent(since: number): void {
  if (socket && receivedAt < since) closeConnection();
}

/** Receive every publication on a key expression until the returned function is called. */
export function watch(expression: string, listener: Listener): () => void {
  const present = listeners.get(expression);
  if (present) {
    present.add(listener);
    for (const sample of newest.values()) if (matches(expression, sample.key)) listener(sample);
  } else {
    listeners.set(expression, new Set([listener]));
    send({ case: "watch", value: { key: expression } });
  }
  return () => {
    const set = listeners.get(expression);
    set?.delete(listener);
    if (set?.size !== 0) return;
    listeners.delete(expression);
    for (const key of newest.keys()) if (matches(expression, key)) newest.delete(key);
    send({ case: "unwatch", value: { key: expression } });
  };
}

/** Return a request's key in the name of the account or console, or else of this connection. */
export function inOwnName(key: string): string {
  return `${key}/${hello.value?.operator || hello.value?.session || "page"}`;
}

/** Send a request to the mesh.
 *
 * @throws AskError with the reason in words. */
export async function ask<Q extends DescMessage, A extends DescMessage>(
  key: string,
  requestSchema: Q,
  request: MessageInitShape<Q>,
  answerSchema: A,
  timeoutS = 2,
): Promise<MessageShape<A>> {
  const id = ++lastAsk;
  const payload = toBinary(requestSchema, create(requestSchema, request));
  const message = { case: "ask", value: { id, key, payload, timeoutS } } as const;
  if (key.endsWith("/stop") && send(message, stopSocket)) {
    setTimeout(() => pending.has(id) && send(message), STOP_AGAIN_MS);
  } else if (!send(message)) throw new AskError(t("not_connected"), true);
  const answer = Promise.withResolvers<Uint8Array>();
  pending.set(id, answer);
  // The server reports a timeout itself; this one is for a server that no longer answers.
  const timer = setTimeout(
    () => answer.reject(new AskError(t("timed_out", { seconds: timeoutS }), true)),
    timeoutS * 1000 + 1000,
  );
  try {
    return fromBinary(answerSchema, await answer.promise);
  } finally {
    clearTimeout(timer);
    pending.delete(id);
  }
}

/** Return an answer; if none arrives, throw an error with a text of the request's own. */
export async function withNoAnswerText<Answer>(answer: Promise<Answer>, noAnswer: string): Promise<Answer> {
  try {
    return await answer;
  } catch (error) {
    throw error instanceof AskError && error.noAnswer ? new Error(noAnswer) : error;
  }
}

/** Return a request as a message, for another connection than this page's. */
export function askMessage<Q extends DescMessage>(
  key: string,
  schema: Q,
  request: MessageInitShape<Q>,
): Uint8Array<ArrayBuffer> {
  const payload = toBinary(schema, create(schema, request));
  return toBinary(
    FromPageSchema,
    create(FromPageSchema, { message: { case: "ask", value: { id: 1n, key, payload } } }),
  );
}

function send(message: NonNullable<MessageInitShape<typeof FromPageSchema>["message"]>, over = socket): boolean {
  if (over?.readyState !== WebSocket.OPEN) return false;
  over.send(toBinary(FromPageSchema, create(FromPageSchema, { message })));
  return true;
}

/** Take one message of the console. */
export function receive(bytes: Uint8Array): void {
  const { message } = fromBinary(ToPageSchema, bytes);
  switch (message.case) {
    case "hello":
      if (message.value.presenceKnown) applyPresenceChanges();
      hello.value = message.value;
      lostAt.value = null;
      break;
    case "presence": {
      if (changes.size === 0) setTimeout(applyPresenceChanges, PRESENCE_INTERVAL_MS);
      changes.set(message.value.key, message.value.alive);
      break;
    }
    case "answer": {
      const waiting = pending.get(message.value.id);
      if (message.value.ok) waiting?.resolve(message.value.payload);
      else waiting?.reject(new AskError(message.value.error, message.value.noAnswer, message.value.refusal));
      break;
    }
    case "sample": {
      const { key, attachment, payload, live, ageS, step } = message.value;
      const header = readHeader(attachment);
      const arrived = performance.now();
      const before = newest.get(key);
      const repeated = before?.publisher === header.publisher && before.sequence === header.sequence;
      let newAt = null;
      // A repeated sample, for example after reconnecting, keeps its age.
      if (repeated && before.newAt !== null) newAt = before.newAt;
      else if (live) {
        // The age that the console's server knows, or the delay on the whole path to here.
        newAt =
          ageClock() - Math.max((ageS ?? 0) * 1000, sampleDelay(key, header.publisher, header.sourceTime, arrived));
      }
      const sample = { key, payload, ...header, live, arrived, newAt, step };
      newest.set(key, sample);
      for (const [expression, set] of listeners) {
        if (matches(expression, key)) for (const listener of [...set]) listener(sample);
      }
      break;
    }
  }
}

/** Add presence changes in batches: a new page receives every process of the mesh. */
function applyPresenceChanges(): void {
  const keys = new Set(presence.value);
  for (const [key, alive] of changes) {
    if (alive) keys.add(key);
    else keys.delete(key);
  }
  changes.clear();
  presence.value = keys;
}

function readHeader(attachment: Uint8Array) {
  if (attachment.byteLength !== 24) return { publisher: 0n, sequence: 0n, sourceTime: 0 };
  const view = new DataView(attachment.buffer, attachment.byteOffset, 24);
  return {
    publisher: view.getBigUint64(0, true),
    sequence: view.getBigUint64(8, true),
    sourceTime: Number(view.getBigInt64(16, true) / 1000n) / 1000,
  };
}

/** Return whether a key expression (`*` matches one chunk) covers a key. */
export function matches(expression: string, key: string): boolean {
  if (expression === key) return true;
  if (!expression.includes("*")) return false;
  const pattern = expression.split("/");
  const chunks = key.split("/");
  return pattern.length === chunks.length && pattern.every((part, i) => part === "*" || part === chunks[i]);
}
