// The stop request: it needs no control and waits for nothing.

import { signal } from "@preact/signals";
import { StopAnswerSchema, StopRequestSchema } from "../gen/robomesh_pb";
import { reasonText } from "../i18n/reasons";
import { t } from "../i18n/texts";
import { AskError, ask, reopenIfSilent } from "./connection";
import type { Notice } from "./control";
import { operator, reasonOf } from "./control";

const NOTICE_MS = 15_000; // how long the notice of a successful stop is shown

export const stopNotice = signal<Notice | null>(null);

/** Request a stop of each robot separately, so that a robot without an answer delays no other. */
export async function stop(robotKeys: readonly string[]): Promise<void> {
  const name = (key: string) => key.split("/").slice(1).join("/");
  stopNotice.value = { kind: "busy", text: t("stop_sending", { robot: robotKeys.map(name).join(", ") }) };
  const by = operator.value.trim();
  const requestedAt = performance.now();
  const outcomes = await Promise.all(
    robotKeys.map(async (key): Promise<Notice> => {
      const robot = name(key);
      try {
        const answer = await ask(`${key}/stop`, StopRequestSchema, { reason: "the page", by }, StopAnswerSchema);
        return answer.sent
          ? { kind: "done", text: t("stop_done", { robot, id: String(answer.stopId) }) }
          : { kind: "refused", text: t("stop_latched", { robot, text: reasonText(answer.reason, answer.text) }) };
      } catch (error) {
        // The next request must not use the same dead connection.
        if (error instanceof AskError && error.noAnswer) reopenIfSilent(requestedAt);
        return { kind: "refused", text: t("stop_failed", { robot, text: reasonOf(error) }) };
      }
    }),
  );
  const failed = outcomes.filter((outcome) => outcome.kind === "refused");
  const notice: Notice = {
    kind: failed.length ? "refused" : "done",
    text: (failed.length ? failed : outcomes).map((outcome) => outcome.text).join(" "),
  };
  stopNotice.value = notice;
  if (notice.kind === "done") setTimeout(() => stopNotice.value === notice && (stopNotice.value = null), NOTICE_MS);
}
