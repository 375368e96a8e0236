// Renews a lease while its page's own thread is busy; see renewal.ts.

import type { Renewal } from "./renewal";

const CHECK_INTERVAL_MS = 300;
/** Longer than the interval of the page's own renewals. */
const BUSY_MS = 900;
/** After this, the operator cannot act on this page. */
const BLOCKED_MS = 2000;

let renewal: Renewal | null = null;
let socket: WebSocket | null = null;
let aliveAt = 0;

addEventListener("message", ({ data }: MessageEvent<Renewal | number>) => {
  if (typeof data === "number") {
    aliveAt = data;
    return;
  }
  renewal = data;
  socket = new WebSocket(data.address);
});

setInterval(() => {
  const silentMs = performance.timeOrigin + performance.now() - aliveAt;
  if (!renewal || silentMs < BUSY_MS || silentMs > BLOCKED_MS) return;
  if (socket?.readyState === WebSocket.OPEN) socket.send(renewal.message);
}, CHECK_INTERVAL_MS);
