// Steps by the ± buttons: one for each press that is taken, in order, none repeated. At most one step waits.
//
// Each starts where the last ended, so the next is sent when the arm rests there: two quick presses of 1° make
// 2°, not less. The arm must not go on for long after the last press, so a press while a step waits is not taken.
// The step that waits is dropped when anything else is pressed, and with everything that would end a held press.

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { t } from "../../i18n/texts";
import type { Notice } from "./control";
import { dialogIsOpen } from "./display-freshness";

export interface StepQueue<Step, Sent> {
  /** `button`: each direction has its own. */
  press: (step: Step, button: Element) => void;
  waiting: Step | null;
  /** Return what the page says of the step that waits; `end`: where it will end. */
  waitingText: (end: string) => string;
  /** The step that is being carried out; `sent`: what the gateway accepted, null before. */
  going: { step: Step; sent: Sent | null } | null;
  /** The last refused step, until the next press. */
  refused: Step | null;
  /** The step that is going has ended. */
  done: () => void;
  /** It has failed: drop the one that waits, which assumed that it reached its target. */
  fail: (text: string) => void;
}

/** A step that waits; `missed`: it was pressed again. */
interface Waiting<Step> {
  step: Step;
  button: Element;
  missed: boolean;
}

/**
 * @param props.enabled If it becomes false, the step that waits is dropped.
 * @param props.followed If it becomes false, the end of the step that is going is not awaited.
 * @param props.send Sends a step; returns null if it was refused, which it tells. */
export function useStepQueue<Step, Sent>(props: {
  enabled: boolean;
  followed: boolean;
  send: (step: Step, tell: (notice: Notice) => void) => Promise<Sent | null>;
  tell: (notice: Notice) => void;
}): StepQueue<Step, Sent> {
  const { enabled, followed, tell } = props;
  const [waiting, setWaiting] = useState<Waiting<Step> | null>(null);
  const [going, setGoing] = useState<{ step: Step; sent: Sent | null } | null>(null);
  const [refused, setRefused] = useState<Step | null>(null);
  const waits = useRef(false);
  waits.current = waiting !== null;

  const drop = (text: string) => {
    if (waits.current) tell({ kind: "refused", text });
    setWaiting(null);
  };
  const fail = (text: string) => {
    tell({ kind: "refused", text: waits.current ? `${text} ${t("step_dropped")}` : text });
    setWaiting(null);
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
  useLayoutEffect(() => {
    if (going || !waiting) return;
    if (dialogIsOpen()) return drop(t("step_dropped_why", { why: t("hold_dialog") }));
    setWaiting(null);
    void start(waiting.step);
  }, [going, waiting]);
  useLayoutEffect(() => {
    if (!waiting) return;
    const listening = new AbortController();
    const options = { signal: listening.signal, capture: true };
    const dropFor = (why: "other" | "blur" | "hidden") => drop(t("step_dropped_why", { why: t(`hold_${why}`) }));
    const isElsewhere = ({ target }: Event) => !(target instanceof Node && waiting.button.contains(target));
    addEventListener("pointerdown", (event) => isElsewhere(event) && dropFor("other"), options);
    addEventListener(
      "keydown",
      (event) => (isElsewhere(event) || !PRESSES.has(event.code)) && dropFor("other"),
      options,
    );
    addEventListener("blur", ({ target }) => target === window && dropFor("blur"), options);
    document.addEventListener("visibilitychange", () => document.hidden && dropFor("hidden"), options);
    return () => listening.abort();
  }, [waiting]);
  useEffect(() => {
    if (enabled) return;
    drop(t("step_dropped"));
    setRefused(null);
  }, [enabled]);
  useEffect(() => {
    if (!followed) setGoing(null);
  }, [followed]);

  const press = (step: Step, button: Element) => {
    setRefused(null);
    setWaiting((now) => (now?.button === button ? { ...now, missed: true } : { step, button, missed: false }));
  };
  const waitingText = (end: string) => t("step_waits", { end }) + (waiting?.missed ? t("step_missed") : "");
  return { press, waiting: waiting?.step ?? null, waitingText, going, refused, done: () => setGoing(null), fail };
}

const PRESSES: ReadonlySet<string> = new Set(["Enter", "NumpadEnter"]);
