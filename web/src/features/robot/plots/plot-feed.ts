// Live numbers of one robot for its plots: each topic with a plotted value is decoded once for all of them.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { signal } from "@preact/signals";
import type { Description } from "../../../gen/robomesh_pb";
import { SeriesAnswerSchema, SeriesRequestSchema } from "../../../gen/robomesh_pb";
import { plotsText as p } from "../../../i18n/texts";
import { ageClock } from "../../../mesh/console/age-clock";
import { AskError, ask, inOwnName, presence, reasonOf, watch } from "../../../mesh/console/connection";
import { staleAfter } from "../../../mesh/state/staleness";
import { learnUnit, readerOf, topicOf, topicsOfValues } from "../../../mesh/state/values";
import { Buckets } from "./plot-buckets";

/** The page always keeps so much of each plotted value [s]. */
export const LIVE_S = 60;
const CLOCK_SET_MS = 5000;
// The recorder may have the newest states a moment later: after so long they are read again.
const RECORDED_MS = 4000;
const AGAIN_S = 15;
const TIMEOUT_S = 30; // the longest that a console waits
const ATTEMPTS = 4;
const POINTS = 3000;

/** A plotted value: its name and the time that its plot spans [s]. */
export interface Wanted {
  name: string;
  span: number;
}

interface Value {
  spans: Map<number, Buckets>;
  newest: number;
  /** When `newest` was measured, on the clock for ages [s]. */
  newestAt: number;
  /** Values since `changedAt` [s] differ from this one by no more than `SEEN`. */
  level: number;
  changedAt: number;
}

interface Topic {
  /** Clock for ages minus publisher's clock at the least delay so far [ms]. */
  ahead: number;
  /** Times of the first and the last live message [s]. */
  liveFrom: number;
  last: number;
  stop: () => void;
  values: Map<string, Value>;
}

/** A part of the time on the clock for ages [s]. */
export interface Span {
  from: number;
  to: number;
}

/** What the recorder has of a plot's time. */
export interface Past {
  /** Requests that are not answered yet. */
  reads: number;
  problem: string;
  recorded: readonly Span[];
}

const NO_PAST: Past = { reads: 0, problem: "", recorded: [] };

export class PlotFeed {
  private readonly topics = new Map<string, Topic>();
  private ended = false;
  /** The recorder's answers by span. */
  readonly past = signal<ReadonlyMap<number, Past>>(new Map());

  /** The robot's, which has the stale time of its joints. */
  description: Description | undefined;

  /** @param jointsTopic The topic that brings the joints, whole or thinned. */
  constructor(
    private readonly robotKey: string,
    private readonly jointsTopic: string,
  ) {}

  /** Follow these values, and no others. */
  want(wanted: readonly Wanted[]): void {
    this.ended = false;
    const added: Wanted[] = [];
    const names = Map.groupBy(wanted, ({ name }) => topicOf(name, topicsOfValues()) ?? "");
    names.delete("");
    for (const [name, topic] of this.topics)
      if (!names.has(name)) {
        topic.stop();
        this.topics.delete(name);
      }
    for (const [name, some] of names) {
      const topic = this.topics.get(name) ?? this.follow(name);
      const kept = new Set(some.map((each) => each.name));
      for (const value of topic.values.keys()) if (!kept.has(value)) topic.values.delete(value);
      for (const { name: own, span } of some) if (keep(topic, own, span)) added.push({ name: own, span });
      for (const [own, value] of topic.values) {
        const spans = new Set([LIVE_S, ...some.filter((each) => each.name === own).map((each) => each.span)]);
        for (const span of value.spans.keys()) if (!spans.has(span)) value.spans.delete(span);
      }
    }
    for (const [span, some] of Map.groupBy(added, (each) => each.span)) {
      const own = some.map(({ name }) => name);
      void this.readPast(span, own, span);
      setTimeout(() => void this.readPast(span, own, AGAIN_S), RECORDED_MS);
    }
  }

  end(): void {
    this.want([]);
    this.ended = true;
  }

  pastOf(span: number): Past {
    return this.past.value.get(span) ?? NO_PAST;
  }

