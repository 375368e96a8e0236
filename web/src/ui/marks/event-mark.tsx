// Mark of an event's severity or an audit entry's outcome: a word, with a shape if it needs attention.

import { AuditEntry_Outcome as Outcome, Event_Severity as Severity } from "../../gen/robomesh_pb";
import type { TextName } from "../../i18n/texts";
import { t } from "../../i18n/texts";

type Words<Value extends number> = Partial<Record<Value, [TextName, string]>>;

const SEVERITIES: Words<Severity> = {
  [Severity.SEVERITY_UNSPECIFIED]: ["severity_info", "normal"],
  [Severity.DEBUG]: ["severity_debug", "normal"],
  [Severity.INFO]: ["severity_info", "normal"],
  [Severity.WARNING]: ["severity_warning", "warning"],
  [Severity.ERROR]: ["severity_error", "alarm"],
  [Severity.CRITICAL]: ["severity_critical", "alarm"],
};
const OUTCOMES: Words<Outcome> = {
  [Outcome.OUTCOME_UNSPECIFIED]: ["state_unknown", "normal"],
  [Outcome.ACCEPTED]: ["outcome_accepted", "normal"],
  [Outcome.REFUSED]: ["outcome_refused", "warning"],
  [Outcome.FAILED]: ["outcome_failed", "alarm"],
};

/** A mark's text and level of attention. */
export interface MarkOf {
  text: string;
  level: string;
}

export const severityMark = (severity: Severity): MarkOf => markOf(SEVERITIES, severity);
export const outcomeMark = (outcome: Outcome): MarkOf => markOf(OUTCOMES, outcome);

/** The value of a newer program has no word: its number needs attention. */
function markOf<Value extends number>(words: Words<Value>, value: Value): MarkOf {
  const [word, level] = words[value] ?? [undefined, "warning"];
  return { text: word ? t(word) : String(value), level };
}

/** A text that needs attention has a shape; a normal one has none. */
export function Mark({ text, level }: MarkOf) {
  return (
    <span class={`mark state ${level}`}>
      {level !== "normal" && <span class={`shape ${level}`} aria-hidden="true" />}
      {text}
    </span>
  );
}
