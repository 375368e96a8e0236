// Curves of the checked motion: joints, and the clearance to the surroundings.

import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { jointTitle, jointUnit } from "../../../i18n/format";
import { programText as p } from "../../../i18n/texts";
import { theme } from "../../../ui/page/theme";
import { CurveMark } from "../../../ui/plots/curve-mark";
import { curveColour, plotAppearance } from "../../../ui/plots/plot-appearance";
import { moment, path } from "../motion/checked-motion";
import { description } from "../motion/program-robot";
import { showMoment } from "../motion/scene-overlay";

const MOST_POINTS = 2000; // more than there are pixels
const CLEARANCE = "clearance";

export function MotionCurves() {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const of = path.value;
  const joints = description.value?.joints ?? [];
  const names = joints.map((joint) => joint.name).join(" ");
  const near = of?.clearances.some(Number.isFinite) ?? false;
  useEffect(() => {
    const element = place.current;
    if (!element || !of || joints.length === 0) return;
    const { axis, colour } = plotAppearance();
    const unitOf = (i: number) => (joints[i] ? jointUnit(joints[i]).unit : "");
    const units = [...new Set(joints.map((_, i) => unitOf(i)))].sort().reverse();
    const text = (unit: string) => (_: uPlot, splits: number[]) =>
      splits.map((at) => `${at}${unit === "°" ? "" : "\u202f"}${unit}`.replace("-", "−"));
    const made = new uPlot(
      {
        width: element.clientWidth,
        height: element.clientHeight,
        legend: { show: false },
        cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
        scales: { x: { time: false }, [CLEARANCE]: { range: (_, __, most) => [0, Math.max(50, most ?? 0)] } },
        axes: [
          { ...axis, size: 26, values: text("s") },
          ...units.map((unit, i) => ({
            ...axis,
            scale: unit,
            side: (i === 0 ? 3 : 1) as uPlot.Axis.Side,
            grid: { ...axis.grid, show: i === 0 },
            size: unit === "°" ? 52 : 64,
            values: text(unit),
          })),
          ...(near
            ? [{ ...axis, scale: CLEARANCE, side: 1 as const, grid: { show: false }, size: 72, values: text("mm") }]
            : []),
        ],
        series: [
          {},
          ...joints.map((joint, i) => ({
            label: jointTitle(joint),
            scale: unitOf(i),
            stroke: colour(curveColour(i)),
            width: 1.5,
            points: { show: false },
          })),
          ...(near
            ? [
                {
                  label: p("clearance"),
                  scale: CLEARANCE,
                  stroke: colour("--text"),
                  width: 1.5,
                  dash: [6, 4],
                  points: { show: false },
                },
              ]
            : []),
        ],
        hooks: {
          draw: [
            ({ ctx, bbox, valToPos }) => {
              if (moment.peek() === null) return;
              const x = valToPos(moment.peek() ?? 0, "x", true);
              ctx.fillStyle = colour("--accent");
              ctx.fillRect(Math.round(x) - devicePixelRatio / 2, bbox.top, devicePixelRatio, bbox.height);
            },
          ],
        },
      },
      [[]],
      element,
    );
    const every = Math.max(1, Math.ceil(of.timesS.length / MOST_POINTS));
    const rows = Array.from({ length: Math.ceil(of.timesS.length / every) }, (_, i) => i * every);
    const width = of.jointPositions.length / of.timesS.length;
    const clearance = (row: number) => {
      const metres = of.clearances[row] ?? Infinity;
      return Number.isFinite(metres) ? metres * 1000 : null;
    };
    made.setData([
      rows.map((row) => of.timesS[row] ?? 0),
      ...joints.map((joint, i) =>
        rows.map((row) => (of.jointPositions[row * width + i] ?? 0) * jointUnit(joint).factor),
      ),
      ...(near ? [rows.map(clearance)] : []),
    ] as uPlot.AlignedData);
    made.over.addEventListener("click", (event) => showMoment(made.posToVal(event.offsetX, "x")));
    plot.current = made;
    const observer = new ResizeObserver(() =>
      made.setSize({ width: element.clientWidth, height: element.clientHeight }),
    );
    observer.observe(element);
    return () => {
      plot.current = null;
      observer.disconnect();
      made.destroy();
    };
  }, [of, names, theme.value]);
  useEffect(() => plot.current?.redraw(false), [moment.value]);
  if (!of) return null;
  return (
    <>
      <div class="plot" ref={place} />
      <div class="legend flex wrap small dim gap-0-16 pad-0-16">
        {joints.map((joint, i) => (
          <span key={joint.name}>
            <CurveMark index={i} />
            {jointTitle(joint)}
          </span>
        ))}
        {near && (
          <span>
            <span class="curve curve-clearance" aria-hidden="true" />
            {p("clearance")}
          </span>
        )}
      </div>
    </>
  );
}
