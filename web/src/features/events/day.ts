// The history of one robot's day: sentences, and how long it was stopped, without a link, or in a program.

import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { AuditEntry, Event, Recording } from "../../gen/robomesh_pb";
import { AuditEntry_Outcome as Outcome, Event_Severity as Severity } from "../../gen/robomesh_pb";
import { alarmTitle } from "../../i18n/alarm-text";
import { entrySentence, entryText } from "../../i18n/audit-text";
import { eventText } from "../../i18n/event-text";
import { stampMs } from "../../i18n/format";
import { durationS, startMs } from "../../i18n/recording-format";
import { dayText as d } from "../../i18n/texts";
import { WITHDRAWN, WRITTEN, withdrawnIds } from "../../mesh/services/notes";

export const KINDS = ["control", "program", "stop", "alarm", "recording", "note"] as const;
export type Kind = (typeof KINDS)[number];

export interface DayLine {
  ms: number;
  kind: Kind;
  text: string;
  /** It needs attention. */
  bad?: boolean;
  withdrawn?: boolean;
}

/** Known parts of a day [ms]; `unknown` is the rest of it until now. */
export interface Totals {
  program: number;
  stopped: number;
  offline: number;
  unknown: number;
}

/** A span of time [ms since the Unix epoch], without its end. */
export interface Span {
  from: number;
  to: number;
}

export interface DaySources {
  day: Span;
  now: number;
  /** Oldest first, of the day. */
  audit: readonly AuditEntry[];
  /** Whether a stop was latched when the day began; null: not known. */
  before: { stopped: boolean } | null;
  events: readonly Event[];
  /** The time from which all events of the gateway are known [ms]; null: none is known. */
  eventsFrom: number | null;
  recordings: readonly Recording[];
}

/** Return a local calendar day, "2026-03-29": 23 to 25 hours, as its clocks are set. */
export function spanOfDay(date: string): Span | null {
  const match = /^(\d{4})-(\d\d)-(\d\d)$/.exec(date);
  if (!match) return null;
  const [year = 0, month = 0, day = 0] = match.slice(1).map(Number);
  const from = new Date(year, month - 1, day).getTime();
  const to = new Date(year, month - 1, day + 1).getTime();
  return Number.isFinite(from) && to > from ? { from, to } : null;
}

const CONTROL = new Set(["ACQUIRE", "TAKE", "ACCEPT", "OFFER", "ASK", "RELEASE", "EXPIRE", "REVOKE"]);
const PROGRAM_SOURCE = "program";
const OVER: Record<string, readonly string[]> = {
  "link.down": ["link.up"],
  "link.lost": ["link.up"],
  "link.silent": ["link.up"],
  "joints.gone": ["joints.back"],
  "status.gone": ["status.back"],
  "controller.local": ["controller.remote"],
  "audit.failed": ["audit.mended"],
};
const LINK_GONE = new Set(["link.down", "link.lost", "link.silent"]);
// Alarms that the audit log says with more words.
const AUDITED = /^(stop|program|lease)\./;
const WATCHED = new Set(["alarm.acknowledged", "alarm.shelved", "alarm.unshelved"]);

const ms = ({ timestamp }: { timestamp?: AuditEntry["timestamp"] }): number => stampMs(timestamp);

/** Return the day's sentences, oldest first. */
export function linesOf(sources: DaySources): DayLine[] {
  const { day, recordings } = sources;
  const events = [...sources.events].sort((a, b) => ms(a) - ms(b));
  const lines = [
    ...auditLinesOf(sources.audit),
    ...events.flatMap((event, i) => eventLine(event, events.slice(i + 1))),
    ...noteLines(events),
    ...recordings.map((recording) => ({
      ms: startMs(recording),
      kind: "recording" as const,
      text: d(recording.open ? "recording_open" : "recording", {
        name: recording.name || recording.file,
        time: lastedText(durationS(recording) * 1000),
      }),
    })),
  ];
  return lines.filter((line) => line.ms >= day.from && line.ms < day.to).sort((a, b) => a.ms - b.ms);
}

/** Return the audited requests: runs of one program and motions of one operator in a row are one line each. */
function auditLinesOf(audit: readonly AuditEntry[]): DayLine[] {
  const lines: DayLine[] = [];
  let runs = null as Runs | null;
  let motions = null as { who: string; line: DayLine; count: number } | null;
  const add = (entry: AuditEntry, kind: Kind): DayLine => {
    const bad = entry.outcome !== Outcome.ACCEPTED;
    const line = { ms: ms(entry), kind, text: entrySentence(entry), bad };
    lines.push(line);
    return line;
  };
  for (const entry of audit) {
    const { request, operator: who, outcome } = entry;
    const accepted = outcome === Outcome.ACCEPTED;
    if (request === "PROGRAM_END") {
      if (!runs) runs = { name: "", who, line: add(entry, "program"), count: 1, done: 0, problem: "" };
      if (accepted) runs.done++;
      else runs.problem = entryText(entry);
      if (runs.name) Object.assign(runs.line, { text: runsText(runs), bad: runs.problem !== "" });
    } else if (entry.source === PROGRAM_SOURCE || (request === "JOG_END" && accepted)) {
    } else if (request === "RUN_PROGRAM" && accepted) {
      const name = entry.values.program_name ?? "";
      if (runs?.name === name && runs.who === who && !motions) runs.count++;
      else runs = { name, who, line: add(entry, "program"), count: 1, done: 0, problem: "" };
      if (runs.name) runs.line.text = runsText(runs);
      motions = null;
    } else if (request === "STOP" || request === "RESET" || request === "STOP_AGAIN") {
      add(entry, "stop").bad = request !== "RESET" || !accepted;
      motions = null;
      if (request !== "STOP") runs = null;
    } else if (CONTROL.has(request)) {
      add(entry, "control");
      motions = null;
      runs = null;
    } else if (!accepted) {
      const line = lines.at(-1);
      const text = entrySentence(entry);
      if (line?.text !== text) add(entry, "control");
    } else if (motions?.who === who) {
      motions.count++;
      motions.line.text = d("motions", { who, count: motions.count });
    } else {
      motions = { who, line: add(entry, "control"), count: 1 };
    }
  }
  return lines;
}

