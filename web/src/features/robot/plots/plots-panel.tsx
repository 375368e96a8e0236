// Plots of any numbers of a robot, live.

import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Description } from "../../../gen/robomesh_pb";
import { ageText, DASH, fixed, jointTitle, whenText } from "../../../i18n/format";
import { fullSignalText } from "../../../i18n/signals";
import { message, plotsText as p } from "../../../i18n/texts";
import { commonOf, shownUnit } from "../../../i18n/units";
import { ageClock } from "../../../mesh/console/age-clock";
import { hello, watch } from "../../../mesh/console/connection";
import { now } from "../../../mesh/state/topics";
import { readerOf, topicsOfValues, unitOf } from "../../../mesh/state/values";
import { ValueChoice } from "../../../panels/value-choice";
import { jointsTopic } from "../../../scene/topic-selection";
import { Button } from "../../../ui/inputs/button";
import { Toggle } from "../../../ui/inputs/choice";
import { Select } from "../../../ui/inputs/select";
import type { Plot } from "../../../ui/page/layout";
import { MOST_FIELDS, MOST_PLOTS, RANGES } from "../../../ui/page/layout";
import { Panel } from "../../../ui/panel/panel";
import { CurveMark } from "../../../ui/plots/curve-mark";
import { CURVES } from "../../../ui/plots/plot-appearance";
import type { Frozen, Shown } from "./live-chart";
import { LiveChart, missingOf } from "./live-chart";
import type { Past } from "./plot-feed";
import { LIVE_S, PlotFeed } from "./plot-feed";
import "./plots-panel.css";

const DASHES = ["", "dashed", "dotted"] as const;
const LOOK_MS = 1000;

export function PlotsPanel(props: {
  robotKey: string;
  description: Description | undefined;
  plots: readonly Plot[];
  setPlots: (plots: readonly Plot[]) => void;
}) {
  const { robotKey, description, plots } = props;
  const topic = jointsTopic(robotKey);
  const feed = useMemo(() => new PlotFeed(robotKey, topic), [robotKey, topic]);
  feed.description = description;
  useEffect(() => () => feed.end(), [feed]);
  const [pausedAt, setPausedAt] = useState<number | null>(null);
  const joints = (description?.joints ?? []).map(({ name }) => `joints/${name}/position`);
  const fieldsOf = ({ fields }: Plot) => fields ?? joints;
  const wanted = plots.flatMap((plot) => fieldsOf(plot).map((name) => ({ name, span: plot.seconds })));
  const topics = hello.value?.values.length ?? 0;
  // Before the plots' own effects, which copy what the feed keeps.
  useLayoutEffect(() => feed.want(wanted), [feed, topics, JSON.stringify(wanted)]);
  // A plot that is removed takes its zoom and its open choice with it.
  const ids = useRef<number[]>([]);
  const nextId = useRef(0);
  ids.current.length = Math.min(ids.current.length, plots.length);
  while (ids.current.length < plots.length) ids.current.push(nextId.current++);
  const change = (index: number, changed: Partial<Plot> | null) => {
    if (changed === null) ids.current.splice(index, 1);
    props.setPlots(
      plots.flatMap((plot, i) => (i !== index ? [plot] : changed === null ? [] : [{ ...plot, ...changed }])),
    );
  };
  return (
    <Panel
      name="history"
      title={p("plots")}
      end={
        <>
          {pausedAt !== null && (
            <span class="nowrap warned">
              {p("paused_at", { time: whenText(Date.now() - ageClock() + pausedAt * 1000) })}
            </span>
          )}
          <Toggle text={p("pause")} on={pausedAt !== null} set={(on) => setPausedAt(on ? ageClock() / 1000 : null)} />
          <button
            class="toggle"
            disabled={plots.length >= MOST_PLOTS}
            onClick={() => props.setPlots([...plots, { fields: [], seconds: 60 }])}
          >
            {p("add")}
          </button>
        </>
      }
    >
      <div class="plot-cards stack grow short">
        {plots.length === 0 && <p class="plot-none dim">{p("no_plots")}</p>}
        {plots.map((plot, i) => (
          <PlotCard
            key={ids.current[i]}
            number={i + 1}
            robotKey={robotKey}
            description={description}
            feed={feed}
            fields={fieldsOf(plot)}
            seconds={plot.seconds}
            pausedAt={pausedAt}
            pause={setPausedAt}
            change={(changed) => change(i, changed)}
          />
        ))}
      </div>
    </Panel>
  );
}

