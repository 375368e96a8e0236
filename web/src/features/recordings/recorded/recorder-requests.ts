// Requests to a recorder about a recording's file: facts, events, numbers.

import { create, fromBinary } from "@bufbuild/protobuf";
import { timestampFromMs, timestampMs } from "@bufbuild/protobuf/wkt";
import { useEffect, useMemo, useState } from "preact/hooks";
import type { AuditEntry, Event, Recording, SeriesAnswer, SeriesAnswer_Series } from "../../../gen/robomesh_pb";
import {
  AuditEntrySchema,
  EventSchema,
  AuditEntry_Outcome as Outcome,
  RangeRequestSchema,
  RecordedMessagesSchema,
  RecordingQuerySchema,
  RecordingSchema,
  SeriesAnswerSchema,
  SeriesRequestSchema,
  Event_Severity as Severity,
} from "../../../gen/robomesh_pb";
import { entryText } from "../../../i18n/audit-text";
import { durationS, startMs, topicOf } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { AskError, ask, inOwnName, lostAt, reasonOf, watch } from "../../../mesh/console/connection";
import { readNotes, timeOfNote, WRITTEN, withdrawnIds } from "../../../mesh/services/notes";
import type { RecordingName } from "../../../ui/page/route";

const TIMEOUT_S = 20;
const MAX_EVENTS = 1000;

/** An answer; null: not received yet. */
export interface RequestState<T> {
  value: T | null;
  problem: string;
}

/** Send a request when its inputs change; the last answer is kept until the next. */
function useRequest<T>(question: (() => Promise<T>) | null, depends: readonly unknown[]): RequestState<T> {
  const [state, setState] = useState<RequestState<T>>({ value: null, problem: "" });
  const connected = lostAt.value === null;
  useEffect(() => {
    if (!question || !connected) return;
    let wanted = true;
    question().then(
      (value) => wanted && setState({ value, problem: "" }),
      (error: unknown) => wanted && setState((before) => ({ ...before, problem: reason(error) })),
    );
    return () => void (wanted = false);
  }, [connected, ...depends]);
  return state;
}

function reason(error: unknown): string {
  if (error instanceof AskError && error.noAnswer) return r("record_no_answer");
  return reasonOf(error);
}

/** Return the facts of a recording. */
export function useInfo(name: RecordingName | null): RequestState<Recording> {
  return useRequest(
    name && (() => ask(keyOf(name, "info"), RecordingQuerySchema, { file: name.file }, RecordingSchema, TIMEOUT_S)),
    [name?.site, name?.file],
  );
}

/** An event with its time [s from the recording's start]; a note's is that which it is on. */
export interface RecordedEvent {
  at: number;
  event: Event;
  /** The end of a note's range. */
  until?: number;
  /** A note that is not in the file. */
  beside?: boolean;
  withdrawn?: boolean;
}

/** Return the robot of a recording, whose notes are shown; null: none, or several. */
export function robotKeyOf(name: RecordingName | null, info: Recording | null): string | null {
  if (!info?.robot || !name) return null;
  return `robomesh/${info.site || name.site}/${info.robot}`;
}

/** Return the events of a recording, and the notes of its robot on that time that are not in the file. */
export function useEventsWithNotes(
  name: RecordingName | null,
  info: Recording | null,
): RequestState<{ list: readonly RecordedEvent[]; cut: boolean }> {
  const recorded = useRecordedEvents(name, info);
  const robotKey = robotKeyOf(name, info);
  const [notes, setNotes] = useState<readonly Event[]>([]);
  const connected = lostAt.value === null;
  useEffect(() => {
    if (!robotKey || !info || !connected) return;
    let wanted = true;
    const add = (some: readonly Event[]) => wanted && setNotes((before) => [...before, ...some]);
    setNotes([]);
    // New notes as they come; the older ones from the store, of which old sites have none.
    const stop = watch(`${robotKey}/events/store`, ({ live, payload }) => {
      if (live) add([fromBinary(EventSchema, payload)]);
    });
    readNotes(robotKey, { since: startMs(info), until: startMs(info) + durationS(info) * 1000 }).then(add, () => {});
    return () => {
      wanted = false;
      stop();
    };
  }, [robotKey, info, connected]);
  const value = useMemo(
    () => recorded.value && info && { ...recorded.value, list: withNotes(recorded.value.list, notes, info) },
    [recorded.value, notes, info],
  );
  return { value, problem: recorded.problem };
}

/** Return events with the notes on a recording's time, each at the time that it is on. */
function withNotes(list: readonly RecordedEvent[], notes: readonly Event[], info: Recording): RecordedEvent[] {
  const [start, duration] = [startMs(info), durationS(info)];
  const inFile = new Set(list.map(({ event }) => noteKey(event)));
  const withdrawn = withdrawnIds([...list.map(({ event }) => event), ...notes]);
  const place = (happened: RecordedEvent): RecordedEvent => {
    const { note, code } = happened.event;
    if (!note || code !== WRITTEN) return happened;
    const { begin, end } = timeOfNote(note);
    const at = (begin - start) / 1000;
    return {
      ...happened,
      at: Math.max(0, at),
      ...(end !== undefined && { until: Math.min(duration, (end - start) / 1000) }),
      withdrawn: withdrawn.has(note.id),
    };
  };
  const beside = new Map(
    notes
      .filter((event) => event.note && event.code === WRITTEN && !inFile.has(noteKey(event)))
      .map((event) => [noteKey(event), place({ at: 0, event, beside: true })]),
  );
  const onIt = [...beside.values()].filter(({ event, at, until }) => {
    const { begin } = event.note ? timeOfNote(event.note) : { begin: 0 };
    return at <= duration && (begin >= start || (until ?? -1) >= 0);
  });
  return [...list.map(place), ...onIt].sort((first, second) => first.at - second.at);
}

