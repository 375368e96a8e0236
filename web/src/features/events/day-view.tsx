// The history of one robot's day in sentences, by hour, with how long it was stopped, without a link, or in a program.

import { useEffect, useState } from "preact/hooks";
import { count, DASH, dateOf, timeOfDay, timeText, whenText, zoneOf } from "../../i18n/format";
import type { NameIn } from "../../i18n/texts";
import { dayText as d } from "../../i18n/texts";
import { lostAt } from "../../mesh/console/connection";
import { Button } from "../../ui/inputs/button";
import { Warning } from "../../ui/marks/warning";
import { saveFile } from "../../ui/page/save-file";
import type { DayLine, Totals } from "./day";
import { exported, lastedText, linesOf, spanOfDay, totalsOf, wordsOf } from "./day";
import type { DayAnswers } from "./day-sources";
import { eventsAbout, knownFrom, readDay } from "./day-sources";
import type { EventEntry } from "./entries";
import "./day-view.css";

const REFRESH_MS = 10_000;
const TOTALS: readonly (keyof Totals & NameIn<"day">)[] = ["program", "stopped", "offline", "unknown"];

export function DayView({ robotKey, events }: { robotKey: string; events: readonly EventEntry[] }) {
  const [date, setDate] = useState(() => dateOf(Date.now()));
  const span = spanOfDay(date);
  const answers = useDay(robotKey, date);
  const step = (by: number) => {
    if (span) setDate(dateOf(by < 0 ? span.from - 1 : span.to));
  };
  return (
    <>
      <div class="row wrap gap-8 pad-0-16-8">
        <Button text="←" aria-label={d("earlier")} title={d("earlier")} onClick={() => step(-1)} />
        <input
          type="date"
          aria-label={d("day")}
          value={date}
          max={dateOf(Date.now())}
          onChange={(event) => spanOfDay(event.currentTarget.value) && setDate(event.currentTarget.value)}
        />
        <Button
          text="→"
          aria-label={d("later")}
          title={d("later")}
          disabled={!span || span.to > Date.now()}
          onClick={() => step(1)}
        />
        {span && <span class="dim small">{zoneOf(span.from)}</span>}
        {answers && <Sentences robotKey={robotKey} date={date} answers={answers} events={events} />}
      </div>
      {!answers && <p class="empty">{d("reading")}</p>}
      {answers && <Hours robotKey={robotKey} answers={answers} events={events} />}
    </>
  );
}

/** Return the answers for a day; null: not yet. The present day is read again and again. */
function useDay(robotKey: string, date: string): DayAnswers | null {
  const [answers, setAnswers] = useState<{ of: string; value: DayAnswers } | null>(null);
  const of = `${robotKey} ${date}`;
  const connected = lostAt.value === null;
  useEffect(() => {
    const day = spanOfDay(date);
    if (!day || !connected) return;
    let timer: ReturnType<typeof setTimeout> | undefined;
    let wanted = true;
    const read = async () => {
      const value = await readDay(robotKey, day);
      if (!wanted) return;
      setAnswers({ of, value });
      if (day.to > Date.now()) timer = setTimeout(() => void read(), REFRESH_MS);
    };
    void read();
    return () => {
      wanted = false;
      clearTimeout(timer);
    };
  }, [of, connected]);
  return answers?.of === of ? answers.value : null;
}

/** Return what the day's sentences and times are made of. */
function sourcesOf(
  robotKey: string,
  { day, audit, before, notes, recordings }: DayAnswers,
  events: readonly EventEntry[],
) {
  const known = eventsAbout(robotKey, events);
  const ids = new Set(notes.map(({ code, note }) => `${code} ${note?.id}`));
  const others = known.filter(({ code, note }) => !note || !ids.has(`${code} ${note.id}`));
  return {
    day,
    now: Date.now(),
    audit,
    before,
    events: [...others, ...notes],
    eventsFrom: knownFrom(known),
    recordings,
  };
}

