// Events of a recording: marks on its time line, and a list.

import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { ReadonlySignal } from "@preact/signals";
import { useComputed, useSignal } from "@preact/signals";
import { useEffect, useMemo, useState } from "preact/hooks";
import { eventText } from "../../../i18n/event-text";
import { count, timeText } from "../../../i18n/format";
import { momentText } from "../../../i18n/recording-format";
import { notesText as n, recordingsText as r, t } from "../../../i18n/texts";
import { WRITTEN } from "../../../mesh/services/notes";
import { NoteForm, Withdrawable } from "../../../panels/note-form";
import { Button } from "../../../ui/inputs/button";
import { Choice } from "../../../ui/inputs/choice";
import { severityMark } from "../../../ui/marks/event-mark";
import { Panel } from "../../../ui/panel/panel";
import { foldSteps } from "./fold-steps";
import type { RecordedEvent, RequestState } from "./recorder-requests";
import "./contents.css";

const NONE: readonly RecordedEvent[] = [];
const MOST_MARKS = 200; // more are indistinguishable; the gravest are shown

function severityOf({ event }: RecordedEvent): [string, string] {
  const { text, level } = severityMark(event.severity);
  return [text, level];
}

/** Return an event's sentence; a note's row has the time that it is on. */
function wordsOf({ event, at, until }: RecordedEvent): string {
  if (event.code !== WRITTEN || !event.note) return eventText(event);
  const { author, text } = event.note;
  if (until === undefined) return t("event_note", { author, text });
  return t("event_note_on", { author, text, time: n("from_to", { from: momentText(at), to: momentText(until) }) });
}

/** At an end of the line, align the label inwards. */
function sideOf(share: number): string {
  return share < 0.15 ? "early" : share > 0.85 ? "late" : "";
}

export function EventMarks(props: { events: readonly RecordedEvent[]; duration: number; seek: (to: number) => void }) {
  const { duration } = props;
  const shown = foldSteps(props.events)
    .map(({ happened }) => happened)
    .filter(({ withdrawn }) => !withdrawn)
    .sort((first, second) => second.event.severity - first.event.severity)
    .slice(0, MOST_MARKS)
    .sort((first, second) => first.at - second.at);
  return (
    <div class="event-marks" role="group" aria-label={r("events")}>
      {duration > 0 &&
        props.events.map(({ at, until, withdrawn }, i) =>
          until === undefined || withdrawn ? null : (
            <span
              key={i}
              class="note-range"
              aria-hidden="true"
              style={{ left: `${(100 * at) / duration}%`, width: `${(100 * Math.max(0, until - at)) / duration}%` }}
            />
          ),
        )}
      {duration > 0 &&
        shown.map((happened, i) => {
          const [word, level] = severityOf(happened);
          const isNote = happened.event.code === WRITTEN;
          const text = `${momentText(happened.at)} ${isNote ? n("note") : word}: ${wordsOf(happened)}`;
          return (
            <button
              key={i}
              class={`event-mark ${sideOf(happened.at / duration)}`}
              style={{ left: `${(100 * Math.min(duration, Math.max(0, happened.at))) / duration}%` }}
              data-text={text}
              aria-label={r("go_to_event", { time: momentText(happened.at), text: wordsOf(happened) })}
              onClick={() => props.seek(happened.at)}
            >
              <span class={isNote ? "note-shape" : `shape ${level}`} aria-hidden="true" />
            </button>
          );
        })}
    </div>
  );
}

