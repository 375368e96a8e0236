// Events and audit entries of every robot and service, newest first, without repeats, up to a maximum.

import { fromBinary } from "@bufbuild/protobuf";
import type { Signal } from "@preact/signals";
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { AuditEntry, Event } from "../../gen/robomesh_pb";
import { AuditEntrySchema, AuditListSchema, EventListSchema, EventSchema } from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import type { Sample } from "../../mesh/console/connection";
import { watch } from "../../mesh/console/connection";

export const MAX_ENTRIES = 5000;
const UPDATE_INTERVAL_MS = 250;

interface Of {
  /** Unique among all entries. */
  id: string;
  ms: number;
  site: string;
  robot: string;
}
export type EventEntry = Of & { event: Event };
export type AuditLine = Of & { audit: AuditEntry };

/** A list that many publishers add to. */
export class Entries<E extends Of> {
  readonly newest: Signal<readonly E[]> = signal([]);
  private readonly known = new Set<string>();
  private waiting: E[] = [];

  /** Add new entries; they become visible at the next `settle`. */
  take(entries: readonly E[]): void {
    for (const entry of entries) {
      if (this.known.has(entry.id)) continue;
      this.known.add(entry.id);
      this.waiting.push(entry);
    }
  }

  settle(): void {
    if (this.waiting.length === 0) return;
    // Two nearly sorted runs: the sort is quick, and stable.
    const merged = [...this.waiting.reverse(), ...this.newest.value].sort((a, b) => b.ms - a.ms);
    for (const { id } of merged.splice(MAX_ENTRIES)) this.known.delete(id);
    this.waiting = [];
    this.newest.value = merged;
  }
}

export const events = new Entries<EventEntry>();
export const audits = new Entries<AuditLine>();

/** Follow both lists while the component is mounted; earlier entries are kept. */
export function useEntries(): void {
  useEffect(() => {
    const ends = [
      watch("robomesh/*/*/events", takeEvents),
      watch("robomesh/*/*/events/*", takeEvents),
      watch("robomesh/*/*/audit", takeAudit),
    ];
    const timer = setInterval(() => {
      events.settle();
      audits.settle();
    }, UPDATE_INTERVAL_MS);
    return () => {
      clearInterval(timer);
      for (const end of ends) end();
    };
  }, []);
}

function takeEvents(sample: Sample): void {
  const received = sample.live
    ? [fromBinary(EventSchema, sample.payload)]
    : fromBinary(EventListSchema, sample.payload).events;
  events.take(eventEntries(sample.key, received));
}

/** Return the events of one topic. */
export function eventEntries(key: string, received: readonly Event[]): EventEntry[] {
  const [, site = "", robot = ""] = key.split("/");
  return received.map((event) => {
    const ms = stampMs(event.timestamp);
    const nanos = event.timestamp?.nanos ?? 0;
    return { id: `${key} ${ms} ${nanos} ${event.code} ${event.text}`, ms, site, robot, event };
  });
}

function takeAudit(sample: Sample): void {
  const received = sample.live
    ? [fromBinary(AuditEntrySchema, sample.payload)]
    : fromBinary(AuditListSchema, sample.payload).entries;
  const [, site = "", robot = ""] = sample.key.split("/");
  audits.take(auditLines(site, robot, received));
}

/** Return the entries of one robot's log. */
export function auditLines(site: string, robot: string, entries: readonly AuditEntry[]): AuditLine[] {
  return entries.map((audit) => ({
    // A repeated entry has the same number.
    id: `${site}/${robot} ${audit.number} ${audit.repeatedCount}`,
    ms: stampMs(audit.timestamp),
    site,
    robot,
    audit,
  }));
}
