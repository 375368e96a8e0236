// The page of one robot: picture, state and control.

import { useEffect, useRef, useState } from "preact/hooks";
import { JointStatesSchema } from "../../gen/foxglove/JointStates_pb";
import type { ControllerState, Description, Event, ProgramState } from "../../gen/robomesh_pb";
import {
  ControllerState_Check as Check,
  ControllerStateSchema,
  DescriptionSchema,
  KinematicStateSchema,
  ControllerState_Known as Known,
  LeaseSchema,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
  ProgramState_Outcome as Outcome,
  ProgramStateSchema,
} from "../../gen/robomesh_pb";
import { provenanceText, robotTitle } from "../../i18n/format";
import { reasonsText, reasonText } from "../../i18n/reasons";
import type { TextName } from "../../i18n/texts";
import { t } from "../../i18n/texts";
import { handleLease, holds } from "../../mesh/control/control";
import { useShownState } from "../../mesh/control/display-freshness";
import type { RobotName } from "../../mesh/state/robot-name";
import { disobeys, stateWord, stoppedByItself, stopText } from "../../mesh/state/robot-state";
import { ageOf, isStale, jointsAge } from "../../mesh/state/staleness";
import type { Latest } from "../../mesh/state/topics";
import { useEvents, useTopic } from "../../mesh/state/topics";
import { ControlPanel } from "../../panels/control/control-panel";
import { ControlRequests } from "../../panels/control/who-controls";
import { RobotAlarm } from "../../panels/robot-alarm";
import { NoRobot, useRobotSearch } from "../../panels/robot-not-found";
import type { Stage } from "../../scene/parts/stage";
import { SceneView } from "../../scene/scene-view";
import { jointsTopic } from "../../scene/topic-selection";
import { RobotTags } from "../../ui/marks/robot-tags";
import { State } from "../../ui/marks/state";
import { Tag } from "../../ui/marks/tag";
import { Warning } from "../../ui/marks/warning";
import { cellLink, programLink } from "../../ui/page/route";
import { CameraPanel } from "./camera-panel";
import { EventsPanel } from "./events/events-panel";
import { LayoutButton, LayoutPanel, layoutClasses, useLayout } from "./layout-panel";
import { ClockHint, TopicChoice } from "./low-bandwidth";
import { JointsPanel } from "./motion/joints-panel";
import { RobotTool } from "./motion/robot-tool";
import { NoteButton, NotePanel } from "./note-panel";
import { PlotsPanel } from "./plots/plots-panel";
import { isShown, ProgramLine } from "./program-line";
import { RecordButton, RecordPanel } from "./record-panel";

/** The page of a live robot; a replay has its own page, without commands. */
export function RobotPage({ site, robot }: RobotName) {
  const key = `robomesh/${site}/${robot}`;
  const controller = useTopic(ControllerStateSchema, `${key}/controller`);
  const lease = useTopic(LeaseSchema, `${key}/lease`);
  const description = useTopic(DescriptionSchema, `${key}/description`);
  const joints = useTopic(JointStatesSchema, `${key}/${jointsTopic(key)}`);
  const kinematics = useTopic(KinematicStateSchema, `${key}/kinematics`);
  const program = useTopic(ProgramStateSchema, `${key}/program`);
  const events = useEvents(key);
  const age = jointsAge(joints, controller);
  const stale = isStale("joints", age, description?.message);
  useShownState(key, joints, controller);
  const lost = useLostAt(stale, joints !== undefined);
  const holder = lease && !isStale("lease", ageOf(lease)) ? lease.message.holder : null;
  useEffect(() => {
    if (lease) handleLease(key, lease.message);
  }, [key, lease]);
  const { layout, problem, change } = useLayout();
  const stage = useRef<Stage | null>(null);
  const state = controller?.message;
  const positions = new Map(joints?.message.joints.map((joint) => [joint.name, joint.position]));
  const motion = {
    running: lease?.message.motion === true,
    stopped: state?.stop !== undefined || stoppedByItself(state),
    positions: (description?.message.joints ?? []).map((joint) => positions.get(joint.name)),
  };
  const search = useRobotSearch(key, Boolean(controller ?? description ?? lease));
  if (search !== "found") return <NoRobot search={search} site={site} robot={robot} />;
  return (
    <>
      <RobotAlarm state={state} events={events} />
      <div class={`robot grid grow short gap-8 pad-8 ${layoutClasses(layout)} ${holds(key) ? "in-control" : ""}`}>
        <Headline
          site={site}
          name={robot}
          controller={controller}
          description={description?.message}
          program={program}
          events={events}
        />
        <SceneView
          robotKey={key}
          description={description?.message}
          stale={stale}
          age={joints ? age : undefined}
          lostAt={lost}
          staged={(made) => (stage.current = made)}
          camera={layout.camera}
          setCamera={(camera) => change({ camera })}
        />
        <div class="messages stack anchor gap-8 pad-0-8">
          <Troubles site={site} controller={controller} events={events} />
          {isShown(program, events) && program.message.outcome === Outcome.ENDED && <ProgramLine latest={program} />}
          <ControlRequests robotKey={key} holder={holder} lease={lease?.message} />
          <RecordPanel robotKey={key} description={description?.message} />
          <NotePanel robotKey={key} />
          <LayoutPanel site={site} layout={layout} problem={problem} change={change} />
        </div>
        <div class="side">
          <ControlPanel
            robotKey={key}
            controller={controller}
            holder={holder}
            lease={lease?.message}
            description={description?.message}
            motion={motion}
            disobeyed={disobeys(state, events)}
          />
          <JointsPanel
            robotKey={key}
            description={description?.message}
            joints={joints?.message}
            controller={state}
            motion={motion}
            stale={stale}
            age={joints ? age : undefined}
          />
          <RobotTool
            robotKey={key}
            kinematics={kinematics}
            description={description?.message}
            controller={state}
            program={program?.message}
            motion={motion}
          />
          <EventsPanel robotKey={key} events={events} controller={controller} description={description?.message} />
        </div>
        {!layout.hidden.includes("video") && (
          <CameraPanel
            robotKey={key}
            description={description?.message}
            view={layout.video}
            setView={(video) => change({ video })}
            place={layout.place}
            setPlace={(place) => change({ place })}
            sceneView={() => stage.current?.view() ?? null}
          />
        )}
        {!layout.hidden.includes("plots") && (
          <PlotsPanel
            robotKey={key}
            description={description?.message}
            plots={layout.plots}
            setPlots={(plots) => change({ plots })}
          />
        )}
      </div>
    </>
  );
}

