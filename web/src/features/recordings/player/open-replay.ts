// Replays that this page opens: it closes them, or the player does when the page's connection ends.

import type { Signal } from "@preact/signals";
import { useSignal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { PlayRequestSchema, ReplayStateSchema } from "../../../gen/robomesh_pb";
import { recordingsText as r } from "../../../i18n/texts";
import { AskError, ask, hello, presence, reasonOf } from "../../../mesh/console/connection";
import { Replay } from "../../../mesh/services/replay";
import type { RecordingName } from "../../../ui/page/route";

const TIMEOUT_S = 15; // the player first reads a long file
const PRESENCE_DELAY_MS = 1500; // presence arrives after the greeting
const MOMENT_INTERVAL_MS = 40;
const FOLLOW_INTERVAL_MS = 200;
const MAX_OFFSET_S = 0.12; // a larger difference is corrected by a seek

export interface OpenReplay {
  replay: Replay | null;
  problem: string;
  again: () => void;
}

/** Open a recording and follow its replay; null: none. */
export function useOpenReplay(name: RecordingName | null, paused = false): OpenReplay {
  const [replay, setReplay] = useState<Replay | null>(null);
  const [problem, setProblem] = useState("");
  const [tries, setTries] = useState(0);
  const session = hello.value?.session ?? "";
  const there =
    name !== null && [...presence.value].some((key) => key.startsWith(`robomesh/${name.site}/-/alive/player/`));
  useEffect(() => {
    if (!name || !session) return;
    let wanted = true;
    let made: Replay | null = null;
    if (!there) {
      const timer = setTimeout(() => setProblem(r("no_player", { site: name.site })), PRESENCE_DELAY_MS);
      return () => clearTimeout(timer);
    }
    setProblem("");
    const open = async () => {
      try {
        const request = { file: name.file, paused, session };
        const key = `robomesh/${name.site}/-/player/open`;
        const state = await ask(key, PlayRequestSchema, request, ReplayStateSchema, TIMEOUT_S);
        made = new Replay(`robomesh/${name.site}/${state.robot}`, state);
        if (wanted) setReplay(made);
        else made.close();
      } catch (error) {
        if (!wanted) return;
        const silent = error instanceof AskError && error.noAnswer;
        const text = reasonOf(error);
        setProblem(silent ? r("no_player", { site: name.site }) : r("not_opened", { text }));
      }
    };
    void open();
    return () => {
      wanted = false;
      made?.close();
      setReplay(null);
    };
  }, [name?.site, name?.file, session, there, tries]);
  return { replay, problem, again: () => setTries(tries + 1) };
}

/** Return a replay's position, at the display's rate. */
export function usePosition(replay: Replay | null): Signal<number> {
  const moment = useSignal(0);
  useEffect(() => {
    if (!replay) return;
    let updatedAt = 0;
    let request = requestAnimationFrame(function step(at) {
      request = requestAnimationFrame(step);
      if (at - updatedAt < MOMENT_INTERVAL_MS) return;
      updatedAt = at;
      moment.value = replay.position();
    });
    return () => cancelAnimationFrame(request);
  }, [replay]);
  return moment;
}

/** Keep a second replay `shift` s ahead of the first; beyond its ends it waits. */
export function useSynchronised(first: Replay | null, second: Replay | null, shift: number): void {
  useEffect(() => {
    if (!first || !second) return;
    const follow = () => {
      const { playing, speed } = first.state.peek();
      const own = second.state.peek();
      const wanted = first.position() + shift;
      const within = wanted >= 0 && wanted < own.durationS;
      if (own.speed !== speed) second.setSpeed(speed);
      const near = MAX_OFFSET_S * Math.max(1, playing ? speed : 0);
      if (Math.abs(second.position() - Math.min(own.durationS, Math.max(0, wanted))) > (playing ? near : 1e-3)) {
        second.seek(wanted);
      }
      if (own.playing !== (playing && within)) (own.playing ? second.pause : second.play)();
    };
    const timer = setInterval(follow, FOLLOW_INTERVAL_MS);
    return () => clearInterval(timer);
  }, [first, second, shift]);
}
