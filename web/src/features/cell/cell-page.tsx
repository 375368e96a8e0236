// Cell: what stands around a robot. Engineers place and move fixtures; the gateway changes all or nothing.

import { useEffect, useState } from "preact/hooks";
import { JointStatesSchema } from "../../gen/foxglove/JointStates_pb";
import { CellStateSchema, ControllerStateSchema, DescriptionSchema } from "../../gen/robomesh_pb";
import { cellText as c } from "../../i18n/texts";
import { useShownState } from "../../mesh/control/display-freshness";
import type { RobotName } from "../../mesh/state/robot-name";
import { stateWord } from "../../mesh/state/robot-state";
import { isStale, jointsAge } from "../../mesh/state/staleness";
import { useEvents, useTopic } from "../../mesh/state/topics";
import { RobotAlarm } from "../../panels/robot-alarm";
import { NoRobot, useRobotSearch } from "../../panels/robot-not-found";
import type { Stage } from "../../scene/parts/stage";
import { SceneView } from "../../scene/scene-view";
import { State } from "../../ui/marks/state";
import { robotLink } from "../../ui/page/route";
import { chosen, draft, published } from "./cell-draft";
import { addPreview, dragging } from "./cell-preview";
import { ContentPanel } from "./content-panel";
import { FixturePanel } from "./fixture-panel";
import { RobotsPanel } from "./robots-panel";
import "./cell-page.css";

export function CellPage({ site, robot }: RobotName) {
  const key = `robomesh/${site}/${robot}`;
  const controller = useTopic(ControllerStateSchema, `${key}/controller`);
  const description = useTopic(DescriptionSchema, `${key}/description`);
  const joints = useTopic(JointStatesSchema, `${key}/joints`);
  const cell = useTopic(CellStateSchema, `${key}/cell`);
  const events = useEvents(key);
  const [stage, setStage] = useState<Stage | null>(null);
  const age = jointsAge(joints, controller);
  const stale = isStale("joints", age, description?.message);
  useShownState(key, joints, controller);
  useEffect(() => void (published.value = cell?.message ?? null), [cell]);
  useEffect(
    () => () => {
      published.value = draft.value = null;
      chosen.value = "";
      dragging.value = "off";
    },
    [key],
  );
  const described = description?.message;
  useEffect(
    () => (stage && described ? addPreview(stage, `${site}/${robot}`, described) : undefined),
    [stage, described?.cellVersion],
  );
  const search = useRobotSearch(key, Boolean(controller ?? description ?? cell));
  if (search !== "found") return <NoRobot search={search} site={site} robot={robot} />;
  const state = cell?.message;
  return (
    <>
      <RobotAlarm state={controller?.message} events={events} />
      <div class="cell-page grid grow short gap-8 pad-8">
        <div class="headline">
          <div class="glance">
            <div class="who">
              <h1 title={robot}>{c("cell_of", { robot })}</h1>
              <State state={stateWord(controller, events)} />
            </div>
            <span class="facts dim">
              {state && (state.cell ? c("cell_named", { cell: state.cell }) : c("no_cell_name"))}
            </span>
          </div>
          <div class="about-robot">
            <a class="page-link" href={robotLink(site, robot)}>
              {c("to_robot")}
            </a>
          </div>
        </div>
        <SceneView
          robotKey={key}
          description={described}
          stale={stale}
          age={joints ? age : undefined}
          lostAt={null}
          staged={setStage}
        />
        <div class="cell-side stack narrow gap-8">
          {state ? (
            <>
              <ContentPanel robotKey={key} />
              <FixturePanel />
              <RobotsPanel robots={state.robots} />
            </>
          ) : (
            <p class="panel notice">{c("waiting", { robot })}</p>
          )}
        </div>
      </div>
    </>
  );
}
