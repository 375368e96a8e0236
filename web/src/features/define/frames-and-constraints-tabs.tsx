// Named frames on links, and limits on sums of joint positions.

import { d } from "../../i18n/define";
import { Button } from "../../ui/button";
import type { Constraint, NamedFrame, Range } from "./description";
import { angleUnit, jointUnit, linkNames } from "./description";
import { draft, editDraft, endUndoStep } from "./draft";
import { unusedName } from "./edits";
import { NumberField, PoseFields, ProblemWords, Section, SelectField, TextField } from "./fields";

function RemoveButton({ name, remove }: { name: string; remove: () => void }) {
  return (
    <Button
      quiet
      text={d("remove")}
      aria-label={d("remove_what", { name })}
      onClick={() => {
        endUndoStep();
        remove();
      }}
    />
  );
}

export function FramesTab() {
  const now = draft.value;
  if (!now) return null;
  const { frame: frames, units } = now.description;
  const links = linkNames(now.description);
  const set = (index: number, field: string, change: (frame: NamedFrame) => void) =>
    editDraft(({ description }) => {
      const own = description.frame[index];
      if (own) change(own);
    }, `frame/${index}/${field}`);
  const add = () =>
    editDraft(({ description }) => {
      const name = unusedName("frame", [...links, "tool", ...frames.map((frame) => frame.name)]);
      description.frame.push({ name, link: links.at(-1) ?? "base", xyz: [0, 0, 0], rpy: [0, 0, 0] });
    });
  return (
    <>
      <div class="tab-intro">
        <p class="dim small">{d("frames_words")}</p>
        <button class="action small-action" onClick={add}>
          {d("add_frame")}
        </button>
      </div>
      {frames.map((frame, index) => (
        <Section
          key={index}
          title={frame.name}
          end={
            <RemoveButton
              name={frame.name}
              remove={() => editDraft(({ description }) => void description.frame.splice(index, 1))}
            />
          }
        >
          <div class="grid-2">
            <TextField
              path={`frame/${index}/name`}
              label={d("name")}
              value={frame.name}
              set={(name) => set(index, "name", (own) => void (own.name = name))}
            />
            <SelectField
              path={`frame/${index}/link`}
              label={d("on_link")}
              value={frame.link}
              values={links.includes(frame.link) ? links : [...links, frame.link]}
              text={(link) => link}
              set={(link) => set(index, "link", (own) => void (own.link = link))}
            />
          </div>
          <PoseFields
            path={`frame/${index}`}
            of={frame.name}
            pose={frame}
            length={units.length}
            angle={angleUnit(units)}
            set={(change, field) => set(index, field, change)}
          />
          <ProblemWords path={`frame/${index}`} />
        </Section>
      ))}
    </>
  );
}

export function ConstraintsTab() {
  const now = draft.value;
  if (!now) return null;
  const { constraint: constraints, joint: joints, units } = now.description;
  const set = (index: number, field: string, change: (constraint: Constraint) => void) =>
    editDraft(({ description }) => {
      const own = description.constraint[index];
      if (own) change(own);
    }, `constraint/${index}/${field}`);
  const add = () =>
    editDraft(({ description }) => {
      const named = description.joint.filter((joint) => joint.type === "rotary").slice(1, 3);
      const joined = Object.fromEntries(named.map((joint) => [joint.name, 1]));
      description.constraint.push({
        joints: joined,
        limits: description.units.angle === "deg" ? [-180, 180] : [-3.14, 3.14],
      });
    });
  return (
    <>
      <div class="tab-intro">
        <p class="dim small">{d("constraints_words")}</p>
        <button class="action small-action" onClick={add} disabled={joints.length === 0}>
          {d("add_constraint")}
        </button>
      </div>
      {constraints.map((constraint, index) => {
        const title = d("constraint_number", { number: index + 1 });
        const first = joints.find((joint) => joint.name in constraint.joints);
        const unit = jointUnit(first?.type ?? "rotary", units);
        const limit = (which: 0 | 1) => (
          <NumberField
            path={`constraint/${index}/limits/${which}`}
            label={d(which === 0 ? "lower" : "upper")}
            value={constraint.limits[which]}
            unit={unit}
            set={(value) =>
              set(index, `limits/${which}`, (own) => {
                const limits: Range = [...own.limits];
                limits[which] = value;
                own.limits = limits;
              })
            }
          />
        );
        return (
          <Section
            key={index}
            title={title}
            end={
              <RemoveButton
                name={title}
                remove={() => editDraft(({ description }) => void description.constraint.splice(index, 1))}
              />
            }
          >
            <div class="grid-3">
              {joints.map((joint) => (
                <NumberField
                  key={joint.name}
                  path={`constraint/${index}/joints/${joint.name}`}
                  label={d("factor_of", { joint: joint.name })}
                  value={constraint.joints[joint.name] ?? 0}
                  set={(value) =>
                    set(index, `joints/${joint.name}`, (own) => {
                      if (value === 0) delete own.joints[joint.name];
                      else own.joints[joint.name] = value;
                    })
                  }
                />
              ))}
            </div>
            <div class="grid-2">
              {limit(0)}
              {limit(1)}
            </div>
            <ProblemWords path={`constraint/${index}`} />
          </Section>
        );
      })}
    </>
  );
}
