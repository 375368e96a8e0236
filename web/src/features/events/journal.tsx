// Events and audit entries of all robots and services, newest first, with filters.

import { useEffect, useState } from "preact/hooks";
import type { Note } from "../../gen/robomesh_pb";
import { AuditEntry_Outcome as Outcome, Event_Severity as Severity } from "../../gen/robomesh_pb";
import { alarmTitle } from "../../i18n/alarm-text";
import { entrySentence, entryText } from "../../i18n/audit-text";
import { eventText } from "../../i18n/event-text";
import { count, dateOf, stampFull, timeOfDay } from "../../i18n/format";
import { eventsText as e, notesText as n } from "../../i18n/texts";
import { reasonOf } from "../../mesh/console/connection";
import type { Notice } from "../../mesh/control/control";
import { mayWithdraw, readNotes, WRITTEN, withdrawNote, withdrawnIds } from "../../mesh/services/notes";
import { fleetRobots } from "../../mesh/state/known-robots";
import { Withdrawable } from "../../panels/note-form";
import { Button } from "../../ui/inputs/button";
import { Choice, Toggle } from "../../ui/inputs/choice";
import { Select } from "../../ui/inputs/select";
import { TextInput } from "../../ui/inputs/text-input";
import { Mark, outcomeMark, severityMark } from "../../ui/marks/event-mark";
import { programLink } from "../../ui/page/route";
import { NoticeLine } from "../../ui/panel/notice-line";
import { useOutcome } from "../../ui/panel/outcome";
import { SeenPicture } from "../../video/seen-picture";
import { Filters, SiteSelect } from "./alarm-panel";
import { MAX_ROBOTS, searchAuditLogs } from "./audit-log-search";
import { DayView } from "./day-view";
import type { AuditLine, EventEntry } from "./entries";
import { audits, eventEntries, events, MAX_ENTRIES, useEntries } from "./entries";
import { VirtualList } from "./virtual-list";

const KINDS = ["events", "notes", "requests", "day"] as const;
const KIND_TEXTS = {
  events: "journal_events",
  notes: "journal_notes",
  requests: "journal_requests",
  day: "journal_day",
} as const;
const LEAST = { any_severity: Severity.DEBUG, from_warning: Severity.WARNING, from_error: Severity.ERROR } as const;
const SINCE_S = { any_time: Number.POSITIVE_INFINITY, last_hour: 3600, last_day: 86_400 } as const;
const WHAT = { any_outcome: null, outcome_refused: Outcome.REFUSED, outcome_failed: Outcome.FAILED } as const;
type Entry = EventEntry | AuditLine;

