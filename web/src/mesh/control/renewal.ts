// Renewal of the lease by a worker, while this page's own thread is busy, for example with drawing.
//
// The worker has a separate connection. It renews only while this thread has reported within the last 2 s that
// it runs and that the tab is visible: a page that is blocked longer, hidden or closed loses control.

import { LeaseRequest_Action as Action, LeaseRequestSchema } from "../../gen/robomesh_pb";
import { askMessage, hello, meshAddress } from "../console/connection";
import { heldLease } from "./control";

/** What the worker sends, and where. */
export interface Renewal {
  address: string;
  message: Uint8Array<ArrayBuffer>;
}

const ALIVE_INTERVAL_MS = 250;
const TTL_S = 2;

export function renewWhileBusy(): void {
  let worker: Worker | null = null;
  let lease = "";
  heldLease.subscribe((mine) => {
    if ((mine?.lease ?? "") === lease) return;
    worker?.terminate();
    worker = null;
    lease = mine?.lease ?? "";
    if (!mine) return;
    const request = { action: Action.RENEW, lease, ttlS: TTL_S, session: hello.peek()?.session ?? "" };
    const message = askMessage(`${mine.robotKey}/lease/request/${mine.operator}`, LeaseRequestSchema, request);
    worker = new Worker(new URL("./renewal-worker.ts", import.meta.url), { type: "module" });
    worker.postMessage({ address: meshAddress(), message } satisfies Renewal);
  });
  setInterval(() => {
    if (!document.hidden) worker?.postMessage(performance.timeOrigin + performance.now());
  }, ALIVE_INTERVAL_MS);
}
