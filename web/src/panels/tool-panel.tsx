// The tool's position and speed, and the arm's distances to its limits.

import type { Description, KinematicState } from "../gen/robomesh_pb";
import { fixed, rollPitchYaw, toDegrees } from "../i18n/format";
import { t } from "../i18n/texts";
import type { Latest } from "../mesh/topics";
import { ageOf, isStale } from "../mesh/topics";
import { Panel } from "../ui/panel";
import { Age } from "../ui/state";
import { Unit } from "../ui/unit";
import { JointLimitsPanel } from "./joint-limits-panel";

export function ToolPanel(props: {
  robotKey: string;
  kinematics: Latest<KinematicState> | undefined;
  description: Description | undefined;
}) {
  const state = props.kinematics?.message;
  const age = ageOf(props.kinematics);
  const stale = isStale("kinematics", age);
  const pose = state?.toolToBase.length === 16 ? state.toolToBase : undefined;
  const at = pose ? [pose[3], pose[7], pose[11]] : [];
  const angles = pose ? rollPitchYaw(pose).map(toDegrees) : [];
  const v = state?.linearVelocity;
  const speed = v ? Math.hypot(v.x, v.y, v.z) * 1000 : undefined;
  return (
    <Panel
      name="tool"
      title={t("tool")}
      end={props.kinematics ? <Age stale={stale} age={age} /> : <span class="dim">{t("no_data")}</span>}
    >
      <dl class={`numbers ${stale && state ? "stale" : ""}`}>
        {(["x", "y", "z"] as const).map((axis, i) => (
          <NumberRow key={axis} label={axis} text={fixed(millimetres(at[i]), 1)} unit="mm" />
        ))}
        {(["roll", "pitch", "yaw"] as const).map((axis, i) => (
          <NumberRow key={axis} label={t(axis)} text={fixed(angles[i], 2)} unit="°" />
        ))}
        <NumberRow label={t("tool_speed")} text={fixed(speed, 1)} unit="mm/s" />
        <NumberRow label={t("manipulability")} text={fixed(state?.manipulability, 4)} unit="" />
      </dl>
      <JointLimitsPanel robotKey={props.robotKey} state={state} description={props.description} stale={stale} />
    </Panel>
  );
}

function millimetres(metres: number | undefined): number | undefined {
  return metres === undefined ? undefined : metres * 1000;
}

function NumberRow(props: { label: string; text: string; unit: string }) {
  return (
    <div>
      <dt title={props.label}>{props.label}</dt>
      <dd>
        {props.text}
        <Unit of={props.unit} />
      </dd>
    </div>
  );
}
