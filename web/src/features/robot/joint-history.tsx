// Curves of the joints in the last 60 seconds.

import { fromBinary } from "@bufbuild/protobuf";
import { useEffect, useRef, useState } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { JointStatesSchema } from "../../gen/foxglove/JointStates_pb";
import type { Description } from "../../gen/robomesh_pb";
import { jointTitle, jointUnit } from "../../i18n/format";
import { t } from "../../i18n/texts";
import { ageClock } from "../../mesh/age-clock";
import { watch } from "../../mesh/connection";
import { jointsTopic } from "../../scene/topic-selection";
import { Toggle } from "../../ui/choice";
import { Panel } from "../../ui/panel";
import { theme } from "../../ui/theme";

const SPAN_S = 60;
const STEP_MS = 100; // finer than a pixel
const CLOCK_SET_MS = 5000;
const SEEN_CHANGE = 0.02; // degrees or mm: less than half a pixel of the smallest range
const NEW_S = 1; // curves end at the right edge
const CURVES = ["--curve-1", "--curve-2", "--curve-3", "--curve-4", "--curve-5", "--curve-6", "--curve-7"];

interface Rows {
  time: number[];
  values: (number | null)[][];
  /** Values since `changedAt` [s]: later ones are equal. */
  level: (number | null)[];
  changedAt: number;
}

export function JointHistory({ robotKey, description }: { robotKey: string; description: Description | undefined }) {
  const place = useRef<HTMLDivElement>(null);
  const [paused, setPaused] = useState(false);
  const [any, setAny] = useState(false);
  const stopped = useRef(false);
  stopped.current = paused;
  const [rows] = useState<Rows>({ time: [], values: [], level: [], changedAt: 0 });
  const joints = description?.joints ?? [];
  const names = joints.map((joint) => joint.name).join(" ");
  const topic = jointsTopic(robotKey);
  // Angles use the left axis, lengths the right.
  const units = [...new Set(joints.map((joint) => jointUnit(joint).unit))].sort().reverse();

  useEffect(() => {
    rows.time = [];
    rows.values = joints.map(() => []);
    const factors = joints.map((joint) => jointUnit(joint).factor);
    let ahead = Infinity; // page clock minus source clock at the least delay so far [ms]
    return watch(`${robotKey}/${topic}`, (sample) => {
      if (!sample.live) return;
      const early = ageClock() - sample.sourceTime;
      if (early < ahead || early - ahead > CLOCK_SET_MS) ahead = early;
      const last = rows.time.at(-1);
      // By source time: delayed samples are drawn at the time of their measurement.
      const at = (sample.sourceTime + ahead) / 1000;
      if (last !== undefined && at - last < STEP_MS / 1000) return;
      // Draw no line through a gap.
      if (last !== undefined && at - last > 1) append(last + 0.1, () => null);
      const states = new Map(
        fromBinary(JointStatesSchema, sample.payload).joints.map((joint) => [joint.name, joint.position]),
      );
      append(at, (i) => {
        const position = states.get(joints[i]?.name ?? "");
        return position === undefined ? null : position * (factors[i] ?? 1);
      });
      setAny(true);
    });
    function append(time: number, value: (index: number) => number | null): void {
      rows.time.push(time);
      const values = rows.values.map((_, i) => value(i));
      for (const [i, column] of rows.values.entries()) column.push(values[i] ?? null);
      if (values.some((each, i) => differs(each, rows.level[i] ?? null))) {
        rows.level = values;
        rows.changedAt = time;
      }
      while ((rows.time[0] ?? time) < time - SPAN_S - 2) {
        rows.time.shift();
        for (const column of rows.values) column.shift();
      }
    }
  }, [robotKey, names, topic]);

  useEffect(() => {
    const element = place.current;
    if (!element || joints.length === 0) return;
    let end = ageClock() / 1000;
    const shown = (): [number, number] => [end - SPAN_S, end];
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const axis = { stroke: colour("--dim"), grid: { stroke: colour("--line"), width: 1 }, ticks: { show: false } };
    const font = "12px system-ui, sans-serif";
    const plot = new uPlot(
      {
        width: element.clientWidth,
        height: element.clientHeight,
        legend: { show: false },
        cursor: { y: false, drag: { x: false, y: false } },
        scales: {
          x: { time: false, auto: false, range: shown },
          ...Object.fromEntries(units.map((unit) => [unit, { range: padded }])),
        },
        axes: [
          {
            ...axis,
            font,
            size: 26,
            splits: () => [-60, -45, -30, -15, 0].map((back) => end + back),
            values: (_, splits) => splits.map((at) => `${Math.round(at - end)} s`.replace("-", "−")),
          },
          ...units.map((unit, i) => ({
            ...axis,
            scale: unit,
            side: (i === 0 ? 3 : 1) as uPlot.Axis.Side,
            grid: { ...axis.grid, show: i === 0 },
            font,
            size: unit === "°" ? 46 : 64,
            values: (_: uPlot, splits: number[]) =>
              splits.map((at) => `${at}${unit === "°" ? "" : "\u202f"}${unit}`.replace("-", "−")),
          })),
        ],
        series: [
          {},
          ...joints.map((joint, i) => ({
            label: jointTitle(joint),
            scale: jointUnit(joint).unit,
            stroke: colour(CURVES[i % CURVES.length] ?? "--text"),
            width: 1.5,
            points: { show: false },
          })),
        ],
      },
      [[], ...joints.map(() => [])],
      element,
    );
    let same = false; // the drawn curves are level, from edge to edge
    const draw = () => {
      if (stopped.current) return;
      end = ageClock() / 1000;
      const level = rows.changedAt < end - SPAN_S && (rows.time.at(-1) ?? 0) > end - NEW_S;
      if (level && same) return;
      same = level;
      plot.setData([rows.time, ...rows.values] as uPlot.AlignedData, true);
      element.dataset.drawn = String(Number(element.dataset.drawn ?? 0) + 1);
    };
    const timer = setInterval(draw, 200);
    const observer = new ResizeObserver(() =>
      plot.setSize({ width: element.clientWidth, height: element.clientHeight }),
    );
    observer.observe(element);
    return () => {
      clearInterval(timer);
      observer.disconnect();
      plot.destroy();
    };
  }, [names, theme.value]);
  return (
    <Panel
      name="history"
      title={t("history")}
      end={
        <Toggle on={paused} set={setPaused}>
          {t("pause")}
        </Toggle>
      }
    >
      <div class="legend">
        {joints.map((joint, i) => (
          <span key={joint.name}>
            <span class={`curve curve-${(i % CURVES.length) + 1}`} aria-hidden="true" />
            {jointTitle(joint)}
          </span>
        ))}
      </div>
      <div class="plot" ref={place}>
        {!any && <p class="plot-word dim">{t("plot_empty")}</p>}
      </div>
    </Panel>
  );
}

function differs(one: number | null, other: number | null): boolean {
  return one === null || other === null ? one !== other : Math.abs(one - other) > SEEN_CHANGE;
}

/** Return a scale's range: the values and a margin, with a minimum so that noise does not fill it. */
function padded(_: uPlot, min: number | null, max: number | null): [number, number] {
  if (min === null || max === null) return [-90, 90];
  const room = Math.max(5, (max - min) * 0.08);
  return [min - room, max + room];
}
