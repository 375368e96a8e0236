// Teaching: points from the live robot, from sliders or from a pose; and the list of points.

import { useState } from "preact/hooks";
import { jointText, jointTitle, jointUnit } from "../../../i18n/format";
import type { Words } from "../../../i18n/texts";
import { noWords, programText as p } from "../../../i18n/texts";
import { targetProblem } from "../../../mesh/control/target-check";
import { Button } from "../../../ui/inputs/button";
import { Choice } from "../../../ui/inputs/choice";
import { JointTrack } from "../../../ui/joints/joint-track";
import { JointValue } from "../../../ui/joints/joint-value";
import { NoticeLine } from "../../../ui/panel/notice-line";
import { Panel } from "../../../ui/panel/panel";
import { cursorLine, draft, replace } from "../draft/draft";
import type { Move } from "../draft/program-text";
import { insertPoint, jointsText, unusedName } from "../draft/program-text";
import { description, livePositions } from "../motion/program-robot";
import { teach } from "../motion/scene-overlay";
import { taughtPositions, taughtProblem } from "../motion/taught-pose";
import { PointList } from "./point-list";
import { PosePanel } from "./pose-panel";
import "./teach-panel.css";

const METHODS = ["joints", "pose"] as const;
const MOVES = ["move_joints", "move_line"] as const;
const DEGREE = Math.PI / 180;

export function TeachPanel() {
  const [method, setMethod] = useState<(typeof METHODS)[number]>("joints");
  const [move, setMove] = useState<Move>("move_joints");
  const [outcome, setOutcome] = useState<{ words: Words }>({ words: noWords });
  const joints = description.value?.joints ?? [];
  const live = livePositions.value;
  const add = (positions: readonly number[]) => {
    const text = draft.value?.text ?? "";
    const name = unusedName(text);
    const made = insertPoint(text, name, jointsText(joints, positions), move, cursorLine());
    replace(made.text, made.line);
    setOutcome({ words: () => p("added", { name }) });
  };
  const startGhost = () => live && teach(live);
  const taught = taughtPositions.value;
  const problem = taughtProblem.value || targetProblem.value;
  return (
    <Panel
      name="teach"
      title={p("teach")}
      end={
        <>
          <span class="dim small">{p("move_with")}</span>
          <Choice label={p("move_with")} values={MOVES} chosen={move} text={(each) => p(each)} choose={setMove} />
        </>
      }
    >
      <div class="teach-row flex wrap gap-8 pad-0-16-8">
        <Button text={p("add_live")} disabled={!live} onClick={() => live && add(live)} />
        {taught ? (
          <Button text={p("end_ghost")} onClick={() => teach(null)} />
        ) : (
          <Button text={p("begin_ghost")} disabled={!live} onClick={startGhost} />
        )}
      </div>
      {taught && (
        <div class="aim">
          <div class="row wrap spread gap-8 pad-8">
            <Choice
              label={p("set_by")}
              values={METHODS}
              chosen={method}
              text={(each) => p(`by_${each}`)}
              choose={setMethod}
            />
            <Button primary text={p("add_ghost")} disabled={taughtProblem.value !== ""} onClick={() => add(taught)} />
          </div>
          {method === "joints" ? <Sliders positions={taught} /> : <PosePanel />}
          <NoticeLine notice={problem ? { kind: "refused", text: problem } : null} idle={p("moves_nothing")} />
        </div>
      )}
      <PointList tell={(words) => setOutcome({ words })} />
      <p class="notice" role="status">
        {outcome.words() || "\u00a0"}
      </p>
    </Panel>
  );
}

function Sliders({ positions }: { positions: readonly number[] }) {
  const set = (index: number, value: number) => teach(positions.map((each, i) => (i === index ? value : each)));
  return (
    <div class="joint-rows grid pad-0-16">
      {description.value?.joints.map((joint, index) => (
        <div key={joint.name} class="joint-row">
          <span class="joint-name">{jointTitle(joint)}</span>
          <div class="joint-range anchor">
            <JointTrack
              label={p("ghost_joint", { joint: jointTitle(joint) })}
              lower={joint.lower}
              upper={joint.upper}
              position={livePositions.value?.[index]}
              target={positions[index]}
              stale={false}
              enabled
              step={jointUnit(joint).unit === "°" ? DEGREE : 0.001}
              text={(value) => jointText(joint, value)}
              preview={(value) => value !== undefined && set(index, value)}
              send={(value) => set(index, value)}
            />
          </div>
          <JointValue
            joint={joint}
            position={positions[index]}
            stale={false}
            enabled
            preview={() => undefined}
            send={(value) => set(index, Math.min(joint.upper, Math.max(joint.lower, value)))}
            wrong={() => undefined}
          />
        </div>
      ))}
    </div>
  );
}