const noteKey = ({ code, note }: Event): string => `${code} ${note?.id ?? ""}`;

/** Return the events of a recording, oldest first, of every service, and the audited requests. */
function useRecordedEvents(
  name: RecordingName | null,
  info: Recording | null,
): RequestState<{ list: readonly RecordedEvent[]; cut: boolean }> {
  return useRequest(
    name && info
      ? async () => {
          const start = startMs(info);
          const channels = info.topics
            .map(({ topic }) => topic)
            .filter((topic) => /^(events(\/.*)?|audit)$/.test(topicOf(topic)));
          const answers = await Promise.all(
            channels.map((topic) =>
              ask(
                inOwnName(keyOf(name, "range")),
                RangeRequestSchema,
                { file: name.file, topic, most: MAX_EVENTS },
                RecordedMessagesSchema,
                TIMEOUT_S,
              ),
            ),
          );
          const list = answers
            .flatMap(({ messages }, i) => {
              const audited = topicOf(channels[i] ?? "") === "audit";
              return messages.map(({ received, data }) => ({
                at: received ? (timestampMs(received) - start) / 1000 : 0,
                event: audited ? auditAsEvent(fromBinary(AuditEntrySchema, data)) : fromBinary(EventSchema, data),
              }));
            })
            .sort((first, second) => first.at - second.at);
          return { list, cut: answers.some(({ more }) => more) };
        }
      : null,
    [name?.site, name?.file, info],
  );
}

/** Convert an audited request to an event. */
function auditAsEvent(entry: AuditEntry): Event {
  const { timestamp, operator, source, request, outcome, text } = entry;
  const words = outcome === Outcome.REFUSED ? "asked_refused" : outcome === Outcome.FAILED ? "asked_failed" : "asked";
  const unknown = Outcome[outcome] === undefined ? ` (${outcome})` : "";
  const what = request.toLowerCase().replaceAll("_", " ") + unknown;
  const summary = r(words, { who: operator || source, what });
  const severity = words === "asked" ? Severity.INFO : Severity.WARNING;
  const event = create(EventSchema, {
    severity,
    source,
    code: request,
    text: text ? `${summary}: ${entryText(entry)}` : summary,
  });
  if (timestamp) event.timestamp = timestamp;
  return event;
}

/** Return when a recording's first frames arrived [s from its start]; 0: it has none. */
export function useFirstFrameTime(name: RecordingName | null, info: Recording | null): number {
  return (
    useRequest(
      name && info
        ? async () => {
            const topic = info.topics.find((each) => topicOf(each.topic) === "frames")?.topic;
            if (!topic) return 0;
            const request = { file: name.file, topic, most: 1 };
            const { messages } = await ask(
              inOwnName(keyOf(name, "range")),
              RangeRequestSchema,
              request,
              RecordedMessagesSchema,
              TIMEOUT_S,
            );
            const received = messages[0]?.received;
            return received ? (timestampMs(received) - startMs(info)) / 1000 : 0;
          }
        : null,
      [name?.site, name?.file, info],
    ).value ?? 0
  );
}

/** Return the names of the numbers in a recording. */
export function useValueNames(name: RecordingName | null): RequestState<readonly string[]> {
  return useRequest(name && (async () => (await askSeries(name, {})).known), [name?.site, name?.file]);
}

/** A part of a recording [s from its start]. */
export interface Window {
  from: number;
  to: number;
}

/** Return numbers of a recording over a part of it. */
export function useSeries(
  name: RecordingName | null,
  info: Recording | null,
  values: readonly string[],
  window: Window,
  points: number,
): RequestState<readonly SeriesAnswer_Series[]> {
  return useRequest(
    name && info && values.length
      ? async () => {
          const start = startMs(info);
          const at = (seconds: number) => timestampFromMs(Math.round(start + seconds * 1000));
          const request = { values: [...values], start: at(window.from), end: at(window.to), points };
          return (await askSeries(name, request)).series;
        }
      : null,
    [name?.site, name?.file, info, values.join(" "), window.from, window.to, points],
  );
}

function askSeries(name: RecordingName, request: object): Promise<SeriesAnswer> {
  return ask(
    inOwnName(keyOf(name, "series")),
    SeriesRequestSchema,
    { file: name.file, ...request },
    SeriesAnswerSchema,
    TIMEOUT_S,
  );
}

function keyOf({ site }: RecordingName, what: string): string {
  return `robomesh/${site}/-/recordings/${what}`;
}
