// The arm's distances to limits, singularity and collision as bars: grey, or amber when short.

import type { ComponentChildren } from "preact";
import type { Description, KinematicState } from "../gen/robomesh_pb";
import { fixed, jointTitle, jointUnit, toDegrees } from "../i18n/format";
import { t } from "../i18n/texts";
import { distanceText, ownLevel, pairText, useClearanceLevel } from "../mesh/state/clearance";
import type { Level } from "../mesh/state/robot-state";
import { Unit } from "../ui/marks/unit";
import { Warning } from "../ui/marks/warning";

// Values at which a bar is full.
const FULL_CLEARANCE_M = 0.3;
const FULL_SINGULARITY = 0.25;
// Below these values a bar is amber, and the kinematics service publishes an event.
const LOW_LIMIT = 0.02; // of the range
const LOW_SINGULARITY = 0.02;

export function JointLimitsPanel(props: {
  robotKey: string;
  state: KinematicState | undefined;
  description: Description | undefined;
  stale: boolean;
}) {
  const { state, description, robotKey, stale } = props;
  const around = state?.clearance;
  const level = useClearanceLevel(robotKey, around);
  const own = state?.ownClearance;
  const limit = nearestLimit(state, description);
  const singularity = state?.singularityMargin;
  const missing = state?.notCounted ?? [];
  const unproven = state?.jointsUnproven;
  return (
    <ul class={`margins pad-0-16-8 ${stale && state ? "stale" : ""}`} aria-label={t("margins")}>
      <Margin
        name="clearance"
        label={t("clearance")}
        of={around && pairText(around, robotKey)}
        level={level}
        share={around && around.distance / Math.max(FULL_CLEARANCE_M, description?.warningDistance ?? 0)}
      >
        {around ? distanceText(around) : state && t(unproven ? "joints_unproven_short" : "nothing_around")}
      </Margin>
      <Margin
        name="own-clearance"
        label={t("own_clearance")}
        of={own && pairText(own, robotKey)}
        level={own ? ownLevel(own) : "normal"}
        share={own && own.distance / FULL_CLEARANCE_M}
      >
        {own ? distanceText(own) : unproven && t("joints_unproven_short")}
      </Margin>
      <Margin
        name="limit"
        label={t("margin")}
        of={limit?.name}
        level={!limit ? "normal" : limit.value < 0 ? "alarm" : limit.share < LOW_LIMIT ? "warning" : "normal"}
        share={limit && limit.share * 2}
      >
        {limit && (
          <>
            {fixed(limit.value, limit.unit === "mm" ? 1 : 2)}
            <Unit of={limit.unit} />
          </>
        )}
      </Margin>
      <Margin
        name="singularity"
        label={t("singularity")}
        level={singularity !== undefined && singularity < LOW_SINGULARITY ? "warning" : "normal"}
        share={singularity !== undefined ? singularity / FULL_SINGULARITY : undefined}
      >
        {singularity !== undefined && fixed(singularity, 3)}
      </Margin>
      {missing.length > 0 && (
        <Warning as="li" class="not-counted warning" text={t("not_counted", { robots: missing.join(", ") })} />
      )}
    </ul>
  );
}

/** A label, the part that is measured, a bar, and the number or words; a dash without a value. */
function Margin(props: {
  name: string;
  label: string;
  of?: string | undefined;
  level: Level;
  share: number | undefined;
  children: ComponentChildren;
}) {
  const { name, label, of, level, share } = props;
  const full = Math.min(1, Math.max(0, share ?? 0));
  return (
    <li class={`margin grid gap-12 ${level}`} data-margin={name}>
      <span class="margin-label clip dim">
        {level !== "normal" && (
          <span
            class={`shape ${level}`}
            role="img"
            aria-label={t(level === "alarm" ? "severity_error" : "severity_warning")}
          />
        )}
        {label}{" "}
        {of && (
          <span class="margin-of" title={of}>
            {of}
          </span>
        )}
      </span>
      <span class="margin-bar" aria-hidden="true">
        {share !== undefined && <span style={{ width: `${100 * full}%` }} />}
      </span>
      <span class="margin-value nowrap right">{props.children || "–"}</span>
    </li>
  );
}

/** Return the joint or constraint that is nearest to one of its limits, by its share of the range. */
function nearestLimit(state: KinematicState | undefined, description: Description | undefined) {
  let nearest: { name: string; value: number; unit: string; share: number } | undefined;
  for (const { name, lower, upper } of state?.limitMargins ?? []) {
    const margin = Math.min(lower, upper);
    const share = margin / Math.max(1e-9, lower + upper);
    if (nearest && nearest.share <= share) continue;
    const joint = description?.joints.find((each) => each.name === name);
    const { unit, factor } = joint ? jointUnit(joint) : { unit: "°", factor: toDegrees(1) };
    nearest = {
      name: joint ? jointTitle(joint) : name,
      share,
      value: margin * factor,
      unit,
    };
  }
  return nearest;
}
