// Joint values between their limits, and the targets that move them.

import { useEffect, useState } from "preact/hooks";
import { Command, command, holds } from "./control";
import type { Notice } from "./control";
import { DASH, fixed, jointText, jointUnit } from "./format";
import type { JointStates } from "./gen/foxglove/JointStates_pb";
import { ControllerState_Activity as Activity } from "./gen/robomesh_pb";
import type { ControllerState, Description, Description_Joint } from "./gen/robomesh_pb";
import { showGhost } from "./ghost";
import { JointTrack } from "./joint-track";
import { Age, NoticeLine, Panel, Unit } from "./parts";
import { t } from "./texts";

const REACHED = 0.002; // rad or m: half of what a person reads off
const ABANDONED_MS = 1500;
const DEGREE = Math.PI / 180;

export function JointsPanel(props: {
  robotKey: string;
  description: Description | undefined;
  joints: JointStates | undefined;
  controller: ControllerState | undefined;
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
  const enabled = mine && !stale && !props.controller?.stop && !props.controller?.readOnly;

  // A target is shown until it is reached, or until nothing will reach it.
  const resting = props.controller?.activity !== Activity.MOVING && props.controller?.activity !== Activity.HOLDING;
  const off = targets.some((target, i) => target !== undefined && Math.abs(target - (current[i] ?? target)) > REACHED);
  useEffect(() => {
    if (!enabled || (resting && !off)) setTargets([]);
    // Homing, a stop or the controller's refusal left it behind.
    const abandoned = resting && off ? setTimeout(() => setTargets([]), ABANDONED_MS) : undefined;
    return () => clearTimeout(abandoned);
  }, [enabled, resting, off]);
  useEffect(() => {
    if (!mine) setNotice(null);
  }, [mine]);

  // Only a motion that runs keeps its other targets: an abandoned one must not move a joint that nobody touched.
  const running = resting ? [] : targets;
  const wantedAt = (index: number, value: number) =>
    rows.map((_, i) => (i === index ? value : (running[i] ?? current[i])));
  const show = (index: number, value: number | undefined) => {
    setPreview(value === undefined ? null : { index, value });
    const wanted = value === undefined ? null : wantedAt(index, value);
    showGhost(robotKey, wanted?.every((each) => each !== undefined) ? (wanted as number[]) : null);
  };
  useEffect(() => () => showGhost(robotKey, null), [robotKey, enabled]);

  const send = async (index: number, value: number) => {
    show(index, undefined);
    const joint = rows[index];
    const wanted = wantedAt(index, value);
    if (!joint || wanted.some((each) => each === undefined)) return;
    setTargets(wanted.map((each, i) => (i === index || running[i] !== undefined ? each : undefined)));
    const what = `${joint.name} ${jointText(joint, value)}`;
    const accepted = await command(
      robotKey,
      Command.MOVE_ABSOLUTE,
      what,
      { jointPositions: wanted as number[] },
      setNotice,
    );
    if (!accepted) setTargets([]);
  };
  const set = preview && rows[preview.index];
  const idle = set
    ? `${t("target")} ${set.name}: ${jointText(set, preview.value)}`
    : enabled
      ? t("joint_hint")
      : mine
        ? ""
        : t("joint_hint_take");
  return (
    <Panel
      name={`joints ${enabled ? "can-move" : ""}`}
      title={t("joints")}
      end={props.age === undefined ? <span class="dim">{t("no_data")}</span> : <Age stale={stale} age={props.age} />}
    >
      <div class="joint-rows">
        {rows.length === 0 && Array.from({ length: 5 }, (_, i) => <div key={i} class="joint-row skeleton" />)}
        {rows.map((joint, index) => {
          const position = current[index];
          const { unit, decimals, factor } = jointUnit(joint);
          const beyond = position !== undefined && (position < joint.lower || position > joint.upper);
          return (
            <div key={joint.name} class={`joint-row ${beyond ? "beyond" : ""}`}>
              <span class="joint-name">{joint.name}</span>
              <span class="limit dim">{fixed(joint.lower * factor, 0)}</span>
              <JointTrack
                label={t("joint_target", { joint: joint.name })}
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
              <span class="limit dim">{fixed(joint.upper * factor, 0)}</span>
              <span class={`value ${stale ? "stale" : ""}`} data-joint={joint.name}>
                {position === undefined ? DASH : fixed(position * factor, decimals)}
                <Unit of={unit} />
              </span>
            </div>
          );
        })}
      </div>
      <NoticeLine notice={preview ? null : notice} idle={idle} />
    </Panel>
  );
}