/** The buttons that save the day as a file. */
function Sentences(props: { robotKey: string; date: string; answers: DayAnswers; events: readonly EventEntry[] }) {
  const name = props.robotKey.split("/").slice(1).join("/");
  const save = (csv: boolean) => {
    const sources = sourcesOf(props.robotKey, props.answers, props.events);
    const totals = totalsOf(sources);
    const head = [
      `${name}  ${props.date}  ${zoneOf(props.answers.day.from)}`,
      ...TOTALS.map((each) => `${d(each)}: ${totalText(each, totals, props.answers, sources.eventsFrom)}`),
      ...missing(props.answers, sources.eventsFrom),
    ];
    const text = exported(linesOf(sources), head, timeOfDay, csv);
    const blob = new Blob([text], { type: csv ? "text/csv" : "text/plain" });
    saveFile(blob, `${name.replace("/", "-")}-${props.date}.${csv ? "csv" : "txt"}`);
  };
  return (
    <span class="flex push gap-8">
      <Button text={d("as_text")} title={d("save_hint")} onClick={() => save(false)} />
      <Button text={d("as_csv")} title={d("save_hint")} onClick={() => save(true)} />
    </span>
  );
}

function Hours({
  robotKey,
  answers,
  events,
}: {
  robotKey: string;
  answers: DayAnswers;
  events: readonly EventEntry[];
}) {
  const sources = sourcesOf(robotKey, answers, events);
  const [lines, totals] = [linesOf(sources), totalsOf(sources)];
  const gaps = missing(answers, sources.eventsFrom);
  const hours = Map.groupBy(lines, ({ ms }) => `${timeOfDay(ms).slice(0, 2)}:00`);
  return (
    <>
      <dl class="day-totals grid ruled gap-8-16 pad-8-16">
        {TOTALS.map((name) => (
          <div key={name} title={name === "unknown" ? d("unknown_hint") : undefined}>
            <dt class="dim small">{d(name)}</dt>
            <dd class="figure">{totalText(name, totals, answers, sources.eventsFrom)}</dd>
          </div>
        ))}
      </dl>
      {gaps.length > 0 && (
        <Warning
          class="day-gaps flex gap-8 pad-8-16 state warning"
          text={<span>{[d("incomplete"), ...gaps].join(" ")}</span>}
        />
      )}
      <div class="day-hours scroll ruled pad-0-16-8" tabIndex={0} role="group" aria-label={d("day")}>
        {lines.length === 0 && <p class="empty">{d(answers.day.from > Date.now() ? "future" : "nothing")}</p>}
        {[...hours].map(([hour, some]) => (
          <section key={hour} aria-label={hour}>
            <h3>{hour}</h3>
            <ol>
              {some.map((line, i) => (
                <Sentence key={i} line={line} />
              ))}
            </ol>
          </section>
        ))}
      </div>
    </>
  );
}

function Sentence({ line }: { line: DayLine }) {
  return (
    <li>
      <time class="dim" title={timeText(line.ms)}>
        {timeOfDay(line.ms)}
      </time>
      <span class="dim small">{d(`kind_${line.kind}`)}</span>
      <span class="day-text break">
        {line.bad && <span class="shape warning" aria-hidden="true" />}
        {line.withdrawn ? <del>{line.text}</del> : wordsOf(line)}
      </span>
    </li>
  );
}

/** Return a total; a dash if its source is missing, because nothing was counted. */
function totalText(name: keyof Totals, totals: Totals, { problems }: DayAnswers, eventsFrom: number | null): string {
  const missing = name === "offline" ? eventsFrom === null : name !== "unknown" && problems.audit !== "";
  return missing ? DASH : lastedText(totals[name]);
}

/** Return in sentences what is not known of the day. */
function missing({ day, problems, cutAt, audit }: DayAnswers, eventsFrom: number | null): string[] {
  const gaps: string[] = [];
  if (problems.audit) gaps.push(d("no_audit", { text: problems.audit }));
  if (cutAt !== null) gaps.push(d("cut_audit", { count: count(audit.length), time: whenText(cutAt, cutAt) }));
  if (eventsFrom === null || eventsFrom >= day.to) gaps.push(d("no_events"));
  else if (eventsFrom > day.from) gaps.push(d("events_from", { time: whenText(eventsFrom, eventsFrom) }));
  if (problems.notes) gaps.push(d("no_notes", { text: problems.notes }));
  if (problems.recordings) gaps.push(d("no_recordings", { text: problems.recordings }));
  return gaps;
}