function PlotCard(props: {
  number: number;
  robotKey: string;
  description: Description | undefined;
  feed: PlotFeed;
  fields: readonly string[];
  seconds: number;
  pausedAt: number | null;
  pause: (at: number | null) => void;
  /** Change the plot; null: remove it. */
  change: (changed: Partial<Plot> | null) => void;
}) {
  const { number, description, feed, fields, seconds, pausedAt } = props;
  const [choosing, setChoosing] = useState(false);
  const [zoomed, setZoomed] = useState<Shown | null>(null);
  const [moment, setMoment] = useState<number | null>(null);
  const frozen = useFrozen(feed, fields, seconds, pausedAt);
  useEffect(() => {
    if (pausedAt === null) setZoomed(null);
  }, [pausedAt, seconds]);
  const title = p("plot", { number });
  const unit = (name: string) => unitOf(name, description);
  const common = commonOf(fields);
  const zoom = (shown: Shown | null) => {
    setZoomed(shown);
    if (shown && pausedAt === null) props.pause(ageClock() / 1000);
  };
  return (
    <section class="plot-card stack" aria-label={title}>
      <div class="plot-head flex spread gap-8">
        <Legend {...{ fields, feed, description, common, unit, frozen, moment, seconds }} />
        <div class="plot-tools row gap-4">
          {zoomed && <Button quiet text={p("whole")} onClick={() => zoom(null)} />}
          <Select
            label={p("range", { number })}
            value={String(seconds)}
            values={RANGES.map(String)}
            text={(each) => rangeText(Number(each))}
            choose={(each) => props.change({ seconds: Number(each) })}
          />
          <Toggle text={p("fields")} label={p("fields_of", { number })} on={choosing} set={setChoosing} />
          <button class="quiet" aria-label={p("remove", { number })} onClick={() => props.change(null)}>
            <span aria-hidden="true">×</span>
          </button>
        </div>
      </div>
      {choosing ? (
        <KnownValues
          robotKey={props.robotKey}
          description={description}
          chosen={fields}
          choose={(chosen) => props.change({ fields: chosen })}
        />
      ) : fields.length === 0 ? (
        <div class="plot">
          <p class="plot-word grid center dim">{p("no_fields")}</p>
        </div>
      ) : (
        <LiveChart
          label={title}
          curves={fields.map((name) => ({ name, unit: shownUnit(unit(name)) }))}
          feed={feed}
          frozen={frozen}
          seconds={seconds}
          zoomed={zoomed}
          zoom={zoom}
          hover={setMoment}
        />
      )}
      {seconds > LIVE_S && <PastLine past={feed.pastOf(seconds)} fields={fields} feed={feed} seconds={seconds} />}
    </section>
  );
}

/** What the recorder has of the plot's time, in words. */
function PastLine(props: { past: Past; fields: readonly string[]; feed: PlotFeed; seconds: number }) {
  const { past, fields, feed, seconds } = props;
  now.value; // the time passes
  const end = ageClock() / 1000;
  const live = Math.min(end, ...fields.map((name) => feed.liveFrom(name)));
  const missing = missingOf(past.recorded, { from: end - seconds, to: live });
  const lacking = missing.reduce((sum, { from, to }) => sum + to - from, 0);
  const text = past.problem
    ? p("past_problem", { text: past.problem })
    : past.reads > 0 && past.recorded.length === 0
      ? p("past_reading")
      : lacking < 1
        ? p("past_whole")
        : past.recorded.length === 0
          ? p("past_none")
          : p("past_lacks", { time: ageText(lacking) });
  return <p class={`footnote ${past.problem ? "warned" : "dim"}`}>{text}</p>;
}

/** Return copies of the plot's curves as they were when it was paused; null: it is live. */
function useFrozen(feed: PlotFeed, fields: readonly string[], seconds: number, pausedAt: number | null): Frozen | null {
  const [frozen, setFrozen] = useState<Frozen | null>(null);
  const past = feed.pastOf(seconds); // may arrive later
  useEffect(() => {
    if (pausedAt === null) return setFrozen(null);
    const kept = fields.map((name) => [name, feed.buckets(name, seconds)?.copy()] as const);
    setFrozen({ end: pausedAt, buckets: new Map(kept) });
  }, [feed, fields.join(" "), seconds, pausedAt, past]);
  return frozen;
}