/** Return the time of day when live states ended; null: they are live, or none has arrived yet. */
function useLostAt(stale: boolean, any: boolean): number | null {
  const [at, setAt] = useState<number | null>(null);
  useEffect(() => setAt(stale && any ? Date.now() : null), [stale, any]);
  return at;
}

const MODES: Partial<Record<Mode, TextName>> = {
  [Mode.MODE_UNSPECIFIED]: "mode_unknown",
  [Mode.MODE_UNKNOWN]: "mode_unknown",
  [Mode.REMOTE]: "mode_remote",
  [Mode.LOCAL]: "mode_local",
};
const HOMED: Partial<Record<Known, TextName>> = {
  [Known.KNOWN_UNSPECIFIED]: "homed_unknown",
  [Known.UNKNOWN]: "homed_unknown",
  [Known.YES]: "homed",
  [Known.NO]: "not_homed",
};
const CHECKS: Partial<Record<Check, TextName>> = {
  [Check.OFF]: "check_off",
  [Check.WARN]: "check_warn",
  [Check.REQUIRE]: "check_require",
};

/** Return a fact's text; of a newer program's value, what it is of and its number. */
function factText<Value extends number>(words: Partial<Record<Value, TextName>>, value: Value, of: TextName): string {
  const word = words[value];
  return word ? t(word) : `${t(of)}: ${value}`;
}

function Headline(props: {
  site: string;
  name: string;
  controller: Latest<ControllerState> | undefined;
  description: Description | undefined;
  program: Latest<ProgramState> | undefined;
  events: readonly Event[];
}) {
  const { controller, description, program, events } = props;
  const message = controller?.message;
  const state = stateWord(controller, events);
  const source = description && provenanceText(description);
  const facts: string[] = [];
  // Do not show stale state as current.
  if (message && !isStale("controller", ageOf(controller))) {
    facts.push(factText(MODES, message.mode, "mode_unknown"), factText(HOMED, message.homed, "homed_unknown"));
    if (message.check !== Check.CHECK_UNSPECIFIED) facts.push(factText(CHECKS, message.check, "check_unknown"));
    // The others are in the Link panel: this line is cut short.
    if (message.capabilities?.diesWithLink === Known.NO) facts.push(t("lives_without_link"));
    if (message.legacyClients?.attached) facts.push(t("legacy_some", { count: message.legacyClients.attached }));
  }
  const runs = isShown(program, events) && program.message.outcome !== Outcome.ENDED;
  return (
    <div class="headline">
      <div class="glance">
        <div class="who">
          <h1 title={props.name}>{props.name}</h1>
          <State state={state} told />
        </div>
        <span class="facts dim">{facts.join(" · ")}</span>
        <RobotTags state={message} />
        {description?.simulated && <Tag kind="simulated">{t("simulated")}</Tag>}
        {runs && <ProgramLine latest={program} />}
      </div>
      <div class="about-robot">
        <a class="page-link" href={programLink(props.site, props.name)}>
          {t("program")}
        </a>
        <a class="page-link" href={cellLink(props.site, props.name)}>
          {t("cell")}
        </a>
        <RecordButton robotKey={`robomesh/${props.site}/${props.name}`} />
        <NoteButton />
        <LayoutButton />
        <TopicChoice robotKey={`robomesh/${props.site}/${props.name}`} />
        {/* A program replaces less important facts, so that nothing below moves. */}
        {runs || (
          <span
            class="provenance clip small right dim"
            lang={source === description?.provenance ? "en" : undefined}
            title={source}
          >
            {description && source && `${robotTitle(description)}: ${source}`}
          </span>
        )}
      </div>
    </div>
  );
}

/** What is wrong with the robot or its link, in sentences. */
function Troubles(props: { site: string; controller: Latest<ControllerState> | undefined; events: readonly Event[] }) {
  const { controller, events } = props;
  const message = controller?.message;
  const { level } = stateWord(controller, events);
  const flooding = message?.health?.flooding === true;
  const down = message?.link === Link.UP ? undefined : message;
  const problem = message?.fault || down?.linkText;
  const trouble = message?.fault || reasonsText(down?.linkReasons, down?.linkText);
  return (
    <>
      <ClockHint site={props.site} />
      {trouble && (
        <span class={`trouble ${level}`} lang={trouble === problem ? "en" : undefined}>
          {trouble}
        </span>
      )}
      {flooding && <Warning as="span" class="trouble warning" text={t("flooding")} />}
      {message?.stop && <span class="trouble">{stopText(message, disobeys(message, events))}</span>}
      {message?.checkText && (
        <Warning
          as="span"
          class="trouble warning"
          text={t(message.check === Check.REQUIRE ? "check_refuses" : "check_cannot", {
            text: message.checkStarting ? t("check_starting") : reasonText(message.checkReason, message.checkText),
          })}
        />
      )}
    </>
  );
}