export function Journal() {
  useEntries();
  const [kind, setKind] = useState<(typeof KINDS)[number]>("events");
  const [least, setLeast] = useState<keyof typeof LEAST>("any_severity");
  const [outcome, setOutcome] = useState<keyof typeof WHAT>("any_outcome");
  const [since, setSince] = useState<keyof typeof SINCE_S>("any_time");
  const [site, setSite] = useState("");
  const [robot, setRobot] = useState("");
  const [text, setText] = useState("");
  const [pausedEntries, setPausedEntries] = useState<readonly Entry[] | null>(null);
  const [open, setOpen] = useState<Entry | null>(null);
  const [notice, setNotice] = useState<Notice | null>(null);
  const lineHeight = useLineHeight();
  useEffect(() => {
    setPausedEntries(null);
    setOpen(null);
    setNotice(null);
  }, [kind]);

  const newest: readonly Entry[] = kind === "requests" ? audits.newest.value : events.newest.value;
  const all = pausedEntries ?? newest;
  const searchText = text.trim().toLowerCase();
  const from = Date.now() - SINCE_S[since] * 1000;
  const listed = all.filter(
    (entry) =>
      entry.ms >= from &&
      (!site || entry.site === site) &&
      (!robot || entry.robot === robot) &&
      (kind !== "notes" || isNote(entry)) &&
      ("event" in entry
        ? kind === "notes" || entry.event.severity >= LEAST[least]
        : WHAT[outcome] === null || entry.audit.outcome === WHAT[outcome]) &&
      (!searchText || wordsOf(entry).toLowerCase().includes(searchText)),
  );
  const withdrawn = withdrawnIds(events.newest.value.map(({ event }) => event));
  const isWithdrawn = (entry: Entry) =>
    "event" in entry && entry.event.code === WRITTEN && withdrawn.has(entry.event.note?.id ?? "");
  const robots = fleetRobots.value.filter((key) => !site || key.split("/")[1] === site);
  const sites = [
    ...new Set([...fleetRobots.value.map((key) => key.split("/")[1] ?? ""), ...all.map((entry) => entry.site)]),
  ];
  // Of a day there is one robot at a time.
  const dayKey = robots.find((key) => key.split("/")[2] === robot) ?? robots[0];
  const names = [...new Set(robots.map((key) => key.split("/")[2] ?? ""))].sort();

  const chosenRobots = (): readonly string[] | null => {
    const keys = robots.filter((key) => !robot || key.split("/")[2] === robot);
    if (keys.length <= MAX_ROBOTS) return keys;
    setNotice({ kind: "refused", text: e("older_many", { count: keys.length, most: MAX_ROBOTS }) });
    return null;
  };
  const readOlderNotes = async () => {
    const keys = chosenRobots();
    if (!keys) return;
    setNotice({ kind: "busy", text: n("older_busy", { count: keys.length }) });
    const part = Number.isFinite(from) ? { since: from } : {};
    const answers = await Promise.allSettled(keys.map((key) => readNotes(key, part)));
    const failed = answers.flatMap((answer, i) =>
      answer.status === "rejected"
        ? [n("older_failed", { robot: (keys[i] ?? "").replace("robomesh/", ""), text: reasonOf(answer.reason) })]
        : [],
    );
    const found = answers.map((answer) => (answer.status === "fulfilled" ? answer.value : []));
    found.forEach((some, i) => {
      events.take(eventEntries(`${keys[i] ?? ""}/events/store`, some));
    });
    events.settle();
    const count = found.flat().filter(({ code }) => code === WRITTEN).length;
    setNotice({
      kind: failed.length ? "refused" : "done",
      text: [n("older_done", { count }), ...failed].join(" "),
    });
  };
  const search = async () => {
    const keys = chosenRobots();
    if (!keys) return;
    setNotice({ kind: "busy", text: e("older_busy", { count: keys.length }) });
    const found = await searchAuditLogs(keys, SINCE_S[since]);
    audits.take(found.entries);
    audits.settle();
    const failed = found.failed.map((each) => e("older_failed", each)).join(" ");
    const text = `${e("older_done", { count: found.entries.length })} ${failed}`.trim();
    setNotice({ kind: failed ? "refused" : "done", text });
  };

  return (
    <section class="panel journal" aria-label={e("journal")}>
      <div class="panel-head">
        <h2>{e("journal")}</h2>
        <Choice
          label={e("journal_kind")}
          values={KINDS}
          chosen={kind}
          text={(each) => e(KIND_TEXTS[each])}
          choose={setKind}
        />
        <span class="panel-end">
          {kind !== "day" && (
            <span class="dim small">{e("shown_of", { shown: count(listed.length), all: count(all.length) })}</span>
          )}
          {kind !== "day" && (
            <Toggle
              text={
                pausedEntries ? e("go_on", { count: Math.max(0, newest.length - pausedEntries.length) }) : e("pause")
              }
              on={pausedEntries !== null}
              set={(on) => setPausedEntries(on ? newest : null)}
            />
          )}
        </span>
      </div>
      <Filters>
        {kind === "events" ? (
          <Select label={e("severity")} value={least} values={keysOf(LEAST)} text={e} choose={setLeast} />
        ) : kind === "requests" ? (
          <Select label={e("outcome")} value={outcome} values={keysOf(WHAT)} text={outcomeText} choose={setOutcome} />
        ) : null}
        {kind !== "day" && (
          <Select label={e("time")} value={since} values={keysOf(SINCE_S)} text={e} choose={setSince} />
        )}
        <SiteSelect site={site} sites={sites} choose={(name) => (setSite(name), setRobot(""))} />
        <Select
          label={e("robot")}
          value={kind === "day" ? (dayKey?.split("/")[2] ?? "") : robot}
          values={kind === "day" ? names : ["", "-", ...names]}
          text={(name) => (name === "-" ? e("whole_site") : name || e("all_robots"))}
          choose={setRobot}
        />
        {kind !== "day" && (
          <TextInput
            type="search"
            placeholder={e("search")}
            aria-label={`${e("search")}, ${e("journal")}`}
            value={text}
            set={setText}
          />
        )}
        {kind === "notes" && (
          <button class="action push" onClick={() => void readOlderNotes()}>
            {n("older")}
          </button>
        )}
        {kind === "requests" && (
          <button class="action push" title={e("older_hint")} onClick={() => void search()}>
            {e("older")}
          </button>
        )}
      </Filters>
      {notice && (kind === "notes" || kind === "requests") && <NoticeLine notice={notice} />}
      {kind === "day" ? (
        dayKey ? (
          <DayView key={dayKey} robotKey={dayKey} events={events.newest.value} />
        ) : (
          <p class="empty">{e("no_entries")}</p>
        )
      ) : listed.length === 0 ? (
        <p class="empty">{e(all.length ? "no_entries_match" : "no_entries")}</p>
      ) : (
        <VirtualList
          label={e("journal")}
          items={listed}
          lineHeight={lineHeight}
          line={(entry) => (
            <Line
              key={entry.id}
              entry={entry}
              open={entry.id === open?.id}
              withdrawn={isWithdrawn(entry)}
              choose={setOpen}
            />
          )}
        />
      )}
      {open && <Details key={open.id} entry={open} withdrawn={isWithdrawn(open)} close={() => setOpen(null)} />}
      {kind !== "day" && all.length >= MAX_ENTRIES && (
        <p class="footnote dim">{e("oldest_left_out", { count: count(MAX_ENTRIES) })}</p>
      )}
    </section>
  );
}

