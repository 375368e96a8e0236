// The chosen part: a joint's motion, a link's appearance, the tool's pose.

import { count } from "../../../i18n/format";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Choice } from "../../../ui/inputs/choice";
import { FileButton } from "../../../ui/inputs/file-button";
import type { Body, Description, Joint } from "../description/description";
import { jointUnit } from "../description/description";
import { renameJoint, renameLink, setType } from "../description/edits";
import { fileName } from "../description/paths";
import { draft, editDraft, endUndoStep, setValue } from "../draft/draft";
import { NumberField, PoseFields, ProblemWords, Section, TextField } from "../draft/fields";
import { shapeOf } from "../draft/mesh-files";
import { bodyOf, chosenBody, chosenJoint, chosenLinkName, chosenPart } from "../draft/selection";
import { chosen, takeShapeFor } from "../opening/dropped-files";

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
      {chosenPart.value === "tool" && (
        <Section title={d("tool")}>
          <h4>{d("tool_pose")}</h4>
          <PoseFields path="tool" of={d("tool_pose")} />
          <ProblemWords path="tool" />
        </Section>
      )}
    </>
  );
}

function JointDetails({ joint, index, description }: { joint: Joint; index: number; description: Description }) {
  const path = `joint/${index}`;
  const unit = jointUnit(joint.type, description.units);
  return (
    <Section
      title={`${d("joint")} ${index + 1}`}
      end={
        <Choice
          label={d("type")}
          values={["rotary", "prismatic"] as const}
          chosen={joint.type}
          text={(type) => d(type)}
          choose={(type) => type !== joint.type && editDraft((now) => setType(now.description, index, type))}
        />
      }
    >
      <div class="grid-2">
        <TextField
          path={`${path}/name`}
          label={d("joint_name")}
          set={(name) => editDraft((now) => renameJoint(now.description, index, name), `${path}/name`)}
        />
        <NumberField path={`${path}/home`} label={d("home")} unit={unit} />
        <TextField path={`${path}/title`} label={d("title")} />
        <TextField path={`${path}/title_zh`} label={d("title_zh")} />
        <NumberField path={`${path}/max_jerk`} label={d("max_jerk")} unit={`${unit}/s³`} step={10} />
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
  return (
    <Section title={joint ? d("link") : d("base")}>
      <div class="grid-2">
        {joint && (
          <TextField
            path={`${path}/name`}
            label={d("link_name")}
            placeholder={joint.name}
            set={(value) => editDraft((now) => renameLink(now.description, part as number, value), `${path}/name`)}
          />
        )}
        <Colour path={`${path}/color`} color={body.color} />
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
          take={(files) => void takeShapeFor(chosen(files), (of) => bodyOf(of, part))}
        />
        {body.mesh && (
          <Button
            quiet
            text={d("mesh_remove")}
            onClick={() =>
              editDraft((now) => Object.assign(bodyOf(now.description, part) ?? {}, { mesh: "", collision_mesh: "" }))
            }
          />
        )}
      </div>
      {body.mesh && (
        <>
          <MeshDetails path={`${path}/mesh_scale`} body={body} />
          <h4>{d("pose")}</h4>
          <PoseFields path={`${path}/mesh_pose`} of={`${d("pose")}: ${chosenLinkName(description)}`} />
        </>
      )}
      {part === "base" && (
        <>
          <h4>{d("base_pose")}</h4>
          <PoseFields path="base/pose" of={d("base_pose")} />
        </>
      )}
      <ProblemWords path={path} />
    </Section>
  );
}

function Colour({ path, color }: { path: string; color: string }) {
  return (
    <span class="field">
      <span class="label">{d("colour")}</span>
      <span class="colour row gap-8">
        <input
          type="color"
          data-path={path}
          aria-label={d("colour_choose")}
          value={/^#[0-9a-f]{6}$/i.test(color) ? color : "#8a8f94"}
          onInput={(event) => setValue(path, event.currentTarget.value)}
          onChange={endUndoStep}
        />
        <span class="grow narrow small">{color || <span class="dim">{d("colour_own")}</span>}</span>
        {color && (
          <button
            class="quiet sign"
            aria-label={d("colour_own")}
            title={d("colour_own")}
            onClick={() => setValue(path, "", true)}
          >
            ×
          </button>
        )}
      </span>
    </span>
  );
}

/** @param props.path Of the scale. */
function MeshDetails({ path, body }: { path: string; body: Body }) {
  const shape = shapeOf(body.mesh, draft.value?.files ?? {});
  if (shape === undefined || shape === "reading") return <p class="dim small">{d("mesh_reading")}</p>;
  if ("error" in shape) return null; // shown with the link's problems
  const { info } = shape;
  const size = info.max.map((value, axis) => Math.round((value - (info.min[axis] ?? 0)) * body.mesh_scale * 1000));
  const named = Object.entries(SCALES).find(([, scale]) => Math.abs(scale - body.mesh_scale) < 1e-12)?.[0] ?? "";
  const unit = d("scale_metres");
  return (
    <>
      <p class="dim small">{d("mesh_facts", { count: count(info.triangles), size: `${size.join(" × ")} mm` })}</p>
      <div class="scale-row">
        <span class="label">{d("scale")}</span>
        <Choice
          label={d("scale")}
          values={Object.keys(SCALES)}
          chosen={named}
          text={(unit) => (unit === "inch" ? d("inch") : unit)}
          choose={(unit) => setValue(path, SCALES[unit], true)}
        />
        <NumberField quiet path={path} label={`${d("scale")}, ${unit}`} unit={unit} step={0.001} />
      </div>
      {info.guess && (
        <p class="dim small">
          {d("guess", { guess: info.guess })}
          {info.scale !== body.mesh_scale && (
            <Button quiet text={d("use_guess")} onClick={() => setValue(path, info.scale, true)} />
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
