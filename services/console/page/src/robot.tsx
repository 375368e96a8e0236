// One robot: what it looks like, what it does, and control of it.

import { useEffect, useState } from "preact/hooks";
import { Camera } from "./camera";
import { held, holds, seeHolder } from "./control";
import { ControlPanel } from "./control-panel";
import { EventsPanel } from "./events-panel";
import {
  ControllerStateSchema,
  ControllerState_Known as Known,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
} from "./gen/robomesh_pb";
import { DescriptionSchema, KinematicStateSchema, LeaseSchema } from "./gen/robomesh_pb";
import type { ControllerState, Description } from "./gen/robomesh_pb";
import { JointStatesSchema } from "./gen/foxglove/JointStates_pb";
import { History } from "./history";
import { JointsPanel } from "./joints-panel";
import { State, Tag } from "./parts";
import { stateWord, stopText } from "./robot-state";
import type { RobotName } from "./route";
import { SceneView } from "./scene-view";
import { t } from "./texts";
import { ToolPanel } from "./tool-panel";
import { ageOf, isStale, jointsAge, useTopic } from "./topics";
import type { Latest } from "./topics";

export function Robot({ site, robot }: RobotName) {
  const key = `robomesh/${site}/${robot}`;
  const controller = useTopic(ControllerStateSchema, `${key}/controller`);
  const lease = useTopic(LeaseSchema, `${key}/lease`);
  const description = useTopic(DescriptionSchema, `${key}/description`);
  const joints = useTopic(JointStatesSchema, `${key}/joints`);
  const kinematics = useTopic(KinematicStateSchema, `${key}/kinematics`);
  const age = jointsAge(joints, controller);
  const stale = isStale("joints", age);
  const lost = useLostAt(stale, joints !== undefined);
  const holder = lease && !isStale("lease", ageOf(lease)) ? lease.message.holder : null;
  useEffect(() => {
    if (lease && holder !== null) seeHolder(key, holder);
  }, [key, lease, holder]);
  const [videoLarge, setVideoLarge] = useState(false);
  const inControl = holds(key) && held.value !== null;
  return (
    <div class={`robot ${inControl ? "in-control" : ""} ${videoLarge ? "video-large" : ""}`}>
      <Headline name={robot} controller={controller} description={description?.message} stale={stale} age={age} />
      <SceneView
        robotKey={key}
        description={description?.message}
        stale={stale}
        age={joints ? age : undefined}
        lostAt={lost}
      />
      <div class="side">
        <ControlPanel robotKey={key} controller={controller} holder={holder} lease={lease?.message} />
        <JointsPanel
          robotKey={key}
          description={description?.message}
          joints={joints?.message}
          controller={controller?.message}
          stale={stale}
          age={joints ? age : undefined}
        />
        <ToolPanel kinematics={kinematics} description={description?.message} />
        <EventsPanel robotKey={key} />
      </div>
      <Camera robotKey={key} description={description?.message} large={videoLarge} setLarge={setVideoLarge} />
      <History robotKey={key} description={description?.message} />
    </div>
  );
}

/** When live states ended, as a time of day; null while they come, or before the first. */
function useLostAt(stale: boolean, any: boolean): number | null {
  const [at, setAt] = useState<number | null>(null);
  useEffect(() => setAt(stale && any ? Date.now() : null), [stale, any]);
  return at;
}

function Headline(props: {
  name: string;
  controller: Latest<ControllerState> | undefined;
  description: Description | undefined;
  stale: boolean;
  age: number | null;
}) {
  const { controller, description } = props;
  const message = controller?.message;
  const state = stateWord(controller);
  const facts: string[] = [];
  // What was so is not said as if it were so.
  if (message && !isStale("controller", ageOf(controller))) {
    facts.push(t(message.mode === Mode.LOCAL ? "mode_local" : message.mode === Mode.REMOTE ? "mode_remote" : "mode_unknown"));
    facts.push(t(message.homed === Known.YES ? "homed" : message.homed === Known.NO ? "not_homed" : "homed_unknown"));
    if (message.readOnly) facts.push(t("read_only"));
  }
  const trouble = message?.fault || (message?.link !== Link.UP && message?.linkText);
  return (
    <div class="headline">
      <h1>{props.name}</h1>
      <State state={state} />
      <span class="facts dim">{facts.join(" · ")}</span>
      {description?.simulated && <Tag kind="simulated">{t("simulated")}</Tag>}
      {trouble && <span class={`trouble ${state.level}`}>{trouble}</span>}
      {message?.stop && (
        <span class="trouble">{stopText(message.stop)}</span>
      )}
      {description?.provenance && (
        <span class="provenance dim" title={description.provenance}>
          {description.title}: {description.provenance}
        </span>
      )}
    </div>
  );
}
