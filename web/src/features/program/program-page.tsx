// Program: a teach program of one robot: write, teach, check before it moves, run.

import { useEffect, useLayoutEffect, useState } from "preact/hooks";
import { JointStatesSchema } from "../../gen/foxglove/JointStates_pb";
import {
  ControllerStateSchema,
  DescriptionSchema,
  LeaseSchema,
  ProgramListSchema,
  ProgramStateSchema,
} from "../../gen/robomesh_pb";
import type { Words } from "../../i18n/texts";
import { noWords, programText as p, t } from "../../i18n/texts";
import { handleLease } from "../../mesh/control/control";
import { useShownState } from "../../mesh/control/display-freshness";
import { fleetRobots } from "../../mesh/state/known-robots";
import type { RobotName } from "../../mesh/state/robot-name";
import { disobeys, stateWord, stoppedByItself } from "../../mesh/state/robot-state";
import { ageOf, isStale, jointsAge } from "../../mesh/state/staleness";
import { useEvents, useTopic } from "../../mesh/state/topics";
import { ControlPanel } from "../../panels/control/control-panel";
import { ControlRequests } from "../../panels/control/who-controls";
import { RobotAlarm } from "../../panels/robot-alarm";
import { NoRobot, useRobotSearch } from "../../panels/robot-not-found";
import type { Stage } from "../../scene/parts/stage";
import { SceneView } from "../../scene/scene-view";
import { State } from "../../ui/marks/state";
import { Tag } from "../../ui/marks/tag";
import { programLink, robotLink } from "../../ui/page/route";
import { CheckPanel } from "./check/check-panel";
import { Timeline } from "./check/timeline";
import { draft, openDraft, startDraft } from "./draft/draft";
import { example } from "./draft/program-text";
import { Editor } from "./editor";
import { path } from "./motion/checked-motion";
import { startChecking } from "./motion/program-check";
import { description as described, livePositions, robotKey } from "./motion/program-robot";
import { isRunning, program } from "./motion/running-program";
import { startOverlay } from "./motion/scene-overlay";
import { RunPanel } from "./run-panel";
import { StoredPanel } from "./stored/stored-panel";
import { lastAction, say, showHash, shown, stored } from "./stored/stored-programs";
import { addTeachGizmo } from "./teach/teach-gizmo";
import { TeachPanel } from "./teach/teach-panel";
import { Toolbar } from "./toolbar";
import "../../ui/robot-cards.css";
import "./program-page.css";

const MOVED = 0.005; // rad or m: a larger distance from the check's start makes the check outdated
const SHOWN_MS = 8000;

/** The page of a robot's program; without a robot, the choice of one. */
export function ProgramPage({ shown, sha256 }: { shown: RobotName | null; sha256: string }) {
  return shown ? <ProgramOfRobot key={`${shown.site}/${shown.robot}`} {...shown} sha256={sha256} /> : <Choose />;
}

function Choose() {
  const robots = fleetRobots.value.map((key) => key.split("/").slice(1) as [string, string]);
  return (
    <div class="program-choose grid wide gap-8">
      <h1>{p("choose")}</h1>
      <p class="dim">{p("choose_words")}</p>
      {robots.length === 0 && <p class="dim">{t("no_robots")}</p>}
      <ul class="robot-cards grid gap-8">
        {robots.map(([site, robot]) => (
          <li key={`${site}/${robot}`}>
            <a class="robot-card grid card pad-8-16" href={programLink(site, robot)}>
              <strong>{robot}</strong>
              <span class="dim small">{site}</span>
            </a>
          </li>
        ))}
      </ul>
    </div>
  );
}

