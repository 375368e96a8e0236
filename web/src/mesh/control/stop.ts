// The stop request: it needs no control and waits for nothing.

import { effect, signal } from "@preact/signals";
import { StopAnswerSchema, StopRequestSchema } from "../../gen/robomesh_pb";
import { whenText } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import { t } from "../../i18n/texts";
import { AskError, ask, reachable, reasonOf, reopenIfSilent } from "../console/connection";
import type { Notice } from "./control";
import { operator } from "./control";
import { pageReport } from "./display-freshness";

const NOTICE_MS = 15_000; // how long the notice of a successful stop is shown
const SENT_LATER_MS = 10_000; // a younger press is sent when the connection returns

export const stopNotice = signal<Notice | null>(null);
/** Robots of a press that had no answer, and when it was made [ms since the Unix epoch]. */
export const unsentStop = signal<{ robotKeys: readonly string[]; at: number } | null>(null);

type Outcome = { kind: "done" | "never" | "refused"; robot: string; text: string };

/** Request a stop of each robot separately, so that a robot without an answer delays no other. */
export async function stop(robotKeys: readonly string[], pressedAt = Date.now()): Promise<void> {
  const name = (key: string) => key.split("/").slice(1).join("/");
  stopNotice.value = { kind: "busy", text: t("stop_sending", { robot: robotKeys.map(name).join(", ") }) };
  unsentStop.value = null;
  const by = operator.value.trim();
  const requestedAt = performance.now();
  const unsent: string[] = [];
  const outcomes = await Promise.all(
    robotKeys.map(async (key): Promise<Outcome> => {
      const robot = name(key);
      try {
        const page = pageReport(key);
        const request = { reason: "the page", by, ...(page && { page }) };
        const answer = await ask(`${key}/stop`, StopRequestSchema, request, StopAnswerSchema);
        if (answer.sent) return { kind: "done", robot, text: t("stop_done", { robot, id: String(answer.stopId) }) };
        const text = reasonText(answer.reason, answer.text);
        // Without a number nothing is latched: the robot is only watched.
        return answer.stopId
          ? { kind: "refused", robot, text: t("stop_latched", { robot, text }) }
          : { kind: "never", robot, text };
      } catch (error) {
        if (error instanceof AskError && error.noAnswer) {
          unsent.push(key);
          // The next request must not use the same dead connection.
          reopenIfSilent(requestedAt);
        }
        return { kind: "refused", robot, text: t("stop_failed", { robot, text: reasonOf(error) }) };
      }
    }),
  );
  const of = (kind: Outcome["kind"]) => outcomes.filter((outcome) => outcome.kind === kind);
  const never = of("never").map((outcome) => outcome.robot);
  const lines = [
    ...of("refused").map((outcome) => outcome.text),
    ...(never.length ? [t("stop_never", { robot: never.join(", ") })] : []),
    ...of("done").map((outcome) => outcome.text),
  ];
  const text = lines.join("\n");
  const notice: Notice =
    of("done").length === outcomes.length
      ? { kind: "done", text }
      : { kind: "refused", text: `${whenText(pressedAt)} ${text}` };
  stopNotice.value = notice;
  if (unsent.length) unsentStop.value = { robotKeys: unsent, at: pressedAt };
  if (notice.kind === "done") setTimeout(() => stopNotice.value === notice && (stopNotice.value = null), NOTICE_MS);
}

/** Send the last press without an answer again. */
export function stopAgain(): void {
  if (unsentStop.value) void stop(unsentStop.value.robotKeys);
}

export function dismissStop(): void {
  stopNotice.value = unsentStop.value = null;
}

// When the connection returns, a press of the last seconds is still meant; an older one is offered.
let wasLost = false;
effect(() => {
  const press = unsentStop.value;
  if (!reachable.value) wasLost = true;
  else if (wasLost) {
    wasLost = false;
    if (press && Date.now() - press.at < SENT_LATER_MS) void stop(press.robotKeys, press.at);
  }
});
