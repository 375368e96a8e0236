// What is known of a robot's day: the gateway's audit log, the site's notes and recordings, and the events that came.

import { EmptySchema, timestampFromMs, timestampMs } from "@bufbuild/protobuf/wkt";
import type { AuditEntry, Event, Recording } from "../../gen/robomesh_pb";
import {
  AuditListSchema,
  AuditQuerySchema,
  AuditEntry_Outcome as Outcome,
  RecordingListSchema,
} from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { AskError, ask, reasonOf } from "../../mesh/console/connection";
import { readNotes } from "../../mesh/services/notes";
import type { DaySources, Span } from "./day";
import type { EventEntry } from "./entries";

const TIMEOUT_S = 30; // a gateway searches its whole log in the background
const MOST = 10_000;

/** The answers of the services; `problems`: why a part is missing. */
export interface DayAnswers {
  day: Span;
  audit: readonly AuditEntry[];
  before: DaySources["before"];
  notes: readonly Event[];
  recordings: readonly Recording[];
  problems: { audit: string; notes: string; recordings: string };
  /** The oldest of the newest entries, if the gateway has more of that day. */
  cutAt: number | null;
}

/** Ask the services for a robot's day. */
export async function readDay(robotKey: string, day: Span): Promise<DayAnswers> {
  const [, site = "", robot = ""] = robotKey.split("/");
  const find = async (query: object) =>
    (await ask(`${robotKey}/audit/find`, AuditQuerySchema, query, AuditListSchema, TIMEOUT_S)).entries;
  const since = timestampFromMs(day.from);
  const until = timestampFromMs(day.to - 1);
  const newest = async (request: string) =>
    (await find({ request, outcome: Outcome.ACCEPTED, until: timestampFromMs(day.from - 1), most: 1 })).at(-1);
  const [audit, before, notes, list] = await Promise.allSettled([
    find({ since, until, most: MOST }),
    Promise.all(["STOP", "RESET"].map(newest)),
    readNotes(robotKey, { since: day.from, until: day.to }),
    ask(`robomesh/${site}/-/recordings/list`, EmptySchema, {}, RecordingListSchema, TIMEOUT_S),
  ]);
  const entries = audit.status === "fulfilled" ? audit.value : [];
  return {
    day,
    audit: entries,
    before: before.status === "fulfilled" ? stateOf(before.value) : null,
    notes: notes.status === "fulfilled" ? notes.value : [],
    recordings: list.status === "fulfilled" ? list.value.recordings.filter((each) => each.robot === robot) : [],
    problems: { audit: problemOf(audit), notes: problemOf(notes), recordings: problemOf(list) },
    cutAt: entries.length >= MOST ? timeOf(entries[0]) : null,
  };
}

/** Return the state after the last stop and reset. */
function stateOf([stop, reset]: readonly (AuditEntry | undefined)[]): { stopped: boolean } {
  return { stopped: stop !== undefined && (reset === undefined || reset.number < stop.number) };
}

function problemOf(outcome: PromiseSettledResult<unknown>): string {
  if (outcome.status === "fulfilled") return "";
  const { reason } = outcome;
  return reason instanceof AskError && reason.message ? reason.message : reasonOf(reason);
}

const timeOf = (entry: AuditEntry | undefined): number | null =>
  entry?.timestamp ? timestampMs(entry.timestamp) : null;

/** Return the events of a robot, and those of its site's watch about it. */
export function eventsAbout(robotKey: string, events: readonly EventEntry[]): Event[] {
  const [, site = "", robot = ""] = robotKey.split("/");
  return events
    .filter(
      (entry) =>
        entry.site === site &&
        (entry.robot === robot || (entry.robot === "-" && entry.event.values.id?.startsWith(`${robot}:`))),
    )
    .map(({ event }) => event);
}

/** Return the time from which the gateway's events are known [ms]; null: none is. */
export function knownFrom(events: readonly Event[]): number | null {
  const times = events.filter(({ source }) => source === "gateway").map((event) => stampMs(event.timestamp));
  return times.length ? Math.min(...times) : null;
}
