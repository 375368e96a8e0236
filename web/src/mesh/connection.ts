// The page's one WebSocket to the console's server: keys watched, requests asked.

import type { DescMessage, MessageInitShape, MessageShape } from "@bufbuild/protobuf";
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { signal } from "@preact/signals";
import type { Reason, ToPage_Hello } from "../gen/robomesh_pb";
import { FromPageSchema, ToPageSchema } from "../gen/robomesh_pb";
import { t } from "../i18n/texts";
import { ageClock } from "./age-clock";
import { lateness } from "./delay";

/** A publication as it came. Times are on this page's monotonic clock, in ms; ages on that of `ageClock`. */
export interface Sample {
  key: string;
  payload: Uint8Array;
  publisher: bigint;
  sequence: bigint;
  /** Publisher's source time in ms since the Unix epoch. */
  sourceTime: number;
  live: boolean;
  arrived: number;
  /** When it was new, on the clock of ages; null: its age is not known. */
  newAt: number | null;
  /** Of video: how much less than was asked for, because this browser's line takes no more; 0: as asked for. */
  step: number;
}

/** A request that was refused or not answered; the text is for people. */
export class AskError extends Error {
  /** Nobody answered: it was not refused, and may even have been done. */
  readonly noAnswer: boolean;
  /** Why it was refused, where its owner says it by a code. */
  readonly reason: Reason | undefined;

  constructor(text: string, noAnswer: boolean, reason?: Reason) {
    super(text);
    this.noAnswer = noAnswer;
    this.reason = reason;
  }
}

type Listener = (sample: Sample) => void;

// As long as the console waits for this page. A line that is cut, or a machine that slept, tells nobody.
const QUIET_MS = 5000;
const ANSWERED_WITHIN_MS = 15_000;
const LOOK_EACH_MS = 1000;
const PRESENCE_EACH_MS = 20;
/** The console ended the session that this page belongs to; the reason says why. */
const SIGNED_OUT = 4401;

export const hello = signal<ToPage_Hello | null>(null);
/** Keys of the liveliness tokens that are alive. */
export const presence = signal<ReadonlySet<string>>(new Set());
/** When the connection was lost (ms since the Unix epoch); null while there is one; 0 before the first. */
export const lostAt = signal<number | null>(0);

const listeners = new Map<string, Set<Listener>>();
const newest = new Map<string, Sample>();
/** Of presence, not told yet. */
const changes = new Map<string, boolean>();
const asked = new Map<bigint, { resolve: (payload: Uint8Array) => void; reject: (error: AskError) => void }>();
let socket: WebSocket | null = null;
let lastAsk = 0n;
let retryMs = 250;
/** When anything came [ms], and what ends a connection through which nothing does. */
let heardAt = 0;
let giveUp: () => void = () => undefined;

/** Connects, and keeps connecting.
 *
 * @param ready Whether whoever is here may connect now; null: the console does not answer.
 * @param ended Told that the session is over, and why. */
export function keepConnected(ready: () => Promise<boolean | null>, ended: (why: string) => void): () => void {
  const again = () => {
    setTimeout(begin, retryMs);
    retryMs = Math.min(retryMs * 2, 2000);
  };
  const begin = () =>
    void ready().then((may) => {
      if (may) connect(again, ended);
      else if (may === null) again();
    });
  begin();
  return begin;
}

