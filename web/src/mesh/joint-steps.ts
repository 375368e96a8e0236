// Steps of single joints by the ± buttons: one for each press, in order, none lost or repeated.
//
// The controller adds a step to the position at which it reads it. The next step is therefore sent when the
// arm rests at the last target: two quick presses of 1° make 2°, not less.

import { useEffect, useRef, useState } from "preact/hooks";
import type { Description_Joint } from "../gen/robomesh_pb";
import { jointText, jointTitle } from "../i18n/format";
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
  /** The warning of the gateway's check. */
  warning?: string;
}

export interface Steps {
  press: (index: number, offset: number) => void;
  waiting: number;
  /** A step is being carried out: its motion does not block the next. */
  going: boolean;
  /** The last refused step, until the next press. */
  refused: Step | null;
}

export function useSteps(props: {
  robotKey: string;
  joints: readonly Description_Joint[];
  current: readonly (number | undefined)[];
  enabled: boolean;
  /** The controller does not report whether it moves. */
  resting: boolean;
  tell: (notice: Notice) => void;
}): Steps {
  const { joints, current, enabled, resting, tell } = props;
  const [waiting, setWaiting] = useState<readonly Step[]>([]);
  const [going, setGoing] = useState<Going | null>(null);
  const [refused, setRefused] = useState<Step | null>(null);

  const count = useRef(0);
  count.current = waiting.length;
  /** Drop the waiting steps after a failed one: they assumed that it reached its target. */
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
    const what = `${jointTitle(joint)} ${step.offset > 0 ? "+" : ""}${jointText(joint, step.offset)}`;
    const mine = { ...step, target: at + step.offset, what, accepted: false };
    setGoing(mine);
    const jointPositions = joints.map((_, i) => (i === step.index ? step.offset : 0));
    let warned = {};
    const refuse = (notice: Notice) => {
      if (notice.warning) warned = { warning: notice.warning };
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

  // Each advance by a twentieth of the step restarts the timeout.
  useEffect(() => {
    if (!going?.accepted) return;
    const moved = joints[going.index];
    const joint = moved ? jointTitle(moved) : "";
    const done = () => {
      setGoing(null);
      tell({
        kind: "done",
        text: t("motion_done", { what: going.what }),
        ...(going.warning && { warning: going.warning }),
      });
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
