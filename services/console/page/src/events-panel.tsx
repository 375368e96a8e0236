// What happened to the robot, and who asked what of it, newest first.

import { useState } from "preact/hooks";
import { stampFull, stampTime } from "./format";
import { AuditEntry_Outcome as Outcome, Event_Severity as Severity } from "./gen/robomesh_pb";
import type { AuditEntry, Event } from "./gen/robomesh_pb";
import { Choice, Panel } from "./parts";
import { t } from "./texts";
import type { TextName } from "./texts";
import { useAudit, useEvents } from "./topics";

const SEVERITIES: Partial<Record<Severity, [TextName, string]>> = {
  [Severity.DEBUG]: ["severity_debug", "normal"],
  [Severity.INFO]: ["severity_info", "normal"],
  [Severity.WARNING]: ["severity_warning", "warning"],
  [Severity.ERROR]: ["severity_error", "alarm"],
  [Severity.CRITICAL]: ["severity_critical", "alarm"],
};
const OUTCOMES: Partial<Record<Outcome, [TextName, string]>> = {
  [Outcome.ACCEPTED]: ["outcome_accepted", "normal"],
  [Outcome.REFUSED]: ["outcome_refused", "warning"],
  [Outcome.FAILED]: ["outcome_failed", "alarm"],
};

export function EventsPanel({ robotKey }: { robotKey: string }) {
  const [shown, setShown] = useState<"events" | "requests">("events");
  const events = useEvents(`${robotKey}/events`);
  const audit = useAudit(`${robotKey}/audit`);
  const list = shown === "events" ? events : audit;
  return (
    <Panel
      name="events"
      title={t(shown)}
      end={
        <Choice
          label={t("events")}
          values={["events", "requests"] as const}
          chosen={shown}
          text={(each) => t(each)}
          choose={setShown}
        />
      }
    >
      <ol class="event-list" tabIndex={0} aria-label={t(shown)}>
        {list.length === 0 && <li class="dim">{t("no_events")}</li>}
        {shown === "events" ? events.map(EventLine) : audit.map(AuditLine)}
      </ol>
    </Panel>
  );
}

/** A word that asks to be looked at; what is as it should be has no shape. */
function Mark({ word, level }: { word: TextName; level: string }) {
  return (
    <span class={`mark state ${level}`}>
      {level !== "normal" && <span class={`shape ${level}`} aria-hidden="true" />}
      {t(word)}
    </span>
  );
}

function EventLine(event: Event) {
  const [word, level] = SEVERITIES[event.severity] ?? ["severity_info", "normal"];
  return (
    <li title={`${stampFull(event.timestamp)} · ${event.source} · ${event.code}`}>
      <time>{stampTime(event.timestamp)}</time>
      <span class="event-text">
        {level !== "normal" && <Mark word={word} level={level} />}
        {event.text}
      </span>
    </li>
  );
}

function AuditLine(entry: AuditEntry) {
  const [word, level] = OUTCOMES[entry.outcome] ?? ["state_unknown", "normal"];
  return (
    <li title={`${stampFull(entry.timestamp)} · ${entry.source}`}>
      <time>{stampTime(entry.timestamp)}</time>
      <span class="event-text">
        <Mark word={word} level={level} />
        <strong>{entry.operator || entry.source}</strong> {entry.request}
        {entry.text && `: ${entry.text}`}
        {entry.repeatedCount > 0n && ` (${t("repeated", { count: String(entry.repeatedCount) })})`}
      </span>
    </li>
  );
}
