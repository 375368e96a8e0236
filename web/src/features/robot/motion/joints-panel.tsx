// Joint values between their limits, and the targets that move them.

import { useEffect, useState } from "preact/hooks";
import type { JointStates } from "../../../gen/foxglove/JointStates_pb";
import type { ControllerState, Description, Description_Joint } from "../../../gen/robomesh_pb";
import { ControllerState_Activity as Activity } from "../../../gen/robomesh_pb";
import { fixed, jointText, jointTitle, jointUnit } from "../../../i18n/format";
import { t } from "../../../i18n/texts";
import { isMonitor } from "../../../mesh/console/account";
import { reachable } from "../../../mesh/console/connection";
import { Command, command } from "../../../mesh/control/command";
import type { Notice } from "../../../mesh/control/control";
import { controlNotice, holds } from "../../../mesh/control/control";
import { whyFrozen } from "../../../mesh/control/display-freshness";
import { stepEnd, useJointSteps } from "../../../mesh/control/joint-steps";
import type { Motion } from "../../../mesh/control/notice-expiry";
import { useNoticeExpiry } from "../../../mesh/control/notice-expiry";
import { checkTarget, targetParts, targetProblem } from "../../../mesh/control/target-check";
import { isOnlyWatched, whyNoNewMotion, whyNoTarget, whyUnproven } from "../../../mesh/state/robot-state";
import { now } from "../../../mesh/state/topics";
import { ghostAt, redLinks } from "../../../scene/overlays";
import { StepButton } from "../../../ui/hold/step-button";
import { Choice } from "../../../ui/inputs/choice";
import { JointTrack } from "../../../ui/joints/joint-track";
import { JointValue } from "../../../ui/joints/joint-value";
import { Age } from "../../../ui/marks/state";
import { Warning } from "../../../ui/marks/warning";
import { NoticeLine } from "../../../ui/panel/notice-line";
import { Panel } from "../../../ui/panel/panel";

const REACHED = 0.002; // rad or m: half of what the page displays
const ABANDONED_MS = 1500;
const DEGREE = Math.PI / 180;
const STEPS = ["0.1", "1", "5"] as const; // degrees or mm
const MOVES = new Set([Activity.MOVING, Activity.HOMING, Activity.HOLDING]);

