// Steps of single joints by the ± buttons: one a press, in order, none lost, none twice.
//
// The controller adds a step to where the arm is when it reads it. So the next one is sent when the arm
// rests where the last one leads: two quick presses of 1° are 2°, not something less.

import { useEffect, useRef, useState } from "preact/hooks";
import type { Description_Joint } from "../gen/robomesh_pb";
import { jointText } from "../i18n/format";
import { t } from "../i18n/texts";
import { Command, command } from "./command";
import type { Notice } from "./control";

const MOST_WAITING = 10;
const ARRIVED = 0.1; // of the step
const STILL_MS = 150;
const STUCK_MS = 2500;

interface Step {
  index: number;
  offset: number; // rad or m
}
interface Going extends Step {
  target: number;
  what: string;
  accepted: boolean;
  /** What the gateway's check warned of. */
  mind?: string;
}

export interface Steps {
  press: (index: number, offset: number) => void;
  waiting: number;
  /** A step is under way: that the arm moves is no reason to refuse the next. */
  going: boolean;
  /** The step that was refused last, until the next press. */
  refused: Step | null;
}

export function useSteps(props: {
  robotKey: string;
  joints: readonly Description_Joint[];
  current: readonly (number | undefined)[];
  enabled: boolean;
  /** The controller does not say that it moves. */
  resting: boolean;
  tell: (notice: Notice) => void;
}): Steps {
  const { joints, current, enabled, resting, tell } = props;
  const [waiting, setWaiting] = useState<readonly Step[]>([]);
  const [going, setGoing] = useState<Going | null>(null);
  const [refused, setRefused] = useState<Step | null>(null);

  const count = useRef(0);
  count.current = waiting.length;
  /** After a step that failed: what waits was meant to begin where it would have led. */
  const drop = (text: string) => {
    const dropped = count.current ? ` ${t("steps_dropped", { count: count.current })}` : "";
    tell({ kind: "refused", text: text + dropped });
    setWaiting([]);
    setGoing(null);
  };
  const position = going ? current[going.index] : undefined;
  const off = going && position !== undefined ? (going.target - position) / Math.abs(going.offset) : null;
  const arrived = off !== null && Math.abs(off) <= ARRIVED && resting;

  const start = async (step: Step) => {
    const at = current[step.index];
    const joint = joints[step.index];
    if (!joint || at === undefined) return;
    const what = `${joint.name} ${step.offset > 0 ? "+" : ""}${jointText(joint, step.offset)}`;
    const mine = { ...step, target: at + step.offset, what, accepted: false };
    setGoing(mine);
    const jointPositions = joints.map((_, i) => (i === step.index ? step.offset : 0));
    let warned = {};
    const refuse = (notice: Notice) => {
      if (notice.mind) warned = { mind: notice.mind };
      if (notice.kind !== "refused") return tell(notice);
      setRefused(step);
      drop(notice.text);
    };
    if (await command(props.robotKey, Command.MOVE_RELATIVE, what, { jointPositions }, refuse)) {
      setGoing((now) => (now === mine ? { ...mine, ...warned, accepted: true } : now));
    }
  };

  useEffect(() => {
    const [next, ...rest] = waiting;
    if (going || !next) return;
    setWaiting(rest);
    void start(next);
  }, [going, waiting]);

  // Each move on, by a twentieth of the step, begins the wait anew.
  useEffect(() => {
    if (!going?.accepted) return;
    const joint = joints[going.index]?.name ?? "";
    const done = () => {
      setGoing(null);
      tell({ kind: "done", text: t("motion_done", { what: going.what }), ...(going.mind && { mind: going.mind }) });
    };
    const timer = arrived
      ? setTimeout(done, STILL_MS)
      : setTimeout(() => drop(t("step_not_there", { joint })), STUCK_MS);
    return () => clearTimeout(timer);
  }, [going, arrived, off === null ? null : Math.round(off * 20)]);

  useEffect(() => {
    if (enabled) return;
    setWaiting([]);
    setGoing(null);
    setRefused(null);
  }, [enabled]);

  const press = (index: number, offset: number) => {
    setRefused(null);
    if (waiting.length < MOST_WAITING) setWaiting((steps) => [...steps, { index, offset }]);
    else tell({ kind: "refused", text: t("steps_many", { count: MOST_WAITING }) });
  };
  return { press, waiting: waiting.length, going: going !== null, refused };
}