function connect(again: () => void, ended: (why: string) => void): void {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const opened = new WebSocket(`${scheme}://${location.host}/mesh`);
  opened.binaryType = "arraybuffer";
  let askedAt = performance.now(); // to open is to answer
  heardAt = 0;
  const heard = () => (heardAt = performance.now());
  const end = (code: number, reason: string) => {
    clearInterval(looking);
    giveUp = () => undefined;
    opened.onopen = opened.onmessage = opened.onclose = null;
    socket = null;
    if (lostAt.value === null) lostAt.value = Date.now();
    for (const { reject } of asked.values()) reject(new AskError(t("not_connected"), true));
    asked.clear();
    if (code === SIGNED_OUT) {
      hello.value = null;
      ended(reason);
    } else again();
  };
  const look = () => {
    const at = performance.now();
    if (askedAt > heardAt) {
      if (at - askedAt < ANSWERED_WITHIN_MS) return;
      giveUp();
    } else if (at - heardAt > QUIET_MS) {
      askedAt = at;
      send({ case: "ask", value: { id: ++lastAsk, key: "" } }); // no such request: it is answered at once
    }
  };
  const looking = setInterval(look, LOOK_EACH_MS);
  giveUp = () => {
    opened.close(); // which would wait for the other end to say so too
    end(0, "");
  };
  opened.onopen = () => {
    heard();
    socket = opened;
    retryMs = 250;
    changes.clear();
    presence.value = new Set();
    for (const expression of listeners.keys()) send({ case: "watch", value: { key: expression } });
  };
  opened.onmessage = (event: MessageEvent<ArrayBuffer>) => {
    heard();
    receive(new Uint8Array(event.data));
  };
  opened.onclose = ({ code, reason }) => end(code, reason);
}

/** Opens the connection anew where nothing has come through it since a time of `performance.now`. */
export function reopenIfSilent(since: number): void {
  if (socket && heardAt < since) giveUp();
}

/** Hears every publication on a key expression until the returned function is called. */
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

/** A request's key in this page's name: its account's or console's, else its connection's own. */
export function inOwnName(key: string): string {
  return `${key}/${hello.value?.operator || hello.value?.session || "page"}`;
}

/** Asks a request of the mesh.
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
  const answer = new Promise<Uint8Array>((resolve, reject) => {
    if (!send({ case: "ask", value: { id, key, payload, timeoutS } })) {
      reject(new AskError(t("not_connected"), true));
      return;
    }
    // The server tells a time-out itself; this is for a server that says nothing any more.
    const timer = setTimeout(
      () => settle(id)?.reject(new AskError(t("timed_out", { seconds: timeoutS }), true)),
      timeoutS * 1000 + 1000,
    );
    const done = () => clearTimeout(timer);
    asked.set(id, {
      resolve: (bytes) => (done(), resolve(bytes)),
      reject: (error) => (done(), reject(error)),
    });
  });
  return fromBinary(answerSchema, await answer);
}

function settle(id: bigint) {
  const waiting = asked.get(id);
  asked.delete(id);
  return waiting;
}

function send(message: NonNullable<MessageInitShape<typeof FromPageSchema>["message"]>): boolean {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(toBinary(FromPageSchema, create(FromPageSchema, { message })));
  return true;
}

function receive(bytes: Uint8Array): void {
  const { message } = fromBinary(ToPageSchema, bytes);
  switch (message.case) {
    case "hello":
      hello.value = message.value;
      lostAt.value = null;
      break;
    case "presence": {
      if (changes.size === 0) setTimeout(settlePresence, PRESENCE_EACH_MS);
      changes.set(message.value.key, message.value.alive);
      break;
    }
    case "answer": {
      const waiting = settle(message.value.id);
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
      // A repeat (after a new connection, say) is as old as it was.
      if (repeated && before.newAt !== null) newAt = before.newAt;
      else if (live) {
        // What the console's server knows of its age, or what it was late on the whole way to here.
        newAt = ageClock() - Math.max((ageS ?? 0) * 1000, lateness(key, header.publisher, header.sourceTime, arrived));
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

/** A new page is told of every process of the mesh: one by one, thousands would be copied thousands of times. */
function settlePresence(): void {
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

/** Whether a key expression (`*` stands for one chunk) covers a key. */
export function matches(expression: string, key: string): boolean {
  if (expression === key) return true;
  if (!expression.includes("*")) return false;
  const pattern = expression.split("/");
  const chunks = key.split("/");
  return pattern.length === chunks.length && pattern.every((part, i) => part === "*" || part === chunks[i]);
}
