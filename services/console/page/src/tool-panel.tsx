// Where the tool is, how fast, and how far from the nearest limit.

import { DASH, fixed, rollPitchYaw, toDegrees } from "./format";
import { Description_Joint_Type } from "./gen/robomesh_pb";
import type { Description, KinematicState } from "./gen/robomesh_pb";
import { Age, Panel } from "./parts";
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
        {["x", "y", "z"].map((axis, i) => (
          <div key={axis} class="short">
            <dt>{axis}</dt>
            <dd>
              {fixed(at[i] === undefined ? undefined : at[i]! * 1000, 1)}
              <span class="unit">mm</span>
            </dd>
          </div>
        ))}
        {["roll", "pitch", "yaw"].map((axis, i) => (
          <div key={axis} class="short">
            <dt>{axis}</dt>
            <dd>
              {fixed(angles[i], 2)}
              <span class="unit">°</span>
            </dd>
          </div>
        ))}
        <div>
          <dt>{t("tool_speed")}</dt>
          <dd>
            {fixed(speed, 1)}
            <span class="unit">mm/s</span>
          </dd>
        </div>
        <div>
          <dt>{t("manipulability")}</dt>
          <dd>
            {fixed(state?.manipulability, 4)}
            <span class="unit" />
          </dd>
        </div>
        <div class={nearest && nearest.value < 0 ? "beyond" : ""}>
          <dt>
            {t("margins")}
            {nearest ? `: ${nearest.name}` : ""}
          </dt>
          <dd>
            {nearest ? fixed(nearest.value, nearest.unit === "mm" ? 1 : 2) : DASH}
            <span class="unit">{nearest?.unit ?? ""}</span>
          </dd>
        </div>
      </dl>
    </Panel>
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
