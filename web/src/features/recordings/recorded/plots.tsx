// Values of a recording as curves, a chart a unit, linked to the playback time.

import type { ReadonlySignal } from "@preact/signals";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Recording, SeriesAnswer_Series as Series } from "../../../gen/robomesh_pb";
import { recordingsText as r } from "../../../i18n/texts";
import { ValueChoice } from "../../../panels/value-choice";
import { Toggle } from "../../../ui/inputs/choice";
import { Warning } from "../../../ui/marks/warning";
import type { RecordingName } from "../../../ui/page/route";
import { Panel } from "../../../ui/panel/panel";
import type { Curve } from "./chart";
import { Chart } from "./chart";
import type { Window } from "./recorder-requests";
import { useSeries, useValueNames } from "./recorder-requests";
import { savePicture } from "./save-picture";
import "./plots.css";

const POINTS = 1000;
const MOST = 14;
const FIRST = /^joints\/.*\/position$/;
const NARROWEST_S = 0.2;

/** The second recording: its time is `shift` s more. */
export interface SecondRecording {
  name: RecordingName;
  info: Recording | null;
  shift: number;
}

export function Plots(props: {
  name: RecordingName;
  info: Recording | null;
  duration: number;
  beside: SecondRecording | null;
  moment: ReadonlySignal<number>;
  seek: (to: number) => void;
}) {
  const { name, info, duration, beside } = props;
  const known = useValueNames(name);
  const [chosen, setChosen] = useState<readonly string[] | null>(null);
  const [choosing, setChoosing] = useState(false);
  const [zoomed, setZoomed] = useState<Window | null>(null);
  const charts = useRef<HTMLDivElement>(null);
  const values = useMemo(() => {
    if (chosen) return chosen;
    const first = (known.value ?? []).filter((value) => FIRST.test(value));
    return (first.length ? first : (known.value ?? [])).slice(0, 7);
  }, [known.value, chosen]);
  const shown = useMemo(() => zoomed ?? { from: 0, to: duration || 1 }, [zoomed, duration]);
  const series = useSeries(name, info, values, shown, POINTS);
  const shift = beside?.shift ?? 0;
  const later = useMemo(() => ({ from: shown.from + shift, to: shown.to + shift }), [shown, shift]);
  const second = useSeries(beside?.name ?? null, beside?.info ?? null, values, later, POINTS);
  const units = useMemo(
    () => byUnit(values, series.value ?? [], second.value ?? [], shift),
    [series.value, second.value, shift, values],
  );
  const zoom = ({ from, to }: Window) => {
    const middle = (from + to) / 2;
    const half = Math.max(NARROWEST_S, to - from) / 2;
    setZoomed({ from: Math.max(0, middle - half), to: Math.min(duration, middle + half) });
  };
  const problem = known.problem || series.problem || second.problem;
  useEffect(() => setZoomed(null), [name.file]);
  return (
    <Panel
      name="plots"
      title={r("plots")}
      end={
        <>
          {zoomed && (
            <button class="toggle" onClick={() => setZoomed(null)}>
              {r("zoom_out")}
            </button>
          )}
          <button
            class="toggle"
            disabled={units.length === 0}
            title={r("save_picture_hint")}
            onClick={() => charts.current && savePicture(charts.current, `${info?.name || name.file}.png`)}
          >
            {r("save_picture")}
          </button>
          <Toggle text={r(choosing ? "done" : "values")} on={choosing} set={setChoosing} />
        </>
      }
    >
      {choosing && known.value && <ValueChoice known={known.value} chosen={values} most={MOST} choose={setChosen} />}
      <div class="charts" ref={charts}>
        {units.map(([unit, curves]) => (
          <Chart
            key={unit}
            unit={unit}
            curves={curves}
            window={shown}
            moment={props.moment}
            seek={props.seek}
            zoom={zoom}
          />
        ))}
        {problem ? (
          <Warning class="charts-word state warning" text={r("plots_refused", { text: problem })} />
        ) : !known.value || (values.length > 0 && !series.value) ? (
          <p class="charts-word dim">{r("plots_waiting")}</p>
        ) : known.value.length === 0 ? (
          <p class="charts-word dim">{r("values_none")}</p>
        ) : values.length === 0 ? (
          <p class="charts-word dim">{r("values_choose")}</p>
        ) : null}
      </div>
      <p class="footnote dim">
        {beside && `${r("dashed", { first: info?.name || name.file, second: beside.info?.name || beside.name.file })} `}
        {r("plot_hint")}
      </p>
    </Panel>
  );
}

/** Group curves by unit; each value has its colour, the same in both recordings. */
function byUnit(
  values: readonly string[],
  first: readonly Series[],
  second: readonly Series[],
  shift: number,
): [string, Curve[]][] {
  const curves = [
    ...first.map((series): Curve => ({ series, colour: values.indexOf(series.name), second: false, shift: 0 })),
    ...second.map((series): Curve => ({ series, colour: values.indexOf(series.name), second: true, shift })),
  ].filter(({ colour }) => colour >= 0);
  return [...Map.groupBy(curves, ({ series }) => series.unit)];
}