function isNote(entry: Entry): boolean {
  return "event" in entry && entry.event.note !== undefined;
}

function keysOf<T extends object>(table: T): (keyof T & string)[] {
  return Object.keys(table) as (keyof T & string)[];
}

function outcomeText(name: keyof typeof WHAT): string {
  return name === "any_outcome" ? e(name) : outcomeMark(WHAT[name] ?? Outcome.REFUSED).text;
}

function wordsOf(entry: Entry): string {
  if ("event" in entry) {
    const { text, code, source } = entry.event;
    return `${entry.site}/${entry.robot} ${source} ${code} ${text} ${eventText(entry.event)} ${alarmTitle(code) ?? ""}`;
  }
  const { operator, source, request, text } = entry.audit;
  return `${entry.site}/${entry.robot} ${operator} ${source} ${request} ${text} ${entryText(entry.audit)}`;
}

function Line(props: { entry: Entry; open: boolean; withdrawn: boolean; choose: (entry: Entry) => void }) {
  const { entry, open, choose } = props;
  const stamp = "event" in entry ? entry.event.timestamp : entry.audit.timestamp;
  return (
    <button class="journal-line pick grid gap-0-12 pad-0-16" aria-expanded={open} onClick={() => choose(entry)}>
      <time class="dim clip" title={stampFull(stamp)}>
        {dayTime(entry.ms)}
      </time>
      <span class="dim clip">{entry.robot === "-" ? entry.site : `${entry.site}/${entry.robot}`}</span>
      <span class="journal-text clip">
        <Withdrawable withdrawn={props.withdrawn}>
          {"event" in entry ? <EventWords entry={entry} /> : <AuditWords entry={entry} />}
        </Withdrawable>
      </span>
    </button>
  );
}

