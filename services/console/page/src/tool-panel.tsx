// Where the tool is, how fast, and how far from the nearest limit.

import { DASH, fixed, rollPitchYaw, toDegrees } from "./format";
import { Description_Joint_Type } from "./gen/robomesh_pb";
import type { Description, KinematicState } from "./gen/robomesh_pb";
import { Age, Panel, Unit } from "./parts";
import { t } from "./texts";
import { ageOf, isStale } from "./topics";
import type { Latest } from "./topics";

export function ToolPanel(props: {
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
  const nearest = nearestMargin(state, props.description);
  return (
    <Panel
      name="tool"
      title={t("tool")}
      end={props.kinematics ? <Age stale={stale} age={age} /> : <span class="dim">{t("no_data")}</span>}
    >
      <dl class={`numbers ${stale && state ? "stale" : ""}`}>
        {(["x", "y", "z"] as const).map((axis, i) => (
          <Number key={axis} label={axis} text={fixed(at[i] === undefined ? undefined : at[i]! * 1000, 1)} unit="mm" />
        ))}
        {(["roll", "pitch", "yaw"] as const).map((axis, i) => (
          <Number key={axis} label={t(axis)} text={fixed(angles[i], 2)} unit="°" />
        ))}
        <Number label={t("tool_speed")} text={fixed(speed, 1)} unit="mm/s" />
        <Number label={t("manipulability")} text={fixed(state?.manipulability, 4)} unit="" />
        <Number
          label={nearest ? t("margins", { joint: nearest.name }) : t("margin")}
          text={nearest ? fixed(nearest.value, nearest.unit === "mm" ? 1 : 2) : DASH}
          unit={nearest?.unit ?? ""}
          beyond={nearest !== null && nearest.value < 0}
        />
      </dl>
    </Panel>
  );
}

function Number(props: { label: string; text: string; unit: string; beyond?: boolean }) {
  return (
    <div class={props.beyond ? "beyond" : ""}>
      <dt title={props.label}>{props.label}</dt>
      <dd>
        {props.text}
        <Unit of={props.unit} />
      </dd>
    </div>
  );
}

/** The joint nearest to one of its limits, by its share of the range. */
function nearestMargin(state: KinematicState | undefined, description: Description | undefined) {
  let nearest: { name: string; value: number; unit: string; share: number } | null = null;
  for (const { name, lower, upper } of state?.limitMargins ?? []) {
    const margin = Math.min(lower, upper);
    const share = margin / Math.max(1e-9, lower + upper);
    if (nearest && nearest.share <= share) continue;
    const joint = description?.joints.find((each) => each.name === name);
    const slides = joint?.type === Description_Joint_Type.PRISMATIC;
    nearest = { name, share, value: slides ? margin * 1000 : toDegrees(margin), unit: slides ? "mm" : "°" };
  }
  return nearest;
}
