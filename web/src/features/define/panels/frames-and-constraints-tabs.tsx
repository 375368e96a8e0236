// Named frames on links, and limits on sums of joint positions.

import type { ComponentChildren } from "preact";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import type { Description } from "../description/description";
import { jointUnit, linkNames } from "../description/description";
import { unusedName } from "../description/edits";
import { draft, editDraft } from "../draft/draft";
import { NumberField, PoseFields, ProblemWords, Section, SelectField, TextField } from "../draft/fields";

export function FramesTab() {
  const now = draft.value;
  if (!now) return null;
  const { frame: frames } = now.description;
  const links = linkNames(now.description);
  const add = (description: Description) => {
    const name = unusedName("frame", [...links, "tool", ...frames.map((frame) => frame.name)]);
    description.frame.push({ name, link: links.at(-1) ?? "base", xyz: [0, 0, 0], rpy: [0, 0, 0] });
  };
  return (
    <>
      <Intro words={d("frames_words")} does={d("add_frame")} add={add} />
      {frames.map(({ name, link }, index) => (
        <Part key={index} of="frame" index={index} title={name}>
          <div class="grid-2">
            <TextField path={`frame/${index}/name`} label={d("name")} />
            <SelectField
              path={`frame/${index}/link`}
              label={d("on_link")}
              values={links.includes(link) ? links : [...links, link]}
              text={String}
            />
          </div>
          <PoseFields path={`frame/${index}`} of={name} />
        </Part>
      ))}
    </>
  );
}

export function ConstraintsTab() {
  const now = draft.value;
  if (!now) return null;
  const { constraint: constraints, joint: joints, units } = now.description;
  const add = ({ constraint, joint, units }: Description) => {
    const named = joint.filter(({ type }) => type === "rotary").slice(1, 3);
    const limit = units.angle === "deg" ? 180 : 3.14;
    constraint.push({ joints: Object.fromEntries(named.map(({ name }) => [name, 1])), limits: [-limit, limit] });
  };
  return (
    <>
      <Intro words={d("constraints_words")} does={d("add_constraint")} add={add} disabled={joints.length === 0} />
      {constraints.map((constraint, index) => {
        const path = `constraint/${index}`;
        const first = joints.find((joint) => joint.name in constraint.joints);
        const unit = jointUnit(first?.type ?? "rotary", units);
        return (
          <Part key={index} of="constraint" index={index} title={d("constraint_number", { number: index + 1 })}>
            <div class="grid-3">
              {joints.map(({ name }) => (
                <NumberField
                  key={name}
                  path={`${path}/joints/${name}`}
                  label={d("factor_of", { joint: name })}
                  value={constraint.joints[name] ?? 0}
                  set={(value) => setFactor(index, name, value)}
                />
              ))}
            </div>
            <div class="grid-2">
              <NumberField path={`${path}/limits/0`} label={d("lower")} unit={unit} />
              <NumberField path={`${path}/limits/1`} label={d("upper")} unit={unit} />
            </div>
          </Part>
        );
      })}
    </>
  );
}

/** Set a joint's factor in a constraint; 0: the joint is no part of it. */
function setFactor(index: number, joint: string, factor: number): void {
  const path = `constraint/${index}/joints/${joint}`;
  editDraft(({ description }) => {
    const factors = description.constraint[index]?.joints;
    if (factors && factor !== 0) factors[joint] = factor;
    else delete factors?.[joint];
  }, path);
}

function Intro(props: { words: string; does: string; add: (to: Description) => void; disabled?: boolean }) {
  return (
    <div class="tab-intro">
      <p class="dim small">{props.words}</p>
      <button
        class="action small-action"
        disabled={props.disabled ?? false}
        onClick={() => editDraft(({ description }) => props.add(description))}
      >
        {props.does}
      </button>
    </div>
  );
}

/** A frame or a constraint, with a button that removes it. */
function Part(props: { of: "frame" | "constraint"; index: number; title: string; children: ComponentChildren }) {
  const { of, index, title } = props;
  return (
    <Section
      title={title}
      end={
        <Button
          quiet
          text={d("remove")}
          aria-label={d("remove_what", { name: title })}
          onClick={() => editDraft(({ description }) => void description[of].splice(index, 1))}
        />
      }
    >
      {props.children}
      <ProblemWords path={`${of}/${index}`} />
    </Section>
  );
}
