// Steps of single joints. The controller adds a step to the position at which it reads it.

import { useEffect } from "preact/hooks";
import type { Description_Joint } from "../../gen/robomesh_pb";
import { DASH, jointText, jointTitle } from "../../i18n/format";
import { t } from "../../i18n/texts";
import { Command, command } from "./command";
import type { Notice } from "./control";
import type { StepQueue } from "./step-queue";
import { useStepQueue } from "./step-queue";

const ARRIVED = 0.1; // of the step
const STILL_MS = 150;
const STUCK_MS = 2500;

interface JointStep {
  index: number;
  offset: number; // rad or m
}
interface Sent {
  target: number;
  what: string;
  /** The warning of the gateway's check. */
  warning: string | undefined;
}

type JointSteps = StepQueue<JointStep, Sent>;

/** Return where the step that waits will end, in words: after the step that is going, if that is of the same joint. */
export function stepEnd(
  joints: readonly Description_Joint[],
  current: readonly (number | undefined)[],
  { waiting, going }: Pick<JointSteps, "waiting" | "going">,
): string {
  const joint = waiting && joints[waiting.index];
  if (!joint) return DASH;
  const at = current[waiting.index] ?? NaN;
  const start = going?.step.index !== waiting.index ? at : (going.sent?.target ?? at + going.step.offset);
  return jointText(joint, start + waiting.offset);
}

export function useJointSteps(props: {
  robotKey: string;
  joints: readonly Description_Joint[];
  current: readonly (number | undefined)[];
  enabled: boolean;
  /** The controller does not report whether it moves. */
  resting: boolean;
  tell: (notice: Notice) => void;
}): JointSteps {
  const { joints, current, enabled, resting, tell } = props;
  const send = async ({ index, offset }: JointStep, told: (notice: Notice) => void): Promise<Sent | null> => {
    const at = current[index];
    const joint = joints[index];
    if (!joint || at === undefined) return null;
    const what = `${jointTitle(joint)} ${offset > 0 ? "+" : ""}${jointText(joint, offset)}`;
    const jointPositions = joints.map((_, i) => (i === index ? offset : 0));
    let warning: string | undefined;
    const accepted = await command(props.robotKey, Command.MOVE_RELATIVE, what, { jointPositions }, (notice) => {
      warning = notice.warning ?? warning;
      told(notice);
    });
    return accepted ? { target: at + offset, what, warning } : null;
  };
  const steps = useStepQueue({ enabled, followed: enabled, tell, send });
  const { step, sent } = steps.going ?? { step: null, sent: null };
  const position = step ? current[step.index] : undefined;
  const off = sent && position !== undefined ? (sent.target - position) / Math.abs(step.offset) : null;
  const arrived = off !== null && Math.abs(off) <= ARRIVED && resting;

  // Each advance by a twentieth of the step restarts the timeout.
  useEffect(() => {
    if (!sent) return;
    const moved = joints[step.index];
    const done = () => {
      steps.done();
      tell({
        kind: "done",
        text: t("motion_done", { what: sent.what }),
        ...(sent.warning && { warning: sent.warning }),
      });
    };
    const timer = arrived
      ? setTimeout(done, STILL_MS)
      : setTimeout(() => steps.fail(t("step_not_there", { joint: moved ? jointTitle(moved) : "" })), STUCK_MS);
    return () => clearTimeout(timer);
  }, [sent, arrived, off === null ? null : Math.round(off * 20)]);
  return steps;
}
