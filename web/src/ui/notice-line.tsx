// The outcome of an action, in one line.

import { t } from "../i18n/texts";
import type { Notice } from "../mesh/control";

/** The outcome of an action, next to the action; it keeps its height when empty. */
export function NoticeLine({ notice, idle }: { notice: Notice | null; idle?: string }) {
  const bad = notice?.kind === "refused" || notice?.kind === "lost";
  const live = { role: bad ? "alert" : "status", "aria-label": t("outcome") } as const;
  return (
    <p class={`notice ${notice?.kind ?? "idle"}`} {...live}>
      {bad && <span class="shape warning" aria-hidden="true" />}
      {notice?.text ?? idle ?? "\u00a0"}
      {notice?.warning && (
        <span class="notice-warning">
          <span class="shape warning" aria-hidden="true" />
          {t("warning_of_check", { text: notice.warning })}
        </span>
      )}
    </p>
  );
}
