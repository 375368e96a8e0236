// Notes on a robot's time: requests to its site's store.

import { timestampFromMs, timestampMs } from "@bufbuild/protobuf/wkt";
import type { Event, Note } from "../../gen/robomesh_pb";
import {
  NoteRequest_Action as Action,
  EventListSchema,
  EventSchema,
  NoteQuerySchema,
  NoteRequestSchema,
} from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { notesText as n } from "../../i18n/texts";
import { isAdministrator, mayAct } from "../console/account";
import { ask, withNoAnswerText } from "../console/connection";
import { asker } from "./alarms";

export const LONGEST_TEXT = 500;
export const WRITTEN = "note.written";
export const WITHDRAWN = "note.withdrawn";
const TIMEOUT_S = 10; // the answer waits for the disk

/** The time that a note is on [ms since the Unix epoch]; without an end: a moment. */
export interface NoteTime {
  begin: number;
  end?: number;
}

export function timeOfNote({ begin, end }: Note): NoteTime {
  const from = stampMs(begin);
  return end ? { begin: from, end: timestampMs(end) } : { begin: from };
}

/** Write a note; `on` null: on the time at which the store receives it.
 *
 * @throws Error with the reason in words. */
export async function writeNote(robotKey: string, text: string, on: NoteTime | null): Promise<void> {
  const values = {
    text,
    id: randomId(),
    ...(on && { begin: timestampFromMs(Math.round(on.begin)) }),
    ...(on?.end !== undefined && { end: timestampFromMs(Math.round(on.end)) }),
  };
  await change(robotKey, "request", { action: Action.WRITE, ...values });
}

function randomId(): string {
  return [...crypto.getRandomValues(new Uint8Array(8))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Whether this page may withdraw a note. */
export function mayWithdraw({ author }: Note): boolean {
  return mayAct.value && asker.value !== "" && (author === asker.value || isAdministrator.value);
}

/** Withdraw a note.
 *
 * @throws Error with the reason in words. */
export async function withdrawNote(robotKey: string, { id, author }: Note): Promise<void> {
  const request = author === asker.value ? "request" : "withdraw";
  await change(robotKey, request, { action: Action.WITHDRAW, id });
}

/** Return the notes on a part of a robot's time, with their withdrawals.
 *
 * @throws Error with the reason in words. */
export async function readNotes(robotKey: string, part: { since?: number; until?: number } = {}): Promise<Event[]> {
  const [, site = "", robot = ""] = robotKey.split("/");
  const query = {
    robot,
    ...(part.since !== undefined && { since: timestampFromMs(Math.floor(part.since)) }),
    ...(part.until !== undefined && { until: timestampFromMs(Math.ceil(part.until)) }),
  };
  const answer = ask(`robomesh/${site}/-/notes/read`, NoteQuerySchema, query, EventListSchema, TIMEOUT_S);
  return (await withNoAnswerText(answer, n("no_store"))).events;
}

/** Return the ids of withdrawn notes among events. */
export function withdrawnIds(events: readonly Event[]): ReadonlySet<string> {
  return new Set(events.flatMap(({ code, note }) => (code === WITHDRAWN && note ? [note.id] : [])));
}

async function change(robotKey: string, request: string, values: object): Promise<void> {
  const [, site = "", robot = ""] = robotKey.split("/");
  const key = `robomesh/${site}/-/notes/${request}/${asker.value}`;
  await withNoAnswerText(ask(key, NoteRequestSchema, { robot, ...values }, EventSchema, TIMEOUT_S), n("no_store"));
}
