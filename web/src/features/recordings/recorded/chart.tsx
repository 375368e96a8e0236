// Curves of one unit over a part of a recording, with a line at the playback time.

import type { ReadonlySignal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { SeriesAnswer_Series as Series } from "../../../gen/robomesh_pb";
import { DASH, fixed } from "../../../i18n/format";
import { momentText } from "../../../i18n/recording-format";
import { commonOf, labelOf, shownUnit } from "../../../i18n/units";
import { theme } from "../../../ui/page/theme";
import { CurveMark } from "../../../ui/plots/curve-mark";
import { curveColour, plotAppearance } from "../../../ui/plots/plot-appearance";
import type { Window } from "./recorder-requests";

const GAP = 3; // a gap is longer than 3 usual intervals, and
const GAP_S = 1; // at least so long
const CLICK_PX = 4;

/** A curve: of the first recording, or of the second, `shift` s later there. */
export interface Curve {
  series: Series;
  colour: number;
  second: boolean;
  shift: number;
}

export function Chart(props: {
  unit: string;
  curves: readonly Curve[];
  window: Window;
  moment: ReadonlySignal<number>;
  seek: (to: number) => void;
  zoom: (to: Window) => void;
}) {
  const { unit, curves, window: shown } = props;
  const place = useRef<HTMLDivElement>(null);
  const { factor, unit: words } = shownUnit(unit);
  const common = commonOf(curves.map(({ series }) => series.name));
  useEffect(() => {
    const element = place.current;
    if (!element || curves.length === 0) return;
    const { axis, colour } = plotAppearance();
    const cursor = document.createElement("div");
    cursor.className = "moment-line";
    const width = Math.max(1, shown.to - shown.from);
    const plot: uPlot = new uPlot(
      {
        width: element.clientWidth,
        height: element.clientHeight,
        legend: { show: false },
        padding: [8, 16, 0, 0],
        cursor: { y: false, drag: { x: true, y: false, setScale: false }, points: { show: false } },
        scales: { x: { time: false, range: () => [shown.from, shown.to] }, y: { range: padded } },
        axes: [
          { ...axis, size: 24, values: (_, splits) => splits.map((at) => momentText(at, width < 20 ? 1 : 0)) },
          { ...axis, scale: "y", size: 60, values: (_, splits) => splits.map((at) => String(at).replace("-", "−")) },
        ],
        series: [
          {},
          ...curves.flatMap(({ colour: index, second }) => {
            const stroke = colour(curveColour(index));
            const dash = second ? { dash: [6, 4] } : {};
            const look = { scale: "y", stroke, width: 1.5, points: { show: false }, ...dash };
            return [look, look];
          }),
        ],
        // The line crosses every value between the lowest and the highest of a segment.
        bands: curves.map(({ colour: index }, i) => ({
          series: [2 * i + 2, 2 * i + 1] as [number, number],
          fill: `${colour(curveColour(index))}55`,
        })),
        hooks: {
          ready: [(made) => made.over.append(cursor)],
          setSelect: [
            (made) => {
              const { left, width: wide } = made.select;
              if (wide >= CLICK_PX) props.zoom({ from: made.posToVal(left, "x"), to: made.posToVal(left + wide, "x") });
              made.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            },
          ],
        },
      },
      joined(curves, factor),
      element,
    );
    let downAt = 0;
    const down = (event: PointerEvent) => (downAt = event.clientX);
    const up = (event: PointerEvent) => {
      if (Math.abs(event.clientX - downAt) >= CLICK_PX) return;
      props.seek(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
    };
    plot.over.addEventListener("pointerdown", down);
    plot.over.addEventListener("pointerup", up);
    const move = (at: number) => {
      cursor.hidden = at < shown.from || at > shown.to;
      cursor.style.translate = `${plot.valToPos(at, "x")}px`;
    };
    const follow = props.moment.subscribe(move);
    const observer = new ResizeObserver(() => {
      plot.setSize({ width: element.clientWidth, height: element.clientHeight });
      move(props.moment.peek());
    });
    observer.observe(element);
    return () => {
      follow();
      observer.disconnect();
      plot.destroy();
    };
  }, [curves, shown.from, shown.to, theme.value, props.seek]);
  return (
    <figure class="chart" data-unit={words}>
      <figcaption class="legend flex wrap small dim gap-0-16 pad-0-16">
        <span class="chart-unit">{[common, words].filter(Boolean).join(", ")}</span>
        {curves.map((curve) => (
          <Named
            key={`${curve.series.name} ${curve.second}`}
            curve={curve}
            label={labelOf(curve.series.name, common)}
            moment={props.moment}
          />
        ))}
      </figcaption>
      <div class="chart-plot ranged" ref={place} />
    </figure>
  );
}

/** A curve's name, and its value at the moment. */
function Named({ curve, label, moment }: { curve: Curve; label: string; moment: ReadonlySignal<number> }) {
  const { series, colour, second, shift } = curve;
  const { factor, decimals, unit } = shownUnit(series.unit);
  const holds = useMemo(() => heldFor(series), [series]);
  const value = valueAt(series, moment.value + shift, holds);
  return (
    <span>
      <CurveMark index={colour} dash={second ? "dashed" : ""} />
      <span title={series.name}>{label}</span>
      {/* No output element: a screen reader would say each value as it plays. */}
      <span class="figure">
        {value === null ? DASH : fixed(value * factor, decimals) + (unit === "°" ? unit : unit && `\u202f${unit}`)}
      </span>
    </span>
  );
}

/** Return how long a value is valid [s]; after that the data has a gap. */
function heldFor({ timesS }: Series): number {
  const steps = timesS.slice(1).map((time, i) => time - (timesS[i] ?? 0));
  return Math.max(GAP_S, GAP * ([...steps].sort((a, b) => a - b)[steps.length >> 1] ?? 0));
}

/** Return the value at a time; null: none was recorded shortly before. */
function valueAt({ timesS, lowest, highest }: Series, at: number, holds: number): number | null {
  let [from, to] = [0, timesS.length];
  while (from < to) {
    const middle = (from + to) >> 1;
    if ((timesS[middle] ?? 0) <= at) from = middle + 1;
    else to = middle;
  }
  const i = from - 1;
  return i < 0 || at - (timesS[i] ?? 0) > holds ? null : ((lowest[i] ?? 0) + (highest[i] ?? 0)) / 2;
}

/** Merge all curves into one column of times; gaps are not drawn. */
function joined(curves: readonly Curve[], factor: number): uPlot.AlignedData {
  const tables = curves.map(({ series, shift }): uPlot.AlignedData => {
    const { timesS, lowest, highest } = series;
    const holds = heldFor(series);
    const columns: [number[], (number | null)[], (number | null)[]] = [[], [], []];
    timesS.forEach((time, i) => {
      const before = timesS[i - 1];
      if (before !== undefined && time - before > holds) push(columns, (before + time) / 2 - shift, null, null);
      push(columns, time - shift, (lowest[i] ?? 0) * factor, (highest[i] ?? 0) * factor);
    });
    return columns;
  });
  return tables.length
    ? uPlot.join(
        tables,
        tables.map(() => [0, 2, 2]),
      )
    : [[]];
}

function push(
  [times, low, high]: [number[], (number | null)[], (number | null)[]],
  time: number,
  least: number | null,
  most: number | null,
): void {
  times.push(time);
  low.push(least);
  high.push(most);
}

/** Return the values' range and a margin, with a minimum so that noise does not fill it. */
function padded(_: uPlot, min: number | null, max: number | null): [number, number] {
  if (min === null || max === null) return [0, 1];
  const room = Math.max((max - min) * 0.08, Math.abs(max) * 1e-3, 1e-6);
  return [min - room, max + room];
}
