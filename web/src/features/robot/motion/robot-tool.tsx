// The tool of a live robot, with steps on straight lines along and about the axes of a frame.
//
// A step is a program of one line, so the gateway plans and checks its whole way. Held buttons jog.

import { useEffect, useRef, useState } from "preact/hooks";
import type { ControllerState, Description, KinematicState, ProgramState } from "../../../gen/robomesh_pb";
import { ProgramState_Outcome as Outcome } from "../../../gen/robomesh_pb";
import { stampMs, toRadians } from "../../../i18n/format";
import { reasonText } from "../../../i18n/reasons";
import { t } from "../../../i18n/texts";
import { reachable } from "../../../mesh/console/connection";
import { Command, command } from "../../../mesh/control/command";
import type { Notice } from "../../../mesh/control/control";
import { holds } from "../../../mesh/control/control";
import { whyFrozen } from "../../../mesh/control/display-freshness";
import type { Pressed } from "../../../mesh/control/jog";
import { JogAxis, JogFrame, startJog } from "../../../mesh/control/jog";
import type { Motion } from "../../../mesh/control/notice-expiry";
import { useNoticeExpiry } from "../../../mesh/control/notice-expiry";
import { useStepQueue } from "../../../mesh/control/step-queue";
import { whyNoNewMotion, whyNoTarget } from "../../../mesh/state/robot-state";
import type { Latest } from "../../../mesh/state/topics";
import { now } from "../../../mesh/state/topics";
import type { Axis } from "../../../panels/tool-panel";
import { POSE_AXES, ToolPanel } from "../../../panels/tool-panel";
import { HoldButton } from "../../../ui/hold/hold-button";
import type { HoldEnd } from "../../../ui/hold/hold-pointer";
import { StepButton } from "../../../ui/hold/step-button";
import { Choice } from "../../../ui/inputs/choice";
import { NoticeLine } from "../../../ui/panel/notice-line";
import type { ToolStep } from "./tool-step";
import { endText, FRAMES, isTurn } from "./tool-step";

const STEPS = ["1", "5", "20"] as const; // mm or degrees
const WAYS = ["step", "hold"] as const;
const JOG_SPEEDS = { slow: [10, 2], medium: [50, 10], fast: [250, 30] } as const; // mm/s, degrees/s
type JogSpeed = keyof typeof JOG_SPEEDS;
const FRAME_OF = { tool: JogFrame.TOOL, base: JogFrame.BASE, site: JogFrame.SITE };
const MOST_SPEED_PERCENT = 25;
const MOST_TOOL_SPEED = 250; // mm/s
const NOT_STARTED_MS = 5000;

interface Sent {
  what: string;
  /** When the program before it started. */
  before: number;
  warning: string | undefined;
}

