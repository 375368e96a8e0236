// The checked motion over time: a slider that moves the ghost, and curves of joints and clearance.

import { useEffect } from "preact/hooks";
import { programText as p } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Panel } from "../../../ui/panel/panel";
import { clearanceAtMoment, duration, lineAtMoment, moment, path, playing } from "../motion/checked-motion";
import { distanceText, seconds } from "../motion/number-format";
import { checked } from "../motion/program-check";
import { hideMoment, showMoment } from "../motion/scene-overlay";
import { severityOf } from "../motion/violations";
import { MotionCurves } from "./motion-curves";
import "./timeline.css";

const STEP_S = 0.05;

export function Timeline() {
  const any = path.value !== null;
  const time = moment.value;
  usePlaying();
  const play = () => {
    if (playing.value) {
      playing.value = false;
      return;
    }
    showMoment(time === null || time >= duration.value ? 0 : time);
    playing.value = true;
  };
  const line = lineAtMoment.value;
  const clearance = clearanceAtMoment.value;
  const words =
    time === null
      ? p("scrub_hint")
      : [
          line ? p("line", { line }) : "",
          clearance === null ? "" : p("clearance_now", { distance: distanceText(clearance) }),
        ]
          .filter(Boolean)
          .join(" · ");
  return (
    <Panel
      name="timeline"
      title={p("timeline")}
      end={<Button quiet text={p("hide_ghost")} disabled={time === null} onClick={hideMoment} />}
    >
      <div class="scrub-row row gap-12 pad-0-16">
        <button class="action play" disabled={!any} onClick={play} aria-label={p(playing.value ? "pause" : "play")}>
          <span class={playing.value ? "pause-shape" : "play-shape"} aria-hidden="true" />
        </button>
        <div class="scrub grow narrow anchor">
          <input
            type="range"
            min={0}
            max={duration.value || 1}
            step={STEP_S}
            value={time ?? 0}
            disabled={!any}
            aria-label={p("moment")}
            aria-valuetext={seconds(time ?? 0)}
            onInput={(event) => {
              playing.value = false;
              showMoment(Number(event.currentTarget.value));
            }}
          />
          <Bands />
        </div>
        <span class="scrub-time nowrap right">
          {seconds(time ?? 0)} <span class="dim">/ {seconds(duration.value)}</span>
        </span>
      </div>
      <p class="scrub-words dim small">{any ? words : p("no_motion_yet")}</p>
      <MotionCurves />
    </Panel>
  );
}

/** Marks of the violations along the time. */
function Bands() {
  const total = duration.value;
  const violations = checked.value?.answer.violations ?? [];
  if (!total) return null;
  const share = (time: number) => `${(100 * Math.min(total, Math.max(0, time))) / total}%`;
  return (
    <div class="bands" aria-hidden="true">
      {violations
        .filter(({ kind }) => kind !== "program")
        .map((each, index) => (
          <span
            key={index}
            class={severityOf(each)}
            style={{ left: share(each.timeS), width: share(Math.max(0, each.untilS - each.timeS)) }}
          />
        ))}
    </div>
  );
}

/** Advance the moment at the robot's real speed. */
function usePlaying(): void {
  const on = playing.value;
  useEffect(() => {
    if (!on) return;
    let last = performance.now();
    let request = requestAnimationFrame(function step(at) {
      const next = (moment.peek() ?? 0) + (at - last) / 1000;
      last = at;
      showMoment(next);
      if (next >= duration.value) playing.value = false;
      else request = requestAnimationFrame(step);
    });
    return () => cancelAnimationFrame(request);
  }, [on]);
}
