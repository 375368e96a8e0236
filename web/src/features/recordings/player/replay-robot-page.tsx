// The page of a replayed robot: its recorded state and the playback controls, without commands.

import { useEffect, useState } from "preact/hooks";
import { JointStatesSchema } from "../../../gen/foxglove/JointStates_pb";
import type { ReplayState } from "../../../gen/robomesh_pb";
import { DescriptionSchema, KinematicStateSchema, ReplayStateSchema } from "../../../gen/robomesh_pb";
import { stampMs } from "../../../i18n/format";
import { recordingsText as r } from "../../../i18n/texts";
import { Replay } from "../../../mesh/services/replay";
import { useMomentState } from "../../../mesh/services/replay-moment";
import type { RobotName } from "../../../mesh/state/robot-name";
import { ageOf, isStale } from "../../../mesh/state/staleness";
import { useTopic } from "../../../mesh/state/topics";
import { NoRobot, useRobotSearch } from "../../../panels/robot-not-found";
import { ToolPanel } from "../../../panels/tool-panel";
import { SceneView } from "../../../scene/scene-view";
import { ReplayTag } from "../../../ui/marks/replay-tag";
import { Warning } from "../../../ui/marks/warning";
import { recordingsLink } from "../../../ui/page/route";
import { Panel } from "../../../ui/panel/panel";
import { usePosition } from "./open-replay";
import { PlaybackControls } from "./playback-controls";
import { RecordedJoints } from "./recorded-joints";
import { ReplayVideo } from "./replay-video";
import "../../../ui/marks/replay.css";
import "./player.css";

const NONE: readonly never[] = [];

export function ReplayRobotPage({ site, robot }: RobotName) {
  const key = `robomesh/${site}/${robot}`;
  const latest = useTopic(ReplayStateSchema, `${key}/replay`);
  const description = useTopic(DescriptionSchema, `${key}/description`)?.message;
  const joints = useTopic(JointStatesSchema, `${key}/joints`)?.message;
  const kinematics = useTopic(KinematicStateSchema, `${key}/kinematics`);
  const replay = useReplay(key, latest?.message);
  const moment = usePosition(replay);
  const arm = useMomentState(replay, "frames", 1);
  const gone = latest !== undefined && isStale("replay", ageOf(latest));
  const search = useRobotSearch(key, Boolean(latest ?? description));
  if (search !== "found") return <NoRobot search={search} site={site} robot={robot} />;
  const state = latest?.message;
  return (
    <div class="player grid grow short gap-8 of-robot" data-replay={robot}>
      <div class="player-head stack gap-8">
        <div class="headline">
          <h1>{robot}</h1>
          <ReplayTag robot={state?.ofRobot ?? description?.replay?.robot ?? ""} start={stampMs(state?.start)} />
          <span class="dim small">{r("replay_words")}</span>
          {state && (
            <a class="page-link" href={recordingsLink({ site, file: state.file })}>
              {r("to_recording")}
            </a>
          )}
        </div>
        {gone && <Warning class="player-trouble row wrap warned gap-8" role="alert" text={r("player_gone")} />}
      </div>
      <SceneView
        key={key}
        robotKey={key}
        description={description}
        stale={gone}
        age={undefined}
        lostAt={null}
        arm={arm}
      />
      <div class="player-videos stack short gap-8">
        <ReplayVideo replay={replay} arm={arm} description={description} recorded={NONE} title={r("video")} />
      </div>
      <div class="player-side stack short gap-8">
        <Panel name="joints" title={r("joints")}>
          <RecordedJoints description={description} joints={arm === "here" ? joints : undefined} />
        </Panel>
        <ToolPanel robotKey={key} kinematics={kinematics} description={description} />
      </div>
      {replay && <PlaybackControls replay={replay} moment={moment} events={NONE} />}
    </div>
  );
}

/** Follow a replay that another page opened, without closing it. */
function useReplay(key: string, state: ReplayState | undefined): Replay | null {
  const [replay, setReplay] = useState<Replay | null>(null);
  const known = state !== undefined;
  useEffect(() => {
    if (!state) return;
    const made = new Replay(key, state);
    setReplay(made);
    return () => {
      made.unfollow();
      setReplay(null);
    };
  }, [key, known]);
  return replay;
}
