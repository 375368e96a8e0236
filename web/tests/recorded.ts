// What the console of a real site sent a page while an operator worked (tests/make_page_messages.py).

import { readFileSync } from "node:fs";
import { fromBinary } from "@bufbuild/protobuf";
import { vi } from "vitest";
import type { ToPage } from "../src/gen/robomesh_pb";
import { ToPageSchema } from "../src/gen/robomesh_pb";
import { deliver } from "./console";

/** The key of the site's robot, a simulated Pt600. */
export const ARM = "robomesh/test/arm";

/** Each recorded message with its time since the first [s]. */
export const messages: { s: number; bytes: Uint8Array; message: ToPage["message"] }[] = [];
const file = readFileSync("tests/messages/site.bin");
for (let at = 0; at < file.length; ) {
  const bytes = file.subarray(at + 12, at + 12 + file.readUInt32LE(at + 8));
  messages.push({ s: file.readDoubleLE(at), bytes, message: fromBinary(ToPageSchema, bytes).message });
  at += 12 + bytes.length;
}

/** The payloads of a key's publications, the oldest first. */
export const payloads = (key: string): Uint8Array[] =>
  messages.flatMap(({ message }) =>
    message.case === "sample" && message.value.key === key ? [message.value.payload] : [],
  );

/** Deliver the site's messages at their times, until the next one matches or all are delivered. */
export async function replay(until: (message: ToPage["message"]) => boolean = () => false): Promise<void> {
  let now = 0;
  for (const { s, bytes, message } of messages) {
    if (until(message)) return;
    await vi.advanceTimersByTimeAsync(1000 * (s - now));
    now = s;
    deliver(bytes);
  }
}