/** Runs of one program in a row. */
interface Runs {
  name: string;
  who: string;
  line: DayLine;
  count: number;
  done: number;
  /** How the last one that was not done ended. */
  problem: string;
}

function runsText({ name, who, count, done, problem }: Runs): string {
  const text = d(count === 1 ? "run" : "runs", { who, name, count });
  const parts = [done > 0 && (count === 1 ? d("run_done") : d("runs_done", { count: done })), problem];
  return [text, parts.filter(Boolean).join("; ")].filter(Boolean).join(": ");
}

/** Return the line of an alarm, with its duration if it ended, or of its acknowledgement. */
function eventLine(event: Event, later: readonly Event[]): DayLine[] {
  const { code, severity } = event;
  if (WATCHED.has(code)) return [{ ms: ms(event), kind: "alarm", text: eventText(event) }];
  if (severity < Severity.WARNING || AUDITED.test(code)) return [];
  const title = alarmTitle(code);
  const text = eventText(event);
  const end = later.find(
    (each) =>
      OVER[code]?.includes(each.code) ||
      each.code === `${code}.over` ||
      (each.code === code && each.severity <= Severity.INFO),
  );
  const over = end ? d("over_after", { time: lastedText(ms(end) - ms(event)) }) : "";
  const said = title && !text.includes(title) ? `${title}: ${text}` : text;
  return [{ ms: ms(event), kind: "alarm", text: over ? `${said} (${over})` : said, bad: true }];
}

/** Return each note once, at the time that it is on. */
function noteLines(events: readonly Event[]): DayLine[] {
  const withdrawn = withdrawnIds(events);
  return events.flatMap((event) => {
    if (event.code === WITHDRAWN || event.code !== WRITTEN || !event.note) return [];
    const at = event.note.begin ? timestampMs(event.note.begin) : ms(event);
    return [{ ms: at, kind: "note" as const, text: eventText(event), withdrawn: withdrawn.has(event.note.id) }];
  });
}

/** Return how long the robot was without a link, stopped, or in a program; what no source says is unknown. */
export function totalsOf({ day, now, audit, before, events, eventsFrom }: DaySources): Totals {
  const to = Math.max(day.from, Math.min(day.to, now));
  // Each change with what it sets; a robot without a link counts as offline, then a latched stop counts first.
  const changes: { at: number; set: Partial<Record<keyof Totals, boolean>> }[] = [];
  for (const entry of audit) {
    const { request, outcome, source } = entry;
    const accepted = outcome === Outcome.ACCEPTED;
    if (request === "STOP") changes.push({ at: ms(entry), set: { stopped: true, program: false } });
    else if (request === "RESET" && accepted) changes.push({ at: ms(entry), set: { stopped: false } });
    else if (request === "PROGRAM_END") changes.push({ at: ms(entry), set: { program: false } });
    else if (request === "RUN_PROGRAM" && accepted && source !== PROGRAM_SOURCE)
      changes.push({ at: ms(entry), set: { program: true } });
  }
  for (const event of events) {
    if (eventsFrom === null || ms(event) < eventsFrom) continue;
    if (LINK_GONE.has(event.code)) changes.push({ at: ms(event), set: { offline: true } });
    else if (event.code === "link.up") changes.push({ at: ms(event), set: { offline: false } });
  }
  changes.sort((a, b) => a.at - b.at);
  const totals: Totals = { program: 0, stopped: 0, offline: 0, unknown: 0 };
  const state = { stopped: before?.stopped ?? false, program: false, offline: false };
  let at = day.from;
  const count = (until: number) => {
    const end = Math.min(to, Math.max(at, until));
    totals[state.offline ? "offline" : state.stopped ? "stopped" : state.program ? "program" : "unknown"] += end - at;
    at = end;
  };
  for (const change of changes) {
    count(change.at);
    Object.assign(state, change.set);
  }
  count(to);
  return totals;
}

/** Return the day as plain text, or as a table with commas. */
export function exported(
  lines: readonly DayLine[],
  head: readonly string[],
  time: (ms: number) => string,
  csv: boolean,
): string {
  if (!csv) return [...head, "", ...lines.map((line) => `${time(line.ms)}  ${wordsOf(line)}`), ""].join("\n");
  const cell = (text: string) => {
    // A spreadsheet would calculate a text that begins like a formula.
    const safe = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
    return `"${safe.replaceAll('"', '""')}"`;
  };
  const rows = lines.map((line) => [new Date(line.ms).toISOString(), line.kind, wordsOf(line)].map(cell).join(","));
  return ["time,kind,text", ...rows, ""].join("\r\n");
}

export const wordsOf = ({ text, withdrawn }: DayLine): string => (withdrawn ? `${text} (${d("withdrawn")})` : text);

/** Format a duration [ms]: "3 h 12 min", "4 min 10 s", "9 s". */
export function lastedText(ms: number): string {
  const seconds = Math.round(Math.max(0, ms) / 1000);
  const minutes = Math.floor(seconds / 60);
  if (minutes >= 60) return d("hours", { hours: Math.floor(minutes / 60), minutes: minutes % 60 });
  return minutes ? d("minutes", { minutes, seconds: seconds % 60 }) : d("seconds", { seconds });
}