  /** Return when live values of a plot began [s]; infinite: none has arrived. */
  liveFrom(name: string): number {
    return this.topics.get(topicOf(name, [...this.topics.keys()]) ?? "")?.liveFrom ?? Infinity;
  }

  /** Read what was recorded of values in the last `back` s; merging what is known already changes nothing. */
  private async readPast(span: number, names: readonly string[], back: number): Promise<void> {
    if (this.ended) return;
    this.setPast(span, { reads: this.pastOf(span).reads + 1 });
    const problems = await Promise.all(
      [...Map.groupBy(names, (name) => topicOf(name, [...this.topics.keys()]) ?? "")].map(([topic, some]) =>
        this.readTopic(topic, span, some, back).then(
          () => "",
          (error: unknown) => (error instanceof AskError && error.noAnswer ? p("no_recorder") : reasonOf(error)),
        ),
      ),
    );
    this.setPast(span, { reads: this.pastOf(span).reads - 1, problem: problems.find(Boolean) ?? "" });
  }

  private async readTopic(name: string, span: number, names: readonly string[], back: number): Promise<void> {
    const ahead = this.topics.get(name)?.ahead ?? Infinity;
    // Without a live value, as of a robot that is off, the clocks are taken to agree.
    const offset = Number.isFinite(ahead) ? ahead : ageClock() - Date.now();
    const [, site = "", robot = ""] = this.robotKey.split("/");
    if (![...presence.value].some((key) => key.startsWith(`robomesh/${site}/-/alive/recorder/`)))
      throw new Error(p("no_recorder"));
    const width = (span * 1000) / POINTS;
    const points = Math.ceil((back * 1000) / width);
    const startMs = Math.floor((ageClock() - back * 1000) / width) * width - offset;
    const request = {
      robot,
      values: [...names],
      start: timestampFromMs(Math.round(startMs)),
      end: timestampFromMs(Math.round(startMs + (points + 1) * width)),
      points: points + 1,
    };
    const key = inOwnName(`robomesh/${site}/-/recordings/series`);
    const answer = await patiently(() => ask(key, SeriesRequestSchema, request, SeriesAnswerSchema, TIMEOUT_S));
    const zero = (Math.round(startMs) + offset) / 1000;
    for (const { name: own, unit, timesS, lowest, highest } of answer.series) {
      learnUnit(own, unit);
      const buckets = this.buckets(own, span);
      if (buckets?.span === span)
        for (const [i, time] of timesS.entries()) buckets.take(zero + time, lowest[i] ?? 0, highest[i] ?? 0);
    }
    const recorded = answer.recorded.map(({ startS, endS }) => ({ from: zero + startS, to: zero + endS }));
    this.setPast(span, { recorded: joined([...this.pastOf(span).recorded, ...recorded], ageClock() / 1000 - span) });
  }

  private setPast(span: number, changed: Partial<Past>): void {
    this.past.value = new Map(this.past.peek()).set(span, {
      ...(this.past.peek().get(span) ?? NO_PAST),
      ...changed,
    });
  }

  buckets(name: string, span: number): Buckets | undefined {
    return this.value(name)?.spans.get(Math.max(span, LIVE_S));
  }

  /** Return a value's newest number; null: none, or it is stale. */
  newest(name: string): number | null {
    const value = this.value(name);
    return value && ageClock() / 1000 - value.newestAt <= this.holdOf(name) ? value.newest : null;
  }

  /** Return how long a value is valid [s]: later, a plot has a gap. */
  holdOf(name: string): number {
    return this.holdOfTopic(topicOf(name, topicsOfValues()) ?? "");
  }

  private holdOfTopic(topic: string): number {
    const after = staleAfter(topic, this.description);
    return Number.isFinite(after) ? after : 3600;
  }

  /** Return whether a value has arrived, also if it is stale now. */
  has(name: string): boolean {
    return (this.value(name)?.newestAt ?? -Infinity) > -Infinity;
  }

