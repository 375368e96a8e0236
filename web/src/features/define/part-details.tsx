// The chosen part: a joint's motion, a link's appearance, the tool's pose.

import { d } from "../../i18n/define";
import { Button } from "../../ui/button";
import { Choice } from "../../ui/choice";
import { FileButton } from "../../ui/file-button";
import type { Body, Description, Joint } from "./description";
import { angleUnit, jointUnit } from "./description";
import { draft, editDraft, endUndoStep } from "./draft";
import { chosen, takeShapeFor } from "./dropped-files";
import { renameJoint, renameLink, setType } from "./edits";
import { NumberField, PoseFields, ProblemWords, Section, TextField } from "./fields";
import { fileName } from "./kinematic-chain";
import { shapeOf } from "./mesh-files";
import { chosenBody, chosenJoint, chosenLinkName, chosenPart } from "./selection";

const SCALES: Record<string, number> = { mm: 0.001, cm: 0.01, m: 1, inch: 0.0254 };

export function PartDetails() {
  const now = draft.value;
  if (!now) return null;
  const { description } = now;
  const joint = chosenJoint(description);
  const body = chosenBody(description);
  return (
    <>
      {joint && <JointDetails joint={joint} index={chosenPart.value as number} description={description} />}
      {body && <BodyDetails body={body} description={description} />}
      {chosenPart.value === "tool" && <ToolDetails description={description} />}
    </>
  );
}

function JointDetails({ joint, index, description }: { joint: Joint; index: number; description: Description }) {
  const path = `joint/${index}`;
  const unit = jointUnit(joint.type, description.units);
  const set = (field: string, change: (joint: Joint) => void) =>
    editDraft((now) => {
      const own = now.description.joint[index];
      if (own) change(own);
    }, `${path}/${field}`);
  return (
    <Section
      title={`${d("joint")} ${index + 1}`}
      end={
        <Choice
          label={d("type")}
          values={["rotary", "prismatic"] as const}
          chosen={joint.type}
          text={(type) => d(type)}
          choose={(type) => {
            endUndoStep();
            if (type !== joint.type) editDraft((now) => setType(now.description, index, type));
          }}
        />
      }
    >
      <div class="grid-2">
        <TextField
          path={`${path}/name`}
          label={d("joint_name")}
          value={joint.name}
          set={(name) => editDraft((now) => renameJoint(now.description, index, name), `${path}/name`)}
        />
        <NumberField
          path={`${path}/home`}
          label={d("home")}
          value={joint.home}
          unit={unit}
          set={(value) => set("home", (own) => void (own.home = value))}
        />
        {(["title", "title_zh"] as const).map((key) => (
          <TextField
            key={key}
            path={`${path}/${key}`}
            label={d(`joint_${key}`)}
            value={joint[key]}
            set={(title) => set(key, (own) => void (own[key] = title))}
          />
        ))}
        <NumberField
          path={`${path}/max_jerk`}
          label={d("max_jerk")}
          value={joint.max_jerk}
          unit={`${unit}/s³`}
          step={10}
          set={(value) => set("max_jerk", (own) => void (own.max_jerk = value))}
        />
      </div>
      {["name", "title", "title_zh", "type", "home", "max_jerk"].map((key) => (
        <ProblemWords key={key} path={`${path}/${key}`} />
      ))}
    </Section>
  );
}

function BodyDetails({ body, description }: { body: Body; description: Description }) {
  const part = chosenPart.value;
  const path = part === "base" ? "base" : `joint/${part}/link`;
  const joint = chosenJoint(description);
  const name = chosenLinkName(description);
  const find = (of: Description) =>
    part === "base" ? of.base : typeof part === "number" ? of.joint[part]?.link : undefined;
  const set = (field: string, change: (body: Body) => void) =>
    editDraft((now) => {
      const own = find(now.description);
      if (own) change(own);
    }, `${path}/${field}`);
  return (
    <Section title={joint ? d("link") : d("base")}>
      <div class="grid-2">
        {joint && (
          <TextField
            path={`${path}/name`}
            label={d("link_name")}
            value={joint.link.name}
            placeholder={joint.name}
            set={(value) => editDraft((now) => renameLink(now.description, part as number, value), `${path}/name`)}
          />
        )}
        <Colour path={path} body={body} set={set} />
      </div>
      <div class="mesh-row">
        <span class="mesh-name" title={body.mesh}>
          <span class="label">{d("mesh")}</span>
          {body.mesh ? fileName(body.mesh) : <span class="dim">{d("mesh_none")}</span>}
          {body.collision_mesh && (
            <span class="dim small"> {d("mesh_checked", { file: fileName(body.collision_mesh) })}</span>
          )}
        </span>
        <FileButton
          path={`${path}/mesh`}
          label={d("mesh_choose")}
          quiet
          multiple
          take={(files) => void takeShapeFor(chosen(files), find)}
        />
        {body.mesh && (
          <Button
            quiet
            text={d("mesh_remove")}
            onClick={() => {
              endUndoStep();
              set("mesh", (own) => void (own.mesh = own.collision_mesh = ""));
            }}
          />
        )}
      </div>
      {body.mesh && <MeshDetails path={path} body={body} set={set} />}
      {body.mesh && (
        <>
          <h4>{d("pose")}</h4>
          <PoseFields
            path={`${path}/mesh_pose`}
            of={`${d("pose")}: ${name}`}
            pose={body.mesh_pose}
            length={description.units.length}
            angle={angleUnit(description.units)}
            set={(change, field) => set(`mesh_pose/${field}`, (own) => change(own.mesh_pose))}
          />
        </>
      )}
      {part === "base" && (
        <>
          <h4>{d("base_pose")}</h4>
          <PoseFields
            path="base/pose"
            of={d("base_pose")}
            pose={description.base.pose}
            length={description.units.length}
            angle={angleUnit(description.units)}
            set={(change, field) => editDraft((now) => change(now.description.base.pose), `base/pose/${field}`)}
          />
        </>
      )}
      <ProblemWords path={path} />
    </Section>
  );
}