/** A list of events, the latest one marked. */
export function EventList(props: {
  asked: RequestState<{ list: readonly RecordedEvent[]; cut: boolean }>;
  moment: ReadonlySignal<number>;
  seek: (to: number) => void;
  /** The recorded robot, for notes; null: they cannot be written. */
  robotKey: string | null;
  /** Start of the recording [ms since the Unix epoch]. */
  startMs: number;
}) {
  const [noting, setNoting] = useState(false);
  const { value, problem } = props.asked;
  const list = value?.list ?? NONE;
  const rows = useMemo(() => foldSteps(list), [list]);
  const [open, setOpen] = useState<ReadonlySet<RecordedEvent>>(new Set());
  const shown = useMemo(
    () =>
      rows.flatMap(({ happened, steps }) => [
        { happened, steps, isStep: false },
        ...(open.has(happened) ? steps : []).map((step) => ({ happened: step, steps: [], isStep: true })),
      ]),
    [rows, open],
  );
  const toggle = (run: RecordedEvent) => {
    const next = new Set(open);
    if (!next.delete(run)) next.add(run);
    setOpen(next);
  };
  const times = useSignal<readonly number[]>([]);
  useEffect(() => void (times.value = shown.map(({ happened }) => happened.at)), [shown]);
  const last = useComputed(() => {
    const moment = props.moment.value + 1e-3; // read in any case: it triggers the computed signal
    return times.value.findLastIndex((at) => at <= moment);
  }).value;
  return (
    <Panel
      name="events"
      title={r("events")}
      end={
        <>
          {rows.length > 0 && <span class="dim">{count(rows.length)}</span>}
          {props.robotKey && (
            <Button
              quiet
              text={n("note")}
              aria-expanded={noting}
              title={n("note_hint")}
              onClick={() => setNoting(!noting)}
            />
          )}
        </>
      }
    >
      {noting && props.robotKey && (
        <NoteAtMoment
          robotKey={props.robotKey}
          moment={props.moment}
          startMs={props.startMs}
          close={() => setNoting(false)}
        />
      )}
      <ol class="event-list grow scroll pad-0-16-8 recorded-events" tabIndex={0} aria-label={r("events")}>
        {!value && !problem && <li class="skeleton">{"\u00a0"}</li>}
        {problem && <li class="state warning">{r("events_refused", { text: problem })}</li>}
        {value && list.length === 0 && <li class="dim">{r("no_events")}</li>}
        {shown.map(({ happened, steps, isStep }, i) => (
          <li key={i} class={isStep ? "run-step" : undefined} aria-current={i === last ? "true" : undefined}>
            <EventButton happened={happened} seek={props.seek} />
            {steps.length > 0 && (
              <button class="run-steps" aria-expanded={open.has(happened)} onClick={() => toggle(happened)}>
                <span class="turn" aria-hidden="true" />
                {steps.length === 1 ? r("run_step") : r("run_steps", { count: count(steps.length) })}
              </button>
            )}
          </li>
        ))}
        {value?.cut && <li class="dim">{r("events_cut", { count: count(list.length) })}</li>}
      </ol>
    </Panel>
  );
}

const ON = ["moment", "range"] as const;

/** A note on the player's position, or on the range from the position at which "range" was chosen. */
function NoteAtMoment(props: { robotKey: string; moment: ReadonlySignal<number>; startMs: number; close: () => void }) {
  const [from, setFrom] = useState<number | null>(null);
  const at = props.moment.value;
  const time = (seconds: number) => props.startMs + seconds * 1000;
  const on = () =>
    from === null ? { begin: time(at) } : { begin: time(Math.min(from, at)), end: time(Math.max(from, at)) };
  return (
    <NoteForm robotKey={props.robotKey} on={on} close={props.close}>
      <Choice
        label={n("on")}
        values={ON}
        chosen={from === null ? "moment" : "range"}
        text={n}
        choose={(each) => setFrom(each === "range" ? props.moment.peek() : null)}
      />
      <span class="figure small">
        {from === null
          ? momentText(at)
          : n("from_to", { from: momentText(Math.min(from, at)), to: momentText(Math.max(from, at)) })}
      </span>
    </NoteForm>
  );
}

function EventButton({ happened, seek }: { happened: RecordedEvent; seek: (to: number) => void }) {
  const [word, level] = severityOf(happened);
  const { event, at } = happened;
  return (
    <button
      title={`${event.timestamp ? timeText(timestampMs(event.timestamp)) : ""} · ${event.source} · ${event.code}`}
      onClick={() => seek(at)}
    >
      <time>{momentText(at)}</time>
      <span class="break">
        {level !== "normal" && (
          <span class={`mark state ${level}`}>
            <span class={`shape ${level}`} aria-hidden="true" />
            {word}
          </span>
        )}
        <Withdrawable withdrawn={happened.withdrawn ?? false}>{wordsOf(happened)}</Withdrawable>
        {happened.beside && <span class="dim small"> {n("beside")}</span>}
      </span>
    </button>
  );
}