  /** Return whether the drawn curve of a value is level over the last `span` s, to the right edge. */
  isLevel(name: string, span: number, now: number): boolean {
    const value = this.value(name);
    return value !== undefined && value.changedAt < now - span && value.newestAt > now - this.holdOf(name);
  }

  private value(name: string): Value | undefined {
    return this.topics.get(topicOf(name, [...this.topics.keys()]) ?? "")?.values.get(name);
  }

  private follow(name: string): Topic {
    const topic: Topic = {
      ahead: Infinity,
      liveFrom: Infinity,
      last: Infinity,
      values: new Map(),
      stop: () => undefined,
    };
    this.topics.set(name, topic);
    const read = readerOf(name);
    if (!read) return topic;
    topic.stop = watch(`${this.robotKey}/${name === "joints" ? this.jointsTopic : name}`, (sample) => {
      if (!sample.live) return;
      const early = ageClock() - sample.sourceTime;
      if (early < topic.ahead || early - topic.ahead > CLOCK_SET_MS) topic.ahead = early;
      // By source time: delayed samples are drawn at the time of their measurement.
      const at = (sample.sourceTime + topic.ahead) / 1000;
      topic.liveFrom = Math.min(topic.liveFrom, at);
      if (at - topic.last > this.holdOfTopic(name)) this.onGap(topic, at - topic.last);
      topic.last = at;
      read(sample.payload, (own, number) => {
        const value = topic.values.get(own);
        if (value && Number.isFinite(number)) take(value, at, number, seen(own));
      });
    });
    return topic;
  }

  /** Read what the page missed, for example without a connection. */
  private onGap(topic: Topic, length: number): void {
    const spans = new Set([...topic.values.values()].flatMap((value) => [...value.spans.keys()]));
    for (const span of spans) {
      if (span <= LIVE_S) continue;
      const names = [...topic.values].filter(([, value]) => value.spans.has(span)).map(([name]) => name);
      const back = Math.min(span, length + AGAIN_S);
      setTimeout(() => void this.readPast(span, names, back), RECORDED_MS);
    }
  }
}

/** Return spans without overlaps, from a time on. */
function joined(spans: readonly Span[], since: number): Span[] {
  const found: Span[] = [];
  for (const { from, to } of [...spans].sort((a, b) => a.from - b.from)) {
    const last = found.at(-1);
    if (to < since) continue;
    if (last && from <= last.to) last.to = Math.max(last.to, to);
    else found.push({ from, to });
  }
  return found;
}

/** Repeat a request that is not answered: the recorder goes on, and what it has read it need not read again. */
async function patiently<T>(request: () => Promise<T>): Promise<T> {
  for (let left = ATTEMPTS; ; ) {
    const started = ageClock();
    try {
      return await request();
    } catch (error) {
      // An answer that came at once was that there is no recorder.
      const slow = error instanceof AskError && error.noAnswer && ageClock() - started > (TIMEOUT_S * 1000) / 2;
      if (!slow || --left === 0) throw error;
    }
  }
}

/** Return the change that a plot shows: half a pixel of the smallest range. */
function seen(name: string): number {
  return name.startsWith("joints/") && name.endsWith("/position") ? 3e-4 : 0;
}

/** Keep a value over a span; return whether its past is not known yet. */
function keep(topic: Topic, name: string, span: number): boolean {
  let value = topic.values.get(name);
  if (!value) {
    const live = new Map([[LIVE_S, new Buckets(LIVE_S)]]);
    value = { spans: live, newest: 0, newestAt: -Infinity, level: NaN, changedAt: -Infinity };
    topic.values.set(name, value);
  }
  if (span <= LIVE_S || value.spans.has(span)) return false;
  const made = new Buckets(span);
  for (const known of [...value.spans.values()].filter((each) => each.span < span)) made.takeAll(known);
  value.spans.set(span, made);
  return true;
}

function take(value: Value, at: number, number: number, change: number): void {
  for (const buckets of value.spans.values()) buckets.take(at, number);
  if (!(Math.abs(number - value.level) <= change)) {
    value.level = number;
    value.changedAt = at;
  }
  if (at >= value.newestAt) {
    value.newest = number;
    value.newestAt = at;
  }
}