function ProgramOfRobot({ site, robot, sha256 }: RobotName & { sha256: string }) {
  const key = `robomesh/${site}/${robot}`;
  const controller = useTopic(ControllerStateSchema, `${key}/controller`);
  const lease = useTopic(LeaseSchema, `${key}/lease`);
  const description = useTopic(DescriptionSchema, `${key}/description`);
  const joints = useTopic(JointStatesSchema, `${key}/joints`);
  const running = useTopic(ProgramStateSchema, `${key}/program`);
  const programs = useTopic(ProgramListSchema, `${key}/programs`);
  const events = useEvents(key);
  const [outcome, setOutcome] = useFadingWords();
  const [stage, setStage] = useState<Stage | null>(null);
  useEffect(() => (stage ? addTeachGizmo(stage) : undefined), [stage]);
  const age = jointsAge(joints, controller);
  const stale = isStale("joints", age, description?.message);
  useShownState(key, joints, controller);
  const holder = lease && !isStale("lease", ageOf(lease)) ? lease.message.holder : null;
  const state = controller?.message;
  const rows = description?.message.joints ?? [];
  const byName = new Map(joints?.message.joints.map((joint) => [joint.name, joint.position]));
  const positions = rows.map((joint) => byName.get(joint.name));
  const known = !stale && rows.length > 0 && positions.every((each) => each !== undefined);

  const isKnownRobot = Boolean(controller ?? description ?? lease);
  // Close the first of two robots before opening the second: effects after painting might run in reverse order.
  // An unknown robot has no draft.
  useLayoutEffect(() => {
    if (!isKnownRobot) return;
    robotKey.value = key;
    const isKept = openDraft(key);
    const ends = [startChecking(), startOverlay()];
    setEmpty(!isKept);
    return () => {
      for (const end of ends) end();
      draft.value = null;
      described.value = undefined;
      livePositions.value = null;
      program.value = null;
      stored.value = shown.value = null;
    };
  }, [key, isKnownRobot]);
  const [empty, setEmpty] = useState(false);
  useEffect(() => void (described.value = description?.message), [description]);
  useEffect(() => void (livePositions.value = known ? (positions as number[]) : null), [joints, known]);
  useEffect(() => {
    program.value = running && !isStale("program", ageOf(running)) ? running.message : null;
  }, [running, running && isStale("program", ageOf(running))]);
  useEffect(() => void (stored.value = isKnownRobot && programs ? programs.message : null), [programs, isKnownRobot]);
  useEffect(() => {
    if (sha256 && isKnownRobot) void showHash(key, sha256);
  }, [key, sha256, isKnownRobot]);
  useEffect(() => {
    const timer = setTimeout(() => say(noWords), lastAction.value.refused ? 4 * SHOWN_MS : SHOWN_MS);
    return () => clearTimeout(timer);
  }, [lastAction.value]);
  // Show an example program to a beginner.
  useEffect(() => {
    if (!empty || rows.length === 0 || !description) return;
    setEmpty(false);
    if (!draft.value?.text) startDraft(example(description.message, p("example_comment")));
  }, [empty, description]);
  useEffect(() => {
    if (lease) handleLease(key, lease.message);
  }, [key, lease]);

  const search = useRobotSearch(key, isKnownRobot);
  if (search !== "found") return <NoRobot search={search} site={site} robot={robot} />;
  const motion = {
    running: lease?.message.motion === true,
    stopped: state?.stop !== undefined || stoppedByItself(state),
    positions,
  };
  return (
    <>
      <RobotAlarm state={state} events={events} />
      <div class="program grid grow short gap-8 pad-8">
        <div class="headline">
          <h1>{p("program_of", { robot })}</h1>
          <State state={stateWord(controller, events)} told />
          {description?.message.simulated && <Tag kind="simulated">{t("simulated")}</Tag>}
          <a class="page-link" href={robotLink(site, robot)}>
            {p("to_robot")}
          </a>
          <span class="dim small told grow right" role="status">
            {outcome()}
          </span>
        </div>
        <div class="stack narrow short gap-8">
          <Toolbar tell={setOutcome} />
          {/* The editor stays mounted: its field takes what is opened. */}
          <div class="program-text" hidden={shown.value !== null}>
            <Editor />
          </div>
          {shown.value && <StoredPanel robotKey={key} />}
          <CheckPanel moved={!isRunning() && hasMoved(positions)} />
        </div>
        <div class="program-middle stack narrow short gap-8">
          <div class="messages stack anchor gap-8 pad-0-8">
            <ControlRequests robotKey={key} holder={holder} lease={lease?.message} />
          </div>
          <SceneView
            robotKey={key}
            description={description?.message}
            stale={stale}
            age={joints ? age : undefined}
            lostAt={null}
            staged={setStage}
          />
          <Timeline />
        </div>
        <div class="program-right stack narrow short gap-8">
          <ControlPanel
            robotKey={key}
            controller={controller}
            holder={holder}
            lease={lease?.message}
            description={description?.message}
            motion={motion}
            disobeyed={disobeys(state, events)}
          />
          <RunPanel robotKey={key} controller={state} />
          <TeachPanel />
        </div>
      </div>
    </>
  );
}

/** Return whether the robot is not where the check started. */
function hasMoved(positions: readonly (number | undefined)[]): boolean {
  const start = path.value?.jointPositions;
  return start !== undefined && positions.some((each, i) => Math.abs((each ?? NaN) - (start[i] ?? NaN)) > MOVED);
}

function useFadingWords(): [Words, (words: Words) => void] {
  const [shown, setShown] = useState<{ words: Words }>({ words: noWords });
  useEffect(() => {
    const timer = setTimeout(() => setShown({ words: noWords }), SHOWN_MS);
    return () => clearTimeout(timer);
  }, [shown]);
  return [shown.words, (words) => setShown({ words })];
}
