// The outcome of an action, in one line.

import { t } from "../../i18n/texts";
import type { Notice } from "../../mesh/control/control";
import { Warning } from "../marks/warning";

/** Return the role and the name of an outcome: a refusal interrupts a screen reader, all else waits. */
export const outcomeRole = (refused: boolean) =>
  ({ role: refused ? "alert" : "status", "aria-label": t("outcome") }) as const;

/** The outcome of an action, next to the action; it keeps its height when empty. */
export function NoticeLine({ notice, idle }: { notice: Notice | null; idle?: string }) {
  const bad = notice?.kind === "refused" || notice?.kind === "lost";
  return (
    <p class={`notice ${notice?.kind ?? "idle"}`} {...outcomeRole(bad)}>
      {bad && <span class="shape warning" aria-hidden="true" />}
      {notice?.text ?? idle ?? "\u00a0"}
      {notice?.warning && (
        <Warning as="span" class="notice-warning" text={t("warning_of_check", { text: notice.warning })} />
      )}
    </p>
  );
}
