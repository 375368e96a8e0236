// The newest message of each key that the page has subscribed to.

import type { DescMessage, MessageShape } from "@bufbuild/protobuf";
import { equals, fromBinary } from "@bufbuild/protobuf";
import type { Timestamp } from "@bufbuild/protobuf/wkt";
import type { Signal } from "@preact/signals";
import { signal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { AuditEntry, Event } from "../../gen/robomesh_pb";
import { AuditEntrySchema, AuditListSchema, EventListSchema, EventSchema } from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { ageClock } from "../console/age-clock";
import type { Sample } from "../console/connection";
import { watch } from "../console/connection";

export interface Latest<M> {
  key: string;
  message: M;
  sample: Sample;
}

const AGE_MS = 250;

/** The clock for ages [ms], four times a second, for drawing. */
export const now = signal(ageClock());
const tick = () => (now.value = ageClock());
setInterval(tick, AGE_MS);
// A hidden page ticks rarely: mark its data stale before it is visible again.
document.addEventListener("visibilitychange", tick);

const REDRAW_MS = 50; // people read no faster; 3-D and plots take each sample
const LIST_LENGTH = 200;

interface Watched<M> {
  entries: Signal<ReadonlyMap<string, Latest<M>>>;
  users: number;
  stop: () => void;
}
const watched = new Map<string, Watched<unknown>>();

function follow<M>(expression: string): Watched<M> {
  const present = watched.get(expression);
  if (present) return present as Watched<M>;
  const entries = signal<ReadonlyMap<string, Latest<M>>>(new Map());
  const fresh: Watched<M> = { entries, users: 0, stop: () => undefined };
  watched.set(expression, fresh as Watched<unknown>);
  return fresh;
}

function start<S extends DescMessage>(schema: S, expression: string, topic: Watched<MessageShape<S>>): void {
  const dirty = new Map<string, Sample>();
  let timer: ReturnType<typeof setTimeout> | undefined;
  const flush = () => {
    timer = undefined;
    const before = topic.entries.value;
    const next = new Map(before);
    for (const [key, sample] of dirty) {
      const message = fromBinary(schema, sample.payload);
      const shown = before.get(key);
      // Often the same: only its age is new, which is drawn with `now`. The time of a rare message may matter.
      const often = shown && sample.arrived - shown.sample.arrived < AGE_MS;
      if (often && same(schema, message, shown.message)) shown.sample = sample;
      else next.set(key, { key, sample, message });
    }
    if ([...dirty.keys()].some((key) => before.get(key) !== next.get(key))) topic.entries.value = next;
    dirty.clear();
  };
  const stop = watch(expression, (sample) => {
    dirty.set(sample.key, sample);
    timer ??= setTimeout(flush, REDRAW_MS);
  });
  topic.stop = () => {
    clearTimeout(timer);
    stop();
  };
}

/** Return whether two messages differ at most in their time. */
function same<S extends DescMessage>(schema: S, one: MessageShape<S>, other: MessageShape<S>): boolean {
  return equals(schema, { ...one, timestamp: undefined }, { ...other, timestamp: undefined });
}

/** Follow the newest message of every key that a key expression covers. */
export function useTopics<S extends DescMessage>(
  schema: S,
  expression: string,
): ReadonlyMap<string, Latest<MessageShape<S>>> {
  const topic = useMemo(() => follow<MessageShape<S>>(expression), [expression]);
  useEffect(() => {
    // Another component may have released it since this one was drawn.
    watched.set(expression, topic as Watched<unknown>);
    if (topic.users++ === 0) start(schema, expression, topic);
    return () => {
      if (--topic.users === 0) {
        topic.stop();
        watched.delete(expression);
      }
    };
  }, [topic]);
  return topic.entries.value;
}

/** Follow the newest message of one key. */
export function useTopic<S extends DescMessage>(schema: S, key: string): Latest<MessageShape<S>> | undefined {
  return useTopics(schema, key).get(key);
}

/** Follow the last events of a robot, newest first: the gateway's and all other services'. */
export function useEvents(robotKey: string): readonly Event[] {
  return useList([`${robotKey}/events`, `${robotKey}/events/*`], (sample) =>
    sample.live ? [fromBinary(EventSchema, sample.payload)] : fromBinary(EventListSchema, sample.payload).events,
  );
}

/** Follow the last audit entries of a robot, newest first. */
export function useAudit(robotKey: string): readonly AuditEntry[] {
  return useList([`${robotKey}/audit`], (sample) =>
    sample.live ? [fromBinary(AuditEntrySchema, sample.payload)] : fromBinary(AuditListSchema, sample.payload).entries,
  );
}

interface Dated {
  timestamp?: Timestamp | undefined;
}
const timeOf = ({ timestamp }: Dated): number => stampMs(timestamp);

function useList<M extends Dated>(
  expressions: readonly string[],
  decode: (sample: Sample) => readonly M[],
): readonly M[] {
  const list = useMemo(() => signal<readonly M[]>([]), expressions);
  useEffect(() => {
    const lists = new Map<string, { entries: readonly M[]; seen: Set<string>; last: Sample }>();
    const take = (sample: Sample) => {
      const before = lists.get(sample.key);
      const entries = decode(sample);
      const history = (before && goesOn(before.last, sample, entries.length) && before) || {
        entries: [],
        seen: new Set(),
        last: sample,
      };
      const id = `${sample.publisher}:${sample.sequence}`;
      if (history.seen.has(id)) return; // repeated after a reconnect
      if (sample.live) history.seen.add(id);
      history.last = sample;
      history.entries = [...[...entries].reverse(), ...history.entries].slice(0, LIST_LENGTH);
      lists.set(sample.key, history);
      // The sort is stable: entries of one publisher keep their order.
      const merged = [...lists.values()].flatMap(({ entries }) => entries);
      if (lists.size > 1) merged.sort((first, second) => timeOf(second) - timeOf(first));
      list.value = merged.slice(0, LIST_LENGTH);
    };
    const stops = expressions.map((expression) => watch(expression, take));
    return () => {
      for (const stop of stops) stop();
    };
  }, [list]);
  return list.value;
}

/** Return whether a sample's entries follow the last sample's. After an outage a list holds only new entries;
 * after a reconnect it holds all of them again. */
function goesOn(last: Sample, sample: Sample, count: number): boolean {
  const more = sample.sequence - last.sequence;
  return sample.live || (sample.publisher === last.publisher && more >= BigInt(count) && more > 0n);
}