export function RobotTool(props: {
  robotKey: string;
  kinematics: Latest<KinematicState> | undefined;
  description: Description | undefined;
  controller: ControllerState | undefined;
  program: ProgramState | undefined;
  motion: Motion;
}) {
  const { robotKey, controller, program } = props;
  const [frame, setFrame] = useState<(typeof FRAMES)[number]>("tool");
  const [size, setSize] = useState<(typeof STEPS)[number]>("5");
  const [way, setWay] = useState<(typeof WAYS)[number]>("step");
  const [jogSpeed, setJogSpeed] = useState<JogSpeed>("slow");
  const [jogging, setJogging] = useState(false);
  const [notice, setNotice] = useState<Notice | null>(null);
  const mine = holds(robotKey);
  const whyNone = reachable.value ? whyNoTarget(controller) || whyFrozen(robotKey, now.value) : t("no_connection");
  /** The tool's pose when the step that is going was sent. */
  const start = useRef<readonly number[] | undefined>(undefined);
  const queue = useStepQueue<ToolStep, Sent>({
    enabled: mine && !whyNone,
    followed: mine, // also while a picture is frozen, and up to the reason of a stop
    tell: setNotice,
    send: async (step, tell) => {
      const what = nameOf(step);
      start.current = props.kinematics?.message.toolToBase;
      const before = stampMs(program?.since);
      let warning: string | undefined;
      const values = { program: programOf(step, controller?.speedPercent), programName: what };
      const accepted = await command(robotKey, Command.RUN_PROGRAM, what, values, (told) => {
        warning = told.warning ?? warning;
        tell(told.kind === "busy" ? { ...told, text: t("tool_step_checked", { what }) } : told);
      });
      return accepted ? { what, before, warning } : null;
    },
  });
  useNoticeExpiry(notice, setNotice, props.motion);
  useEffect(() => {
    if (!mine) setNotice(null);
  }, [mine]);

  const sent = queue.going?.sent;
  const begun = sent && program && stampMs(program.since) !== sent.before;
  const outcome = begun ? program.outcome : Outcome.OUTCOME_UNSPECIFIED;
  useEffect(() => {
    if (!sent || outcome === Outcome.RUNNING) return;
    if (outcome === Outcome.DONE) {
      queue.done();
      const warned = sent.warning ? { warning: sent.warning } : {};
      setNotice({ kind: "done", text: t("motion_done", { what: sent.what }), ...warned });
    } else if (outcome === Outcome.ENDED) {
      queue.fail(`${t("motion_ended", { what: sent.what })}. ${reasonText(program?.reason, program?.text)}`);
    } else {
      const timer = setTimeout(() => queue.fail(t("motion_ended", { what: sent.what })), NOT_STARTED_MS);
      return () => clearTimeout(timer);
    }
  }, [sent, outcome]);

  const jogs = useRef(0);
  const lastJog = useRef<Pressed | null>(null);
  const hold = (axis: Axis, sign: 1 | -1): ((why: HoldEnd) => void) => {
    const [along, about] = JOG_SPEEDS[jogSpeed];
    const speed = sign * (isTurn(axis) ? toRadians(about) : along / 1000);
    const jog = { frame: FRAME_OF[frame], axis: JogAxis[axis.toUpperCase() as keyof typeof JogAxis], speed };
    const number = ++jogs.current;
    const what = jogName(axis, frame, sign);
    setJogging(true);
    // Else the end of the last jog would look like the end of this one.
    const starting: Notice = { kind: "busy", text: t("tool_step_checked", { what }) };
    setNotice(starting);
    const tell = (told: Notice) => number === jogs.current && setNotice(told);
    const pressed = startJog(robotKey, jog, what, tell, lastJog.current);
    lastJog.current = pressed;
    void pressed.over.finally(() => {
      if (number !== jogs.current) return;
      setJogging(false);
      setNotice((shown) => (shown === starting ? null : shown));
    });
    return (why) => pressed.release(why === "released" ? "" : t(`hold_${why}`));
  };
  const why = whyNone || (queue.going || jogging ? "" : whyNoNewMotion(controller));
  const enabled = mine && !why;
  const idle =
    why ||
    (way === "hold"
      ? t("jog_hint", { speed: JOG_SPEEDS[jogSpeed][0], turn: JOG_SPEEDS[jogSpeed][1] })
      : t("tool_step_hint", { percent: MOST_SPEED_PERCENT, speed: MOST_TOOL_SPEED }));
  const waits = queue.going && queue.waiting && [queue.going.step, queue.waiting];
  const shown = waits
    ? ({ kind: "busy", text: queue.waitingText(endText(start.current, waits, props.description)) } as const)
    : notice;
  const step = (axis: Axis, sign: 1 | -1) => {
    if (way === "hold") {
      const name = jogName(axis, frame, sign);
      return <HoldButton name={name} sign={sign} enabled={enabled && !queue.going} hold={() => hold(axis, sign)} />;
    }
    const wanted = { axis, frame, amount: sign * Number(size) };
    return (
      <StepButton name={nameOf(wanted)} sign={sign} enabled={enabled} press={(button) => queue.press(wanted, button)} />
    );
  };
  const steps = {
    choices: (
      <>
        <Choice
          label={t("step_frame")}
          values={FRAMES}
          chosen={frame}
          text={(each) => t(`frame_${each}`)}
          choose={setFrame}
        />
        <Choice label={t("tool_by")} values={WAYS} chosen={way} text={(each) => t(`tool_by_${each}`)} choose={setWay} />
        {way === "step" ? (
          <Choice label={t("step")} values={STEPS} chosen={size} text={(each) => each} choose={setSize} />
        ) : (
          <Choice
            label={t("jog_speed")}
            values={Object.keys(JOG_SPEEDS) as JogSpeed[]}
            chosen={jogSpeed}
            text={(each) => `${JOG_SPEEDS[each][0]}`}
            choose={setJogSpeed}
          />
        )}
      </>
    ),
    button: step,
    notice: <NoticeLine notice={shown} idle={idle} />,
  };
  return (
    <ToolPanel
      robotKey={robotKey}
      kinematics={props.kinematics}
      description={props.description}
      {...(mine && { steps })}
    />
  );
}

function axisText(axis: ToolStep["axis"]): string {
  return axis.length > 1 ? t(axis as "roll" | "pitch" | "yaw") : axis.toUpperCase();
}

/** Return the direction in words: "Tool X +". */
function jogName(axis: Axis, frame: ToolStep["frame"], sign: 1 | -1): string {
  return `${t(`frame_${frame}`)} ${axisText(axis)} ${sign > 0 ? "+" : "−"}`;
}

/** Return the step in words, which is the program's name in the audit log: "Tool X +5 mm". */
function nameOf({ axis, frame, amount }: ToolStep): string {
  const size = `${Math.abs(amount)}${isTurn(axis) ? "°" : "\u202fmm"}`;
  return `${t(`frame_${frame}`)} ${axisText(axis)} ${amount > 0 ? "+" : "−"}${size}`;
}

/** Return the step as a program: slow, and with the operator's speed after it. */
function programOf({ axis, frame, amount }: ToolStep, speedPercent: number | undefined): string {
  const speed = Math.min(MOST_SPEED_PERCENT, speedPercent ?? MOST_SPEED_PERCENT);
  const offset = POSE_AXES.map((each) => (each === axis ? amount : 0)).join(" ");
  const after = speedPercent && speedPercent !== speed ? `speed ${speedPercent}\n` : "";
  return `speed ${speed}\ntool_speed ${MOST_TOOL_SPEED}\nmove_line_by ${frame} ${offset}\n${after}`;
}
