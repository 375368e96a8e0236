// Playback controls: play, pause, step, seek, speed, loop; and the events on the time line.

import type { ReadonlySignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { stampMs, timeText } from "../../../i18n/format";
import { momentText } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { heldLease } from "../../../mesh/control/control";
import type { Replay } from "../../../mesh/services/replay";
import { SPEEDS } from "../../../mesh/services/replay";
import { Toggle } from "../../../ui/inputs/choice";
import { Select } from "../../../ui/inputs/select";
import { Warning } from "../../../ui/marks/warning";
import { EventMarks } from "../recorded/event-marks";
import type { RecordedEvent } from "../recorded/recorder-requests";
import "./playback-controls.css";

const STEP_S = 0.05;
const LARGE = 10;

export function PlaybackControls(props: {
  replay: Replay;
  moment: ReadonlySignal<number>;
  events: readonly RecordedEvent[];
}) {
  const { replay } = props;
  const { playing, speed, loop, durationS, start } = replay.state.value;
  const at = props.moment.value;
  useKeys(replay);
  const recordedMs = stampMs(start) + at * 1000;
  return (
    <section class="transport" aria-label={r("transport")}>
      <div class="transport-line anchor">
        <EventMarks events={props.events} duration={durationS} seek={replay.seek} />
        <input
          type="range"
          min={0}
          max={durationS || 1}
          step={STEP_S / 5}
          value={at}
          aria-label={r("moment")}
          aria-valuetext={r("position_of", { position: momentText(at), duration: momentText(durationS) })}
          onInput={(event) => replay.seek(Number(event.currentTarget.value))}
        />
      </div>
      <div class="transport-row grid gap-8-16">
        <div class="flex gap-8">
          <Press name={r("to_start")} shape="start" press={() => replay.seek(0)} />
          <Press
            name={r("step_back", { step: STEP_S })}
            shape="back"
            press={() => replay.seek(replay.position() - STEP_S)}
          />
          <button
            class="action primary play"
            aria-label={r(playing ? "pause" : "play")}
            onClick={playing ? replay.pause : replay.play}
          >
            <span class={playing ? "pause-shape" : "play-shape"} aria-hidden="true" />
          </button>
          <Press
            name={r("step_on", { step: STEP_S })}
            shape="on"
            press={() => replay.seek(replay.position() + STEP_S)}
          />
        </div>
        <div class="transport-time flex wrap large">
          <span class="recorded-clock">{timeText(recordedMs)}</span>
          <span class="figure">
            {momentText(at)} <span class="dim">/ {momentText(durationS)}</span>
          </span>
        </div>
        <div class="transport-end row to-end gap-8">
          <label class="row gap-8">
            <span class="dim small">{r("speed")}</span>
            <Select
              label={r("speed")}
              value={String(nearest(speed))}
              values={SPEEDS.map(String)}
              text={(each) => `${each}×`}
              choose={(each) => replay.setSpeed(Number(each))}
            />
          </label>
          <Toggle text={r("loop")} on={loop} set={replay.setLoop} />
        </div>
      </div>
      <p class="transport-words small">
        {replay.problem.value ? (
          <Warning as="span" class="state warning" role="alert" text={replay.problem.value} />
        ) : (
          <span class="dim keys-words">{r("keys")}</span>
        )}
      </p>
    </section>
  );
}

function Press({ name, shape, press }: { name: string; shape: string; press: () => void }) {
  return (
    <button class="action press" aria-label={name} title={name} onClick={press}>
      <span class={`press-shape ${shape}`} aria-hidden="true" />
    </button>
  );
}

function nearest(speed: number): number {
  return (
    [...SPEEDS].sort((a, b) => Math.abs(Math.log(a / (speed || 1))) - Math.abs(Math.log(b / (speed || 1))))[0] ?? 1
  );
}

/** Handle the page's keys, except in fields and controls with keys. In control, Space requests a stop. */
function useKeys(replay: Replay): void {
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      const target = event.target instanceof Element ? event.target : null;
      if (heldLease.peek() || event.ctrlKey || event.metaKey || event.altKey) return;
      if (target?.closest("input:not([type=range]), select, textarea")) return;
      const { playing, speed, durationS } = replay.state.peek();
      const step = STEP_S * (event.shiftKey ? LARGE : 1);
      const faster = (by: number) => replay.setSpeed(SPEEDS[SPEEDS.indexOf(nearest(speed) as 1) + by] ?? speed);
      const keys: Record<string, () => void> = {
        " ": playing ? replay.pause : replay.play,
        ArrowLeft: () => replay.seek(replay.position() - step),
        ArrowRight: () => replay.seek(replay.position() + step),
        Home: () => replay.seek(0),
        End: () => replay.seek(durationS),
        "+": () => faster(1),
        "-": () => faster(-1),
        l: () => replay.setLoop(!replay.state.peek().loop),
      };
      const act = keys[event.key];
      // Space presses a focused button; arrows turn the 3-D view.
      if (
        !act ||
        (event.key === " " && target?.closest("button, a")) ||
        (event.key.startsWith("Arrow") && target?.closest("canvas"))
      )
        return;
      event.preventDefault();
      act();
    };
    addEventListener("keydown", onKey);
    return () => removeEventListener("keydown", onKey);
  }, [replay]);
}
