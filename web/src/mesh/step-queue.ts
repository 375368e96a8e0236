// Steps by the ± buttons: one for each press, in order, none lost or repeated.
//
// Each starts where the last ended, so the next is sent when the arm rests there: two quick presses of 1° make
// 2°, not less.

import { useEffect, useRef, useState } from "preact/hooks";
import { t } from "../i18n/texts";
import type { Notice } from "./control";

const MOST_WAITING = 10;

export interface StepQueue<Step, Sent> {
  press: (step: Step) => void;
  waiting: number;
  /** The step that is being carried out; `sent`: what the gateway accepted, null before. */
  going: { step: Step; sent: Sent | null } | null;
  /** The last refused step, until the next press. */
  refused: Step | null;
  /** The step that is going has ended. */
  done: () => void;
  /** It has failed: drop those that wait, which assumed that it reached its target. */
  fail: (text: string) => void;
}

/**
 * @param props.enabled If it becomes false, the steps that wait are dropped.
 * @param props.followed If it becomes false, the end of the step that is going is not awaited.
 * @param props.send Sends a step; returns null if it was refused, which it tells. */
export function useStepQueue<Step, Sent>(props: {
  enabled: boolean;
  followed: boolean;
  send: (step: Step, tell: (notice: Notice) => void) => Promise<Sent | null>;
  tell: (notice: Notice) => void;
}): StepQueue<Step, Sent> {
  const { enabled, followed, tell } = props;
  const [waiting, setWaiting] = useState<readonly Step[]>([]);
  const [going, setGoing] = useState<{ step: Step; sent: Sent | null } | null>(null);
  const [refused, setRefused] = useState<Step | null>(null);
  const count = useRef(0);
  count.current = waiting.length;

  const fail = (text: string) => {
    const dropped = count.current ? ` ${t("steps_dropped", { count: count.current })}` : "";
    tell({ kind: "refused", text: text + dropped });
    setWaiting([]);
    setGoing(null);
  };
  const start = async (step: Step) => {
    const mine = { step, sent: null };
    setGoing(mine);
    const sent = await props.send(step, (notice) => {
      if (notice.kind !== "refused") return tell(notice);
      setRefused(() => step);
      fail(notice.text);
    });
    setGoing((now) => (now === mine ? sent && { step, sent } : now));
  };
  useEffect(() => {
    const [next, ...rest] = waiting;
    if (going || next === undefined) return;
    setWaiting(rest);
    void start(next);
  }, [going, waiting]);
  useEffect(() => {
    if (enabled) return;
    if (count.current) tell({ kind: "refused", text: t("steps_dropped", { count: count.current }) });
    setWaiting([]);
    setRefused(null);
  }, [enabled]);
  useEffect(() => {
    if (!followed) setGoing(null);
  }, [followed]);

  const press = (step: Step) => {
    setRefused(null);
    if (waiting.length < MOST_WAITING) setWaiting((steps) => [...steps, step]);
    else tell({ kind: "refused", text: t("steps_many", { count: MOST_WAITING }) });
  };
  return { press, waiting: waiting.length, going, refused, done: () => setGoing(null), fail };
}