export function JointsPanel(props: {
  robotKey: string;
  description: Description | undefined;
  joints: JointStates | undefined;
  controller: ControllerState | undefined;
  motion: Motion;
  stale: boolean;
  age: number | null | undefined;
}) {
  const { description, robotKey, stale } = props;
  const [notice, setNotice] = useState<Notice | null>(null);
  const [targets, setTargets] = useState<readonly (number | undefined)[]>([]);
  const [preview, setPreview] = useState<{ index: number; value: number } | null>(null);
  const positions = new Map(props.joints?.joints.map((joint) => [joint.name, joint.position]));
  const rows: readonly Description_Joint[] = description?.joints ?? [];
  const current = rows.map((joint) => positions.get(joint.name));
  const mine = holds(robotKey);
  const whyNone = reachable.value
    ? whyNoTarget(props.controller) || whyFrozen(robotKey, now.value)
    : t("no_connection");
  const why = whyNone || whyNoNewMotion(props.controller);
  // A motion on hold keeps its target, and steps wait for RESUME.
  const keepsTargets = mine && !stale && !whyNone;
  const enabled = keepsTargets && !why;
  useNoticeExpiry(notice, setNotice, props.motion);

  // Show a target until it is reached or abandoned.
  const resting = props.controller?.activity !== Activity.MOVING && props.controller?.activity !== Activity.HOLDING;
  const off = targets.some((target, i) => target !== undefined && Math.abs(target - (current[i] ?? target)) > REACHED);
  useEffect(() => {
    if (!keepsTargets || (resting && !off)) setTargets([]);
    // Homing, a stop or the controller's refusal abandoned it.
    const abandoned = resting && off ? setTimeout(() => setTargets([]), ABANDONED_MS) : undefined;
    return () => clearTimeout(abandoned);
  }, [keepsTargets, resting, off]);
  useEffect(() => {
    if (!mine) setNotice(null);
  }, [mine]);

  // Only a running motion keeps its other targets: an abandoned one must not move another joint.
  const running = resting ? [] : targets;
  const wantedAt = (index: number, value: number) =>
    rows.map((_, i) => (i === index ? value : (running[i] ?? current[i])));
  const show = (index: number, value: number | undefined) => {
    setPreview(value === undefined ? null : { index, value });
  };
  useEffect(() => {
    const wanted = enabled && preview ? wantedAt(preview.index, preview.value) : null;
    const known = wanted?.every((each) => each !== undefined) ? (wanted as number[]) : null;
    ghostAt(robotKey, known);
    checkTarget(robotKey, rows, known);
    return () => ghostAt(robotKey, null);
  }, [robotKey, preview, enabled]);
  useEffect(() => () => checkTarget(robotKey, [], null), [robotKey]);
  useEffect(() => {
    redLinks.value = targetParts.value;
    return () => void (redLinks.value = new Set());
  }, [targetParts.value]);

  const send = async (index: number, value: number) => {
    show(index, undefined);
    const joint = rows[index];
    const wanted = wantedAt(index, value);
    if (!joint || wanted.some((each) => each === undefined)) return;
    setTargets(wanted.map((each, i) => (i === index || running[i] !== undefined ? each : undefined)));
    const what = `${jointTitle(joint)} ${jointText(joint, value)}`;
    const accepted = await command(
      robotKey,
      Command.MOVE_ABSOLUTE,
      what,
      { jointPositions: wanted as number[] },
      setNotice,
    );
    if (!accepted) setTargets([]);
  };
  const watching = isMonitor.value || isOnlyWatched(props.controller);
  const [size, setSize] = useState<(typeof STEPS)[number]>("1");
  const unmoved = !MOVES.has(props.controller?.activity ?? Activity.ACTIVITY_UNKNOWN);
  const steps = useJointSteps({
    robotKey,
    joints: rows,
    current,
    enabled: keepsTargets,
    resting: unmoved,
    tell: setNotice,
  });
  // The start of a step would be unknown during another motion.
  const canStep = enabled && (unmoved || steps.going !== null);
  const units = [...new Set(rows.map((joint) => jointUnit(joint).unit))].join(" / ");

  const set = preview && rows[preview.index];
  // On a phone the control panel may be off the screen.
  const lost = controlNotice.value?.kind === "lost" ? controlNotice.value : null;
  const unsent = set && t("target_unsent", { joint: jointTitle(set), value: jointText(set, preview.value) });
  const idle = unsent
    ? unsent
    : enabled
      ? t("joint_hint")
      : mine || !reachable.value
        ? why
        : watching || props.controller?.readOnly
          ? whyUnproven(props.controller)
          : t("joint_hint_take");
  return (
    <Panel
      name={`joints ${enabled ? "can-move" : ""}`}
      title={t("joints")}
      end={
        <>
          {props.controller?.jointsUnproven && (
            <Warning as="strong" class="nowrap small warned bold" text={t("joints_unproven_short")} />
          )}
          {props.age === undefined ? <span class="dim">{t("no_data")}</span> : <Age stale={stale} age={props.age} />}
          {watching || (
            <>
              <span class="step-label small dim">{t("step")}</span>
              <Choice label={t("step")} values={STEPS} chosen={size} text={(each) => each} choose={setSize} />
            </>
          )}
          <span class="step-unit small dim">{units}</span>
        </>
      }
    >
      <div class="joint-rows grid pad-0-16">
        {rows.length === 0 && Array.from({ length: 5 }, (_, i) => <div key={i} class="joint-row skeleton" />)}
        {rows.map((joint, index) => {
          const position = current[index];
          const { unit, factor } = jointUnit(joint);
          const beyond = position !== undefined && (position < joint.lower || position > joint.upper);
          const refused = steps.refused?.index === index ? Math.sign(steps.refused.offset) : 0;
          const stepBy = (sign: 1 | -1) =>
            watching ? (
              <span />
            ) : (
              <StepButton
                name={t(sign > 0 ? "step_plus" : "step_minus", {
                  joint: jointTitle(joint),
                  step: unit === "°" ? `${size}°` : `${size}\u202f${unit}`,
                })}
                sign={sign}
                enabled={canStep}
                press={(button) => steps.press({ index, offset: (sign * Number(size)) / factor }, button)}
              />
            );
          return (
            <div
              key={joint.name}
              class={`joint-row ${beyond ? "beyond" : ""}`}
              role="group"
              aria-label={jointTitle(joint)}
            >
              <span class="joint-name" title={joint.name}>
                {jointTitle(joint)}
              </span>
              {stepBy(-1)}
              <div class="joint-range anchor">
                <JointTrack
                  label={t("joint_target", { joint: jointTitle(joint) })}
                  lower={joint.lower}
                  upper={joint.upper}
                  position={position}
                  target={targets[index]}
                  stale={stale}
                  enabled={enabled}
                  step={unit === "°" ? DEGREE : 0.001}
                  text={(value) => jointText(joint, value)}
                  preview={(value) => show(index, value)}
                  send={(value) => void send(index, value)}
                />
                <Limit text={fixed(joint.lower * factor, 0)} refused={refused < 0} />
                <Limit text={fixed(joint.upper * factor, 0)} refused={refused > 0} />
              </div>
              {stepBy(1)}
              <JointValue
                joint={joint}
                position={position}
                stale={stale}
                enabled={enabled}
                preview={(value) => show(index, value)}
                send={(value) => void send(index, value)}
                wrong={(text) => setNotice({ kind: "refused", text })}
              />
            </div>
          );
        })}
      </div>
      <NoticeLine
        notice={
          unsent
            ? targetProblem.value
              ? { kind: "refused", text: `${t("sentence", { text: unsent })} ${targetProblem.value}` }
              : null
            : steps.waiting
              ? { kind: "busy", text: steps.waitingText(stepEnd(rows, current, steps)) }
              : (notice ?? lost)
        }
        idle={idle}
      />
    </Panel>
  );
}

function Limit({ text, refused }: { text: string; refused: boolean }) {
  if (!refused) return <span class="limit small dim">{text}</span>;
  return <Warning as="strong" class="limit small refused" text={text} />;
}
