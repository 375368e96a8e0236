// Curves of one plot over its time range, redrawn while it is live.

import { useEffect, useRef, useState } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { dateOf, timeOfDay } from "../../../i18n/format";
import { plotsText as p } from "../../../i18n/texts";
import type { shownUnit } from "../../../i18n/units";
import { ageClock } from "../../../mesh/console/age-clock";
import { theme } from "../../../ui/page/theme";
import { CURVES, curveColour, plotAppearance } from "../../../ui/plots/plot-appearance";
import type { Columns } from "./plot-buckets";
import { Buckets, columnsOf } from "./plot-buckets";
import type { PlotFeed, Span } from "./plot-feed";
import { LIVE_S } from "./plot-feed";

const DRAW_MS = 200;
const DASHES = [[], [6, 4], [2, 3]];
const CLICK_PX = 6;
const NARROWEST_S = 0.2;
const JOIN_S = 2; // between two files of the recorder, or its newest state and the first live one
const MOST_AXES = 3;
/** Steps of a time axis [s], and the least distance between two labels [px]. */
const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600];
const LABEL_PX = 72;
/** The least range of an axis, so that noise does not fill it: of positions, and of other values in their digits. */
const LEAST_RANGE: Partial<Record<string, number>> = { "°": 10, mm: 10 };
const LEAST_DIGITS = 20;

/** The part of the time that a plot shows. */
export type Shown = Span;

/** A paused plot: its right edge [s], and its curves. */
export interface Frozen {
  end: number;
  buckets: ReadonlyMap<string, Buckets | undefined>;
}

export interface Curve {
  name: string;
  unit: ReturnType<typeof shownUnit>;
}