function Legend(props: {
  fields: readonly string[];
  feed: PlotFeed;
  description: Description | undefined;
  common: string;
  unit: (name: string) => string;
  frozen: Frozen | null;
  moment: number | null;
  seconds: number;
}) {
  const { fields, feed, frozen, moment, seconds } = props;
  now.value; // the values four times a second
  const held = Math.max(1, seconds / 100);
  return (
    <ul
      class="legend flex wrap small dim gap-0-16 pad-0-16"
      {...(props.common && { "aria-label": partText(props.common) })}
    >
      {props.common && <li aria-hidden="true">{partText(props.common)}</li>}
      {fields.map((name, i) => {
        const { factor, decimals, unit } = shownUnit(props.unit(name));
        const at = moment ?? frozen?.end ?? null;
        const past = at === null ? null : (frozen?.buckets.get(name) ?? feed.buckets(name, seconds))?.newest(at, held);
        const value = at === null ? feed.newest(name) : past ? (past.low + past.high) / 2 : null;
        const sent = feed.has(name);
        return (
          <li key={name} title={sent ? name : `${name}: ${p("not_sent_hint")}`}>
            <CurveMark index={i} dash={DASHES[Math.floor(i / CURVES) % DASHES.length]} />
            {valueText(name, props.common, props.description)}
            <span class={`figure ${sent && value === null ? "absent" : ""}`}>
              {!sent ? p("not_sent") : value === null ? DASH : withUnit(fixed(value * factor, decimals), unit)}
            </span>
          </li>
        );
      })}
    </ul>
  );
}

function withUnit(text: string, unit: string): string {
  return unit === "°" ? text + unit : unit ? `${text}\u202f${unit}` : text;
}

/** Return a value's words: with the joint's title in the page's language. */
function valueText(name: string, common: string, description: Description | undefined): string {
  if (name.startsWith("signals/")) return fullSignalText(name.slice("signals/".length), description);
  const parts = name.split("/").slice(1, common ? -1 : undefined);
  const joint = (part: string) => description?.joints.find((each) => each.name === part);
  const text = parts.map((part, i) => {
    const found = name.startsWith("kinematics/tool/") ? undefined : joint(part);
    return found && (i > 0 || name.startsWith("joints/")) ? jointTitle(found) : partText(part);
  });
  return text.join(" ") || name;
}

/** The choice of fields: all numbers in the robot's messages. */
function KnownValues(props: {
  robotKey: string;
  description: Description | undefined;
  chosen: readonly string[];
  choose: (chosen: readonly string[]) => void;
}) {
  const { robotKey, description, chosen } = props;
  const sent = useSentValues(robotKey);
  const known = useMemo(() => [...new Set([...sent, ...chosen])], [sent, chosen]);
  return (
    <ValueChoice
      known={known}
      chosen={chosen}
      most={MOST_FIELDS}
      choose={props.choose}
      text={(name) => valueText(name, "", description)}
      unit={(name) => shownUnit(unitOf(name, description)).unit}
    />
  );
}

/** Return the names of the numbers in the messages of a robot's topics. */
function useSentValues(robotKey: string): readonly string[] {
  const topic = jointsTopic(robotKey);
  const [names, setNames] = useState<readonly string[]>([]);
  useEffect(() => {
    const known = new Set<string>();
    const stops = topicsOfValues().map((name) => {
      const read = readerOf(name);
      let lookAt = 0;
      return watch(`${robotKey}/${name === "joints" ? topic : name}`, ({ payload }) => {
        // Which fields are set changes rarely.
        if (!read || ageClock() < lookAt) return;
        lookAt = ageClock() + LOOK_MS;
        const before = known.size;
        read(payload, (own) => known.add(own));
        if (known.size > before) setNames([...known]);
      });
    });
    return () => {
      for (const stop of stops) stop();
    };
  }, [robotKey, topic]);
  return names;
}

/** Return a part of a field's name in words; the catalogues have the usual ones. */
function partText(part: string): string {
  return message(`plot_part.${part}`) ?? part.replaceAll("_", " ");
}

/** Return a time range in words. */
function rangeText(seconds: number): string {
  if (seconds < 120) return p("seconds", { count: seconds });
  return seconds < 3600 ? p("minutes", { count: seconds / 60 }) : p("hours", { count: seconds / 3600 });
}
