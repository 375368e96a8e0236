// What happened to the robot, who asked what of it, newest first, and how its link does.

import { useState } from "preact/hooks";
import { count, stampFull, stampTime } from "./format";
import { entryText } from "./events/entry-text";
import { AuditEntry_Outcome as Outcome, Event_Severity as Severity } from "./gen/robomesh_pb";
import type { AuditEntry, ControllerState, Event } from "./gen/robomesh_pb";
import { eventInChinese } from "./events/event-words";
import { LinkFacts } from "./link-facts";
import { Choice, Panel } from "./parts";
import { t } from "./texts";
import type { TextName } from "./texts";
import { useAudit } from "./topics";
import type { Latest } from "./topics";

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

const SHOWN = ["events", "requests", "link"] as const;

export function EventsPanel(props: {
  robotKey: string;
  events: readonly Event[];
  controller: Latest<ControllerState> | undefined;
}) {
  const { robotKey, events } = props;
  const [shown, setShown] = useState<(typeof SHOWN)[number]>("events");
  const audit = useAudit(robotKey);
  const empty = (shown === "events" ? events : audit).length === 0;
  return (
    <Panel
      name="events"
      title={t(shown)}
      end={
        <Choice
          label={t("events")}
          values={SHOWN}
          chosen={shown}
          text={(each) => t(each)}
          choose={setShown}
        />
      }
    >
      {shown === "link" ? (
        <LinkFacts controller={props.controller} />
      ) : (
        <ol class="event-list" tabIndex={0} aria-label={t(shown)}>
          {empty && <li class="dim">{t("no_events")}</li>}
          {shown === "events" ? events.map(EventLine) : audit.map(AuditLine)}
        </ol>
      )}
    </Panel>
  );
}

/** A word that asks to be looked at; what is as it should be has no shape. */
export function Mark({ word, level }: { word: TextName; level: string }) {
  return (
    <span class={`mark state ${level}`}>
      {level !== "normal" && <span class={`shape ${level}`} aria-hidden="true" />}
      {t(word)}
    </span>
  );
}

function EventLine(event: Event) {
  const [word, level] = SEVERITIES[event.severity] ?? ["severity_info", "normal"];
  const text = eventText(event);
  return (
    <li title={`${stampFull(event.timestamp)} · ${event.source} · ${event.code}`}>
      <time>{stampTime(event.timestamp)}</time>
      <span class="event-text">
        {level !== "normal" && <Mark word={word} level={level} />}
        <span lang={text === event.text ? "en" : undefined}>{text}</span>
      </span>
    </li>
  );
}

/** The page's own words for what people meet most; the event's for the rest. */
export function eventText(event: Event): string {
  const { code, values } = event;
  const by = values["by"] ?? "";
  const reason = values["reason"];
  switch (code) {
    case "stop.latched": {
      const said = t(values["sent"] === "True" ? "event_stop" : "event_stop_unsent", { by });
      return reason && reason !== "console" ? `${said} ${reason}` : said;
    }
    case "stop.sent":
      return t("event_stop_sent");
    case "stop.reset":
      return t("event_stop_reset");
    default:
      return eventInChinese(event) ?? event.text;
  }
}

function AuditLine(entry: AuditEntry) {
  const text = entryText(entry);
  const [word, level] = OUTCOMES[entry.outcome] ?? ["state_unknown", "normal"];
  return (
    <li title={`${stampFull(entry.timestamp)} · ${entry.source}`}>
      <time>{stampTime(entry.timestamp)}</time>
      <span class="event-text">
        <Mark word={word} level={level} />
        <strong>{entry.operator || entry.source}</strong> {entry.request}
        {entry.repeatedCount > 0n && (
          <strong class="repeated" title={t("repeated", { count: count(entry.repeatedCount) })}>
            {` × ${count(entry.repeatedCount)}`}
          </strong>
        )}
        {text && <span lang={text === entry.text ? "en" : undefined}>{`: ${text}`}</span>}
      </span>
    </li>
  );
}