export function LiveChart(props: {
  label: string;
  curves: readonly Curve[];
  feed: PlotFeed;
  frozen: Frozen | null;
  seconds: number;
  zoomed: Shown | null;
  zoom: (shown: Shown | null) => void;
  /** Called with the time under the pointer [s]; null: it left. */
  hover: (at: number | null) => void;
}) {
  const { curves, feed, seconds } = props;
  const place = useRef<HTMLDivElement>(null);
  const [any, setAny] = useState(false);
  const latest = useRef(props);
  latest.current = props;
  const redraw = useRef<() => void>(() => undefined);
  const identity = JSON.stringify(curves);
  useEffect(() => {
    const element = place.current;
    if (!element) return;
    let shown: Shown = { from: 0, to: 1 };
    const units = [...new Set(curves.map(({ unit }) => unit.unit))];
    const leastRange = (unit: string) => {
      const decimals = curves.find((each) => each.unit.unit === unit)?.unit.decimals ?? 0;
      return LEAST_RANGE[unit] ?? LEAST_DIGITS * 10 ** -decimals;
    };
    const { axis, colour } = plotAppearance();
    const scaleOf = (unit: string) => `unit ${unit}`;
    const onMove = (plot: uPlot) => {
      const { left } = plot.cursor;
      latest.current.hover(left === undefined || left === null || left < 0 ? null : plot.posToVal(left, "x"));
    };
    const plot: uPlot = new uPlot(
      {
        width: element.clientWidth,
        height: element.clientHeight,
        legend: { show: false },
        padding: [8, units.length > 1 ? 0 : 16, 0, 0],
        cursor: { y: false, drag: { x: true, y: false, setScale: false }, points: { show: false } },
        scales: {
          x: { time: false, auto: false, range: () => [shown.from, shown.to] },
          ...Object.fromEntries(units.map((unit) => [scaleOf(unit), { range: padded(leastRange(unit)) }])),
        },
        axes: [
          {
            ...axis,
            size: 26,
            splits: (self) => splitsOf(shown, self.width, relative()),
            values: (_, splits) => timeTexts(splits, relative() ? shown.to : null),
          },
          ...units.slice(0, MOST_AXES).map((unit, i) => ({
            ...axis,
            scale: scaleOf(unit),
            side: (i === 0 ? 3 : 1) as uPlot.Axis.Side,
            grid: { ...axis.grid, show: i === 0 },
            size: sizeOfAxis,
            values: (_: uPlot, splits: number[]) => splits.map((at) => axisText(at, unit)),
          })),
        ],
        series: [
          {},
          ...curves.flatMap(({ unit }, i) => {
            const look = {
              scale: scaleOf(unit.unit),
              stroke: colour(curveColour(i)),
              dash: DASHES[Math.floor(i / CURVES) % DASHES.length] ?? [],
              width: 1.5,
              points: { show: false },
            };
            return [look, look];
          }),
        ],
        // The line crosses every value between the lowest and the highest of a column.
        bands: curves.map((_, i) => ({
          series: [2 * i + 2, 2 * i + 1] as [number, number],
          fill: `${colour(curveColour(i))}55`,
        })),
        hooks: {
          drawClear: [(made) => drawMissing(made, latest.current, shown, colour, false)],
          draw: [(made) => drawMissing(made, latest.current, shown, colour, true)],
          setCursor: [onMove],
          setSelect: [
            (made) => {
              const { left, width } = made.select;
              if (width < CLICK_PX) return;
              const [from, to] = [made.posToVal(left, "x"), made.posToVal(left + width, "x")];
              const half = Math.max(NARROWEST_S, to - from) / 2;
              latest.current.zoom({ from: (from + to) / 2 - half, to: (from + to) / 2 + half });
              made.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            },
          ],
        },
      },
      [[], ...curves.flatMap(() => [[], []])],
      element,
    );
    const relative = () => seconds <= LIVE_S && latest.current.frozen === null;
    const columns: Columns = [[]];
    const none = new Buckets(Math.max(seconds, LIVE_S)); // of a value that nothing sends
    let same = false; // the drawn curves are level, from edge to edge
    const draw = (forced: boolean) => {
      const { frozen, zoomed } = latest.current;
      const now = ageClock() / 1000;
      if (frozen && !forced) return;
      // Seconds before now stay as they are; times of day move.
      const level = relative() && curves.every(({ name }) => feed.isLevel(name, seconds, now));
      if (level && same && !forced) return;
      same = level;
      const end = frozen?.end ?? now;
      shown = zoomed ?? { from: end - seconds, to: end };
      const drawn = curves.flatMap(({ name, unit }) => {
        const buckets = (frozen ? frozen.buckets.get(name) : feed.buckets(name, seconds)) ?? none;
        return [{ buckets, holds: Math.max(feed.holdOf(name), 2 * buckets.width), factor: unit.factor }];
      });
      plot.setData(columnsOf(drawn, shown.from, shown.to, element.clientWidth, columns), true);
      setAny(curves.some(({ name }) => feed.has(name)));
      element.dataset.drawn = String(Number(element.dataset.drawn ?? 0) + 1);
    };
    redraw.current = () => draw(true);
    draw(true);
    const timer = setInterval(draw, DRAW_MS, false);
    const whole = () => latest.current.zoom(null);
    plot.over.addEventListener("dblclick", whole);
    const observer = new ResizeObserver(() =>
      plot.setSize({ width: element.clientWidth, height: element.clientHeight }),
    );
    observer.observe(element);
    return () => {
      clearInterval(timer);
      observer.disconnect();
      plot.destroy();
      redraw.current = () => undefined;
      latest.current.hover(null);
    };
  }, [identity, feed, seconds, theme.value]);
  const past = feed.past.value;
  useEffect(() => redraw.current(), [props.frozen, props.zoomed, past]);
  return (
    <div class="plot ranged" ref={place} role="img" aria-label={`${props.label}. ${p("zoom_hint")}`}>
      {!any && <p class="plot-word grid center dim">{p("waiting")}</p>}
    </div>
  );
}

/** Return the parts of a span that are not in others. */
export function missingOf(recorded: readonly Span[], { from, to }: Span): Span[] {
  const missing: Span[] = [];
  let at = from;
  for (const part of [...recorded].sort((a, b) => a.from - b.from)) {
    if (part.from > at && part.from < to) missing.push({ from: at, to: part.from });
    at = Math.max(at, part.to);
  }
  if (at < to) missing.push({ from: at, to });
  return missing.filter((each) => each.to - each.from > JOIN_S);
}

