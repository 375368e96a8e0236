// Whether a topic's last message belongs to the replay's current moment; others are not shown.

import { useEffect, useState } from "preact/hooks";
import { watch } from "../console/connection";
import type { Replay } from "./replay";

/** `coming`: the replay has just jumped, and data recorded there may be on its way. */
export type MomentState = "here" | "coming" | "absent";

const ARRIVAL_MS = 2000;
const CHECK_INTERVAL_MS = 50;
/** Time for messages to arrive, during which a fast replay advances far [s]. */
const ON_ITS_WAY_S = 0.5;

/** Follow a replay's topic with messages that are valid for a time [s]; an empty topic is absent. */
export function useMomentState(replay: Replay | null, topic: string, holdsS: number): MomentState {
  const [state, setState] = useState<MomentState>("coming");
  useEffect(() => {
    setState("coming");
    if (!replay || !topic) return;
    const opened = performance.now();
    let source: number | null = null;
    let offset = 0; // recorder's clock to the publisher's [ms]
    const away = (from: number) => replay.recordedMs() - from;
    const update = () => {
      const { playing, speed } = replay.state.peek();
      const within = holdsS + (playing ? ON_ITS_WAY_S * Math.max(1, speed) : 0);
      const here = source !== null && Math.abs(away(source) - offset) <= within * 1000;
      const waiting = performance.now() - Math.max(opened, replay.movedAt) < ARRIVAL_MS;
      setState(here ? "here" : waiting || replay.seeking ? "coming" : "absent");
    };
    const stop = watch(`${replay.robotKey}/${topic}`, (sample) => {
      if (!sample.sourceTime) return;
      source = sample.sourceTime;
      if (replay.playedForMs() > ARRIVAL_MS) offset = away(source); // during playback each arrives at its moment
      update();
    });
    const timer = setInterval(update, CHECK_INTERVAL_MS);
    return () => {
      stop();
      clearInterval(timer);
    };
  }, [replay, topic]);
  return replay && topic ? state : "absent";
}
