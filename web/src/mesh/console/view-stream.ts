// The stream of a view's page: what the console shows of one view. It takes no request.

import { signal } from "@preact/signals";
import { lostAt, receive } from "./connection";
import { readRefusal } from "./refusal";

// The console sends a message each second.
const QUIET_MS = 5000;
const RETRY_MS = 2000;
// Permission or the view is missing; without an end, wrong tokens would be counted.
const REFUSED_RETRY_MS = 30_000;
const LENGTH_BYTES = 4;

/** Why the console refuses the stream, in the page's language; empty: it does not. */
export const refused = signal("");

/** Read the stream while the page is visible, and reconnect for ever. */
export function followView(address: string): void {
  let hiding: AbortController | null = null;
  const update = () => {
    if (document.visibilityState === "visible") {
      if (hiding) return;
      hiding = new AbortController();
      void readForEver(address, hiding.signal);
    } else {
      hiding?.abort();
      hiding = null;
    }
  };
  document.addEventListener("visibilitychange", update);
  update();
}

async function readForEver(address: string, hidden: AbortSignal): Promise<void> {
  while (!hidden.aborted) {
    // A cut connection is like an ended one.
    const retryMs = await read(address, hidden).catch(() => RETRY_MS);
    if (hidden.aborted) return;
    lostAt.value ||= Date.now();
    await new Promise((resolve) => setTimeout(resolve, retryMs));
  }
}

/** Read the stream until it ends; return after how long to try again [ms]. */
async function read(address: string, hidden: AbortSignal): Promise<number> {
  const silent = new AbortController();
  let timer = setTimeout(() => silent.abort(), QUIET_MS);
  try {
    const answer = await fetch(address, { cache: "no-store", signal: AbortSignal.any([hidden, silent.signal]) });
    if (!answer.ok || !answer.body) {
      const { message, status } = await readRefusal(answer);
      refused.value = message;
      return status < 500 ? REFUSED_RETRY_MS : RETRY_MS;
    }
    refused.value = "";
    const reader = answer.body.getReader();
    let rest: Uint8Array<ArrayBuffer> = new Uint8Array();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return RETRY_MS;
      clearTimeout(timer);
      timer = setTimeout(() => silent.abort(), QUIET_MS);
      rest = receiveWhole(joined(rest, value));
    }
  } finally {
    clearTimeout(timer);
  }
}

/** Take every whole message; return the rest. */
function receiveWhole(bytes: Uint8Array<ArrayBuffer>): Uint8Array<ArrayBuffer> {
  let at = 0;
  while (bytes.length - at >= LENGTH_BYTES) {
    const begin = at + LENGTH_BYTES;
    const end = begin + new DataView(bytes.buffer, bytes.byteOffset + at).getUint32(0);
    if (end > bytes.length) break;
    receive(bytes.subarray(begin, end));
    at = end;
  }
  return bytes.subarray(at);
}

function joined(first: Uint8Array, second: Uint8Array): Uint8Array<ArrayBuffer> {
  const whole = new Uint8Array(first.length + second.length);
  whole.set(first);
  whole.set(second, first.length);
  return whole;
}