/** Mark the time of which neither the recorder nor this page has values: as an area, then in words over the grid. */
function drawMissing(
  { ctx, bbox, valToPos }: uPlot,
  { curves, feed, seconds }: { curves: readonly Curve[]; feed: PlotFeed; seconds: number },
  shown: Shown,
  colour: (name: string) => string,
  words: boolean,
): void {
  const past = feed.pastOf(seconds);
  if (seconds <= LIVE_S || past.reads > 0) return;
  const live = Math.min(ageClock() / 1000, ...curves.map(({ name }) => feed.liveFrom(name)));
  const ratio = devicePixelRatio;
  ctx.save();
  for (const { from, to } of missingOf(past.recorded, { from: shown.from, to: Math.min(shown.to, live) })) {
    const left = Math.max(bbox.left, valToPos(from, "x", true));
    const width = Math.min(bbox.left + bbox.width, valToPos(to, "x", true)) - left;
    if (!words) {
      ctx.fillStyle = colour("--ground");
      ctx.fillRect(left, bbox.top, width, bbox.height);
      continue;
    }
    const text = p("not_recorded");
    ctx.font = `${12 * ratio}px system-ui, sans-serif`;
    const length = ctx.measureText(text).width + 16 * ratio;
    if (length > width) continue;
    const [x, y] = [left + width / 2, bbox.top + bbox.height / 2];
    ctx.fillStyle = colour("--ground");
    ctx.fillRect(x - length / 2, y - 10 * ratio, length, 20 * ratio);
    ctx.fillStyle = colour("--dim");
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    ctx.fillText(text, x, y);
  }
  ctx.restore();
}

/** Return where a time axis has labels: in steps back from the right edge, or at full times of day. */
function splitsOf({ from, to }: Shown, width: number, relative: boolean): number[] {
  const fits = Math.max(2, Math.floor(width / LABEL_PX));
  const step = STEPS.find((each) => (to - from) / each <= fits) ?? 7200;
  const zero = relative ? to : -(Date.now() - ageClock()) / 1000;
  const found: number[] = [];
  for (let i = Math.ceil((from - zero) / step - 1e-6); zero + i * step <= to + 1e-6; i++) found.push(zero + i * step);
  return found;
}

function timeTexts(splits: readonly number[], end: number | null): string[] {
  if (end !== null) return splits.map((at) => `${Math.round(at - end)} s`.replace("-", "−"));
  const step = (splits[1] ?? 1) - (splits[0] ?? 0);
  return splits.map((at) => {
    const unit = step < 1 ? 100 : 1000; // a label is at a full one, but for rounding
    const ms = Math.round((Date.now() - ageClock() + at * 1000) / unit) * unit;
    const time = timeOfDay(ms);
    if (step >= 60) return time === "00:00:00" ? dateOf(ms) : time.slice(0, 5);
    return step < 1 ? `${time}.${Math.floor((ms % 1000) / 100)}` : time;
  });
}

function axisText(at: number, unit: string): string {
  const number = String(Math.abs(at) >= 1e5 ? at.toExponential(1) : Number(at.toPrecision(6))).replace("-", "−");
  return unit === "°" ? number + unit : unit ? `${number}\u202f${unit}` : number;
}

/** Return the width of an axis with its longest label. */
function sizeOfAxis(_: uPlot, values: string[] | null): number {
  return 20 + 7 * Math.max(3, ...(values ?? []).map((text) => text.length));
}

/** Return the range of an axis: its values and a margin. */
function padded(least: number): uPlot.Range.Function {
  return (_, min, max) => {
    if (min === null || max === null) return [-9 * least, 9 * least];
    const room = Math.max((max - min) * 0.08, least / 2, Math.abs(max) * 1e-3);
    return [min - room, max + room];
  };
}
