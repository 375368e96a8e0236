// Events of the robot, audited requests, newest first, its signals, and the state of its link.

import { useState } from "preact/hooks";
import type { AuditEntry, ControllerState, Description, Description_Joint, Event } from "../../../gen/robomesh_pb";
import { SignalsSchema } from "../../../gen/robomesh_pb";
import { entrySentence } from "../../../i18n/audit-text";
import { eventText } from "../../../i18n/event-text";
import { count, stampFull, stampTime } from "../../../i18n/format";
import { signalsText as sg, t } from "../../../i18n/texts";
import { WRITTEN, withdrawnIds } from "../../../mesh/services/notes";
import { useMotionTimes } from "../../../mesh/state/motion-times";
import type { Latest } from "../../../mesh/state/topics";
import { useAudit, useTopic } from "../../../mesh/state/topics";
import { Withdrawable } from "../../../panels/note-form";
import { Choice } from "../../../ui/inputs/choice";
import { Mark, outcomeMark, severityMark } from "../../../ui/marks/event-mark";
import { Panel } from "../../../ui/panel/panel";
import { SeenPicture } from "../../../video/seen-picture";
import { LinkFacts } from "./link-facts";
import { SignalList } from "./signal-list";

const SHOWN = ["events", "requests", "signals", "link"] as const;
type Shown = (typeof SHOWN)[number];

export function EventsPanel(props: {
  robotKey: string;
  events: readonly Event[];
  controller: Latest<ControllerState> | undefined;
  description: Description | undefined;
}) {
  const { robotKey, events } = props;
  const [shown, setShown] = useState<Shown>("events");
  const audit = useAudit(robotKey);
  const withdrawn = withdrawnIds(events);
  const times = useMotionTimes(audit, props.controller?.message);
  const signals = useTopic(SignalsSchema, `${robotKey}/signals`);
  // Only some controllers have signals.
  const values = SHOWN.filter((each) => each !== "signals" || signals !== undefined);
  const textOf = (each: Shown) => (each === "signals" ? sg("signals") : t(each));
  const empty = (shown === "events" ? events : audit).length === 0;
  return (
    <Panel
      name="events"
      title={textOf(shown)}
      end={<Choice label={t("events")} values={values} chosen={shown} text={textOf} choose={setShown} />}
    >
      {shown === "link" ? (
        <LinkFacts controller={props.controller} />
      ) : shown === "signals" && signals ? (
        <SignalList signals={signals} description={props.description} />
      ) : (
        <ol class="event-list grow scroll pad-0-16-8" tabIndex={0} aria-label={textOf(shown)}>
          {empty && <li class="dim">{t("no_events")}</li>}
          {shown === "events"
            ? events.map((event, i) => (
                <EventLine key={i} event={event} withdrawn={withdrawn.has(event.note?.id ?? "")} />
              ))
            : audit.map((entry) => (
                <AuditLine
                  key={`${entry.number} ${entry.repeatedCount}`}
                  robotKey={robotKey}
                  entry={entry}
                  joints={props.description?.joints ?? []}
                  took={times.get(entry.number)}
                />
              ))}
        </ol>
      )}
    </Panel>
  );
}

function EventLine({ event, withdrawn }: { event: Event; withdrawn: boolean }) {
  const mark = severityMark(event.severity);
  const text = eventText(event);
  return (
    <li title={`${stampFull(event.timestamp)} · ${event.source} · ${event.code}`}>
      <time>{stampTime(event.timestamp)}</time>
      <span class="break">
        {mark.level !== "normal" && <Mark {...mark} />}
        <span lang={text === event.text ? "en" : undefined}>
          <Withdrawable withdrawn={withdrawn && event.code === WRITTEN}>{text}</Withdrawable>
        </span>
      </span>
    </li>
  );
}

function AuditLine(props: {
  robotKey: string;
  entry: AuditEntry;
  joints: readonly Description_Joint[];
  /** Duration of its motion [s], once known. */
  took: number | undefined;
}) {
  const { entry } = props;
  const [, site = "", robot = ""] = props.robotKey.split("/");
  const mark = outcomeMark(entry.outcome);
  return (
    <li title={`${stampFull(entry.timestamp)} · ${entry.source} · ${entry.request}`}>
      <time>{stampTime(entry.timestamp)}</time>
      <span class="break">
        {mark.level !== "normal" && <Mark {...mark} />}
        {entrySentence(entry, props.joints, props.took)}
        {entry.repeatedCount > 0n && (
          <strong class="nowrap" title={t("repeated", { count: count(entry.repeatedCount) })}>
            {` × ${count(entry.repeatedCount)}`}
          </strong>
        )}
        <SeenPicture site={site} robot={robot} entry={entry} />
      </span>
    </li>
  );
}
