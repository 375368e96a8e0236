// Mark of an event's severity or an audit entry's outcome: a word, with a shape if it needs attention.

import { AuditEntry_Outcome as Outcome, Event_Severity as Severity } from "../gen/robomesh_pb";
import type { TextName } from "../i18n/texts";
import { t } from "../i18n/texts";

export const SEVERITIES: Partial<Record<Severity, [TextName, string]>> = {
  [Severity.DEBUG]: ["severity_debug", "normal"],
  [Severity.INFO]: ["severity_info", "normal"],
  [Severity.WARNING]: ["severity_warning", "warning"],
  [Severity.ERROR]: ["severity_error", "alarm"],
  [Severity.CRITICAL]: ["severity_critical", "alarm"],
};
export const OUTCOMES: Partial<Record<Outcome, [TextName, string]>> = {
  [Outcome.ACCEPTED]: ["outcome_accepted", "normal"],
  [Outcome.REFUSED]: ["outcome_refused", "warning"],
  [Outcome.FAILED]: ["outcome_failed", "alarm"],
};

/** A word that needs attention has a shape; a normal one has none. */
export function Mark({ word, level }: { word: TextName; level: string }) {
  return (
    <span class={`mark state ${level}`}>
      {level !== "normal" && <span class={`shape ${level}`} aria-hidden="true" />}
      {t(word)}
    </span>
  );
}
