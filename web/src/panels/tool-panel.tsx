// The tool's position and speed, and the arm's distances to its limits.

import type { ComponentChildren } from "preact";
import type { Description, KinematicState } from "../gen/robomesh_pb";
import { fixed, rollPitchYaw, toDegrees } from "../i18n/format";
import { t } from "../i18n/texts";
import { ageOf, isStale } from "../mesh/state/staleness";
import type { Latest } from "../mesh/state/topics";
import { Age } from "../ui/marks/state";
import { Unit } from "../ui/marks/unit";
import { Panel } from "../ui/panel/panel";
import { JointLimitsPanel } from "./joint-limits-panel";

export const POSE_AXES = ["x", "y", "z", "roll", "pitch", "yaw"] as const;
export type Axis = (typeof POSE_AXES)[number];

/** What moves the tool, for the operator in control. */
export interface ToolSteps {
  choices: ComponentChildren;
  button: (axis: Axis, sign: 1 | -1) => ComponentChildren;
  notice: ComponentChildren;
}

export function ToolPanel(props: {
  robotKey: string;
  kinematics: Latest<KinematicState> | undefined;
  description: Description | undefined;
  steps?: ToolSteps;
}) {
  const { steps } = props;
  const state = props.kinematics?.message;
  const age = ageOf(props.kinematics);
  const stale = isStale("kinematics", age, props.description);
  const pose = state?.toolToBase.length === 16 ? state.toolToBase : undefined;
  const at = pose ? [pose[3], pose[7], pose[11]] : [];
  const angles = pose ? rollPitchYaw(pose).map(toDegrees) : [];
  const v = state?.linearVelocity;
  const speed = v ? Math.hypot(v.x, v.y, v.z) * 1000 : undefined;
  return (
    <Panel
      name="tool"
      title={t("tool")}
      end={
        <>
          {props.kinematics ? <Age stale={stale} age={age} /> : <span class="dim">{t("no_data")}</span>}
          {steps?.choices}
        </>
      }
    >
      <dl class={`numbers grid pad-0-16-12 ${steps ? "stepped" : ""} ${stale && state ? "outdated" : ""}`}>
        {POSE_AXES.map((axis, i) => (
          <NumberRow
            key={axis}
            label={i < 3 ? axis : t(axis as "roll" | "pitch" | "yaw")}
            text={i < 3 ? fixed(millimetres(at[i]), 1) : fixed(angles[i - 3], 2)}
            unit={i < 3 ? "mm" : "°"}
            {...(steps && { minus: steps.button(axis, -1), plus: steps.button(axis, 1) })}
          />
        ))}
        <NumberRow label={t("speed")} text={fixed(speed, 1)} unit="mm/s" />
        <NumberRow label={t("manipulability")} text={fixed(state?.manipulability, 4)} unit="" />
      </dl>
      {steps?.notice}
      <JointLimitsPanel robotKey={props.robotKey} state={state} description={props.description} stale={stale} />
    </Panel>
  );
}

function millimetres(metres: number | undefined): number | undefined {
  return metres === undefined ? undefined : metres * 1000;
}

function NumberRow(props: {
  label: string;
  text: string;
  unit: string;
  minus?: ComponentChildren;
  plus?: ComponentChildren;
}) {
  return (
    <div class="flex spread baseline narrow gap-8">
      <dt class="dim small clip" title={props.label}>
        {props.label}
      </dt>
      <dd class="rigid nowrap">
        {props.minus}
        <span class="number">
          {props.text}
          <Unit of={props.unit} />
        </span>
        {props.plus}
      </dd>
    </div>
  );
}