type SetBody = (field: string, change: (body: Body) => void) => void;

function Colour({ path, body, set }: { path: string; body: Body; set: SetBody }) {
  return (
    <span class="field">
      <span class="label">{d("colour")}</span>
      <span class="colour">
        <input
          type="color"
          data-path={`${path}/color`}
          aria-label={d("colour_choose")}
          value={/^#[0-9a-f]{6}$/i.test(body.color) ? body.color : "#8a8f94"}
          onInput={(event) => set("color", (own) => void (own.color = event.currentTarget.value))}
          onChange={endUndoStep}
        />
        <span class="colour-word">{body.color || <span class="dim">{d("colour_own")}</span>}</span>
        {body.color && (
          <button
            class="quiet sign"
            aria-label={d("colour_own")}
            title={d("colour_own")}
            onClick={() => {
              endUndoStep();
              set("color", (own) => void (own.color = ""));
            }}
          >
            ×
          </button>
        )}
      </span>
    </span>
  );
}

function MeshDetails({ path, body, set }: { path: string; body: Body; set: SetBody }) {
  const now = draft.value;
  const shape = now ? shapeOf(body.mesh, now.files) : undefined;
  if (shape === undefined || shape === "reading") return <p class="dim small">{d("mesh_reading")}</p>;
  if ("error" in shape) return null; // shown with the link's problems
  const { info } = shape;
  const size = info.max.map((value, axis) => Math.round((value - (info.min[axis] ?? 0)) * body.mesh_scale * 1000));
  const named = Object.entries(SCALES).find(([, scale]) => Math.abs(scale - body.mesh_scale) < 1e-12)?.[0] ?? "";
  return (
    <>
      <p class="dim small">
        {d("mesh_facts", { count: info.triangles.toLocaleString("en"), size: `${size.join(" × ")} mm` })}
      </p>
      <div class="scale-row">
        <span class="label">{d("scale")}</span>
        <Choice
          label={d("scale")}
          values={Object.keys(SCALES)}
          chosen={named}
          text={(unit) => (unit === "inch" ? d("inch") : unit)}
          choose={(unit) => {
            endUndoStep();
            set("mesh_scale", (own) => void (own.mesh_scale = SCALES[unit] ?? own.mesh_scale));
          }}
        />
        <NumberField
          quiet
          path={`${path}/mesh_scale`}
          label={`${d("scale")}, ${d("scale_metres")}`}
          value={body.mesh_scale}
          unit={d("scale_metres")}
          step={0.001}
          set={(value) => set("mesh_scale", (own) => void (own.mesh_scale = value))}
        />
      </div>
      {info.guess && (
        <p class="dim small">
          {d("guess", { guess: info.guess })}
          {info.scale !== body.mesh_scale && (
            <Button
              quiet
              text={d("use_guess")}
              onClick={() => {
                endUndoStep();
                set("mesh_scale", (own) => void (own.mesh_scale = info.scale));
              }}
            />
          )}
        </p>
      )}
      {info.warnings.map((warning) => (
        <p key={warning} class="dim small">
          {warning}
        </p>
      ))}
    </>
  );
}

function ToolDetails({ description }: { description: Description }) {
  return (
    <Section title={d("tool")}>
      <h4>{d("tool_pose")}</h4>
      <PoseFields
        path="tool"
        of={d("tool_pose")}
        pose={description.tool}
        length={description.units.length}
        angle={angleUnit(description.units)}
        set={(change, field) => editDraft((now) => change(now.description.tool), `tool/${field}`)}
      />
      <ProblemWords path="tool" />
    </Section>
  );
}
