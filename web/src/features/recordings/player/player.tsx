// Playback of a recording: 3-D, video, curves and events on one time line; optionally with a second recording.

import { useEffect, useMemo, useState } from "preact/hooks";
import type { Recording } from "../../../gen/robomesh_pb";
import { DescriptionSchema } from "../../../gen/robomesh_pb";
import { reasonText } from "../../../i18n/reasons";
import { durationS, recordedView, recordedViews, startMs } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import type { Replay } from "../../../mesh/services/replay";
import type { MomentState } from "../../../mesh/services/replay-moment";
import { useMomentState } from "../../../mesh/services/replay-moment";
import { useTopic } from "../../../mesh/state/topics";
import { SceneView, viewsOf } from "../../../scene/scene-view";
import { Button } from "../../../ui/inputs/button";
import { ReplayTag } from "../../../ui/marks/replay-tag";
import { Warning } from "../../../ui/marks/warning";
import type { RecordingName } from "../../../ui/page/route";
import { recordingsLink } from "../../../ui/page/route";
import { Contents } from "../recorded/contents";
import { EventList } from "../recorded/event-marks";
import { Plots } from "../recorded/plots";
import { robotKeyOf, useEventsWithNotes, useFirstFrameTime, useInfo } from "../recorded/recorder-requests";
import { Comparison } from "./comparison";
import { useOpenReplay, usePosition, useSynchronised } from "./open-replay";
import { PlaybackControls } from "./playback-controls";
import { ReplayVideo } from "./replay-video";
import { useSecondGhost } from "./second-ghost";
import "./player.css";

const NO_ROBOT = "robomesh/-/-"; // until the replay has its name
const NONE: readonly never[] = [];
const noSeek = () => undefined;
const FRAMES_HOLD_S = 1; // as for live frames

export function Player({ first, second }: { first: RecordingName; second: RecordingName | null }) {
  const openReplay = useOpenReplay(first);
  const other = useOpenReplay(second, true);
  const info = useInfo(first);
  const secondInfo = useInfo(second);
  const [shift, setShift] = useState(0);
  const { replay } = openReplay;
  useSynchronised(replay, other.replay, shift);
  const moment = usePosition(replay);
  const recordedEvents = useEventsWithNotes(first, info.value);
  const secondEvents = useEventsWithNotes(second, secondInfo.value);
  const key = replay?.robotKey ?? NO_ROBOT;
  const description = useTopic(DescriptionSchema, `${key}/description`)?.message;
  const firstS = useFirstFrameTime(first, info.value);
  useEffect(() => replay?.beginAt(firstS), [replay, firstS]);
  const arm = useMomentState(replay, "frames", FRAMES_HOLD_S);
  const otherArm = useMomentState(other.replay, "joints", FRAMES_HOLD_S);
  const ghosted = useSecondGhost(key, description, other.replay?.robotKey ?? null, otherArm === "here");
  const beside = useMemo(
    () => second && { name: second, info: secondInfo.value, shift },
    [second, secondInfo.value, shift],
  );
  const state = replay?.state.value;
  const gone = replay?.gone ?? false;
  const trouble =
    openReplay.problem ||
    (gone ? r("player_gone") : state?.text && r("closed", { text: reasonText(state.reason, state.text) }));
  const events = recordedEvents.value?.list ?? NONE;
  const recorded = viewsIn(info.value);
  return (
    <div
      class={`player grid grow short gap-8 ${second ? "two" : ""}`}
      role="group"
      aria-label={r("player")}
      data-replay={key.split("/")[2]}
    >
      <div class="player-head stack gap-8">
        <div class="headline">
          <a class="page-link" href={recordingsLink()}>
            {r("back")}
          </a>
          <h1>{info.value?.name || first.file}</h1>
          <ReplayTag robot={info.value?.robot || (state?.ofRobot ?? "")} start={info.value ? startMs(info.value) : 0} />
          <span class="dim small">{r("replay_words")}</span>
          {info.value?.problem && <Trouble text={reasonText(info.value.problemReason, info.value.problem)} />}
          {info.problem && <Trouble text={r("info_refused", { text: info.problem })} />}
        </div>
        {trouble && (
          <p class="player-trouble row wrap warned gap-8" role="alert">
            <span class="shape warning" aria-hidden="true" />
            <span>{trouble}</span>
            <Button text={r("open_again")} onClick={openReplay.again} />
          </p>
        )}
        {second && (
          <Comparison
            first={first}
            name={secondInfo.value?.name || second.file}
            problem={other.problem || secondInfo.problem}
            shift={shift}
            setShift={setShift}
            events={events}
            secondEvents={secondEvents.value?.list ?? NONE}
            ghosted={ghosted}
          />
        )}
      </div>
      <SceneView
        key={key}
        robotKey={key}
        description={description}
        stale={gone}
        age={undefined}
        lostAt={null}
        arm={replay ? arm : "coming"}
      />
      <div class="player-videos stack short gap-8">
        <ReplayVideo replay={replay} arm={arm} description={description} recorded={recorded} title={r("video")} />
        {other.replay && <SecondVideo replay={other.replay} arm={otherArm} info={secondInfo.value} />}
      </div>
      <div class="player-side stack short gap-8">
        <EventList
          asked={recordedEvents}
          moment={moment}
          seek={replay?.seek ?? noSeek}
          robotKey={robotKeyOf(first, info.value)}
          startMs={info.value ? startMs(info.value) : 0}
        />
        <Contents
          name={first}
          info={info.value}
          robotKey={replay?.robotKey ?? null}
          views={[...recorded, ...viewsOf(description).map(({ name }) => name)]}
          rendered={viewsOf(description).map(({ name }) => name)}
          position={() => replay?.position() ?? 0}
        />
      </div>
      <Plots
        name={first}
        info={info.value}
        duration={state?.durationS ?? (info.value ? durationS(info.value) : 0)}
        beside={beside}
        moment={moment}
        seek={replay?.seek ?? noSeek}
      />
      {replay ? (
        <PlaybackControls replay={replay} moment={moment} events={events} />
      ) : (
        <section class="transport waiting" aria-label={r("transport")}>
          <p class="dim">{openReplay.problem ? "\u00a0" : r("opening")}</p>
        </section>
      )}
    </div>
  );
}

function SecondVideo({ replay, arm, info }: { replay: Replay; arm: MomentState; info: Recording | null }) {
  const description = useTopic(DescriptionSchema, `${replay.robotKey}/description`)?.message;
  return (
    <ReplayVideo
      replay={replay}
      arm={arm}
      description={description}
      recorded={viewsIn(info)}
      title={r("video_second", { name: info?.name ?? "" })}
    />
  );
}

/** Return the replay's views of recorded video. */
function viewsIn(info: Recording | null): readonly string[] {
  return info ? recordedViews(info).map(recordedView) : NONE;
}

function Trouble({ text }: { text: string }) {
  return <Warning as="span" class="trouble warning" text={text} />;
}