function EventWords({ entry: { event } }: { entry: EventEntry }) {
  const mark = severityMark(event.severity);
  const [title, text] = [alarmTitle(event.code), eventText(event)];
  // A translated text needs no title; the end of an alarm has that alarm's code.
  const titled = title && text === event.text && event.severity > Severity.INFO;
  return (
    <>
      {mark.level !== "normal" && <Mark {...mark} />} {titled && <strong>{title}</strong>}{" "}
      <span lang={text === event.text ? "en" : undefined}>{text}</span>
    </>
  );
}

function AuditWords({ entry: { audit } }: { entry: AuditLine }) {
  const mark = outcomeMark(audit.outcome);
  const repeated = audit.repeatedCount > 0n ? ` × ${count(audit.repeatedCount)}` : "";
  return (
    <>
      {mark.level !== "normal" && <Mark {...mark} />} {entrySentence(audit)}
      {repeated}
    </>
  );
}

/** All of one entry, below the list, because a line is cut off. */
function Details({ entry, withdrawn, close }: { entry: Entry; withdrawn: boolean; close: () => void }) {
  const event = "event" in entry ? entry.event : null;
  const audit = "audit" in entry ? entry.audit : null;
  const original = event?.text ?? audit?.text ?? "";
  const facts: [string, string][] = [
    [e("time"), stampFull(event?.timestamp ?? audit?.timestamp)],
    [e("entry_source"), event?.source ?? audit?.source ?? ""],
    [event ? e("entry_code") : e("entry_number"), event?.code ?? String(audit?.number ?? "")],
    ...Object.entries(event?.values ?? audit?.values ?? {}),
  ];
  return (
    <div class="entry-details ruled pad-8-16" role="region" aria-label={e("entry")}>
      <p>{"event" in entry ? <EventWords entry={entry} /> : <AuditWords entry={entry} />}</p>
      {!original.includes(event ? eventText(event) : audit ? entryText(audit) : "") && (
        <p class="dim">
          {e("in_its_words")} <span lang="en">{original}</span>
        </p>
      )}
      <dl>
        {facts.map(([name, value]) => (
          <div key={name}>
            <dt class="dim">{name}</dt>
            <dd>
              {name === "program_sha256" ? <a href={programLink(entry.site, entry.robot, value)}>{value}</a> : value}
            </dd>
          </div>
        ))}
      </dl>
      {audit && <SeenPicture site={entry.site} robot={entry.robot} entry={audit} />}
      <Button quiet text={e("close")} onClick={close} />
      {event?.code === WRITTEN && event.note && !withdrawn && mayWithdraw(event.note) && (
        <Withdraw robotKey={`robomesh/${entry.site}/${entry.robot}`} note={event.note} />
      )}
    </div>
  );
}

/** A button that withdraws a note; the list then shows it struck through. */
function Withdraw({ robotKey, note }: { robotKey: string; note: Note }) {
  const { notice, perform } = useOutcome();
  const withdraw = () => perform("", async () => void (await withdrawNote(robotKey, note)));
  return (
    <>
      <Button quiet destructive text={n("withdraw")} title={n("withdraw_hint")} onClick={() => void withdraw()} />
      {notice && <NoticeLine notice={notice} />}
    </>
  );
}

/** Return the time of day, with the date unless it is today's. */
function dayTime(ms: number): string {
  const date = dateOf(ms);
  return date === dateOf(Date.now()) ? timeOfDay(ms) : `${date.slice("2026-".length)} ${timeOfDay(ms)}`;
}

const NARROW = matchMedia("(max-width: 899px)");

/** px: on a phone, a line's text is below its time. */
function useLineHeight(): number {
  const [narrow, setNarrow] = useState(NARROW.matches);
  useEffect(() => {
    const changed = () => setNarrow(NARROW.matches);
    NARROW.addEventListener("change", changed);
    return () => NARROW.removeEventListener("change", changed);
  }, []);
  return narrow ? 88 : 32;
}
