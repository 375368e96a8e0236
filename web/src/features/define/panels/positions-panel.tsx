// Sliders of the joints, and the server's position of the tool.

import { Matrix4 } from "three";
import { fixed } from "../../../i18n/format";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { numberText } from "../../../ui/inputs/number-text";
import { Unit } from "../../../ui/marks/unit";
import { Panel } from "../../../ui/panel/panel";
import type { Joint, Units } from "../description/description";
import { jointUnit } from "../description/description";
import { checkError, checked, checking } from "../draft/checks";
import { draft, editDraft } from "../draft/draft";
import { NumberField } from "../draft/fields";
import { positionOf, sliderPositions } from "../draft/selection";
import { poseOf } from "../scene/placements";

const SI_TO_SHOWN: Units = { length: "mm", angle: "deg" };

function slide(joint: Joint, position: number): void {
  sliderPositions.value = new Map([...sliderPositions.value, [joint.name, position]]);
}

export function PositionsPanel() {
  const now = draft.value;
  if (!now) return null;
  const { joint: joints, units } = now.description;
  return (
    <Panel
      name="positions"
      title={d("joints")}
      end={
        <>
          <Button
            quiet
            text={d("home_from")}
            disabled={joints.length === 0}
            onClick={() =>
              editDraft(({ description }) => {
                for (const joint of description.joint) joint.home = positionOf(joint);
              })
            }
          />
          <Button
            quiet
            text={d("to_home")}
            disabled={joints.length === 0}
            onClick={() => (sliderPositions.value = new Map())}
          />
        </>
      }
    >
      <div class="sliders grid scroll gap-0-8 pad-0-16">
        {joints.length === 0 && <p class="dim">{d("no_joints")}</p>}
        {joints.map((joint, index) => (
          <Slider key={index} joint={joint} index={index} units={units} />
        ))}
      </div>
      <ToolAt />
    </Panel>
  );
}

function Slider({ joint, index, units }: { joint: Joint; index: number; units: Units }) {
  const [lower, upper] = joint.limits;
  const position = positionOf(joint);
  const unit = jointUnit(joint.type, units);
  const usable = lower < upper;
  const step = unit === "rad" || unit === "m" ? 0.001 : 0.1;
  return (
    <div class="slider grid whole-row tall-40">
      <span class="slider-name">{joint.name}</span>
      <span class="limit small dim">{numberText(Math.round(lower * 100) / 100)}</span>
      <input
        type="range"
        aria-label={d("position_of", { joint: joint.name })}
        aria-valuetext={`${position} ${unit}`}
        min={lower}
        max={upper}
        step={step}
        value={position}
        disabled={!usable}
        onInput={(event) => slide(joint, Math.round(Number(event.currentTarget.value) * 1e4) / 1e4)}
      />
      <span class="limit small dim">{numberText(Math.round(upper * 100) / 100)}</span>
      <NumberField
        quiet
        path={`joint/${index}/position`}
        label={d("position_of", { joint: joint.name })}
        value={position}
        unit={unit}
        set={(value) => slide(joint, value)}
      />
    </div>
  );
}

/** The server's answer, which counts; the picture only illustrates it. */
function ToolAt() {
  const tool = checked.value?.tool;
  const pose = tool && poseOf(new Matrix4().set(...(tool.flat() as Parameters<Matrix4["set"]>)), SI_TO_SHOWN);
  const number = (label: string, value: number | undefined, digits: number, unit: string) => (
    <div key={label} class="right">
      <dt class="dim small">{label}</dt>
      <dd class="nowrap">
        {fixed(value, digits)}
        <Unit of={unit} />
      </dd>
    </div>
  );
  return (
    <div class="tool-line row ruled gap-16 pad-8-16">
      <h3>{d("tool")}</h3>
      <dl
        class={`tool-at grid grow narrow gap-4-8 ${checking.value || checkError.value ? "waiting" : ""}`}
        aria-label={d("tool_at")}
        data-tool={tool ? JSON.stringify(tool) : ""}
        aria-busy={checking.value}
      >
        {["x", "y", "z"].map((label, index) => number(label, pose?.xyz[index], 1, "mm"))}
        {[d("roll"), d("pitch"), d("yaw")].map((label, index) => number(label, pose?.rpy[index], 2, "°"))}
      </dl>
    </div>
  );
}
