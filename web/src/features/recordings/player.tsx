// Playback of a recording: 3-D, video, curves and events on one time line; optionally with a second recording.

import { useEffect, useMemo, useState } from "preact/hooks";
import type { Recording } from "../../gen/robomesh_pb";
import { DescriptionSchema } from "../../gen/robomesh_pb";
import { durationS, recordedViews, startMs } from "../../i18n/recording-format";
import { r, recordedView } from "../../i18n/recordings";
import type { Replay } from "../../mesh/replay";
import type { OfMoment } from "../../mesh/replay-moment";
import { useOfMoment } from "../../mesh/replay-moment";
import { useTopic } from "../../mesh/topics";
import { SceneView, viewsOf } from "../../scene/scene-view";
import { ReplayTag } from "../../ui/replay-tag";
import type { RecordingName } from "../../ui/route";
import { recordingsLink } from "../../ui/route";
import { useFirst, useHappened, useInfo } from "./recorder-requests";
import { Beside } from "./comparison";
import { Contents } from "./contents";
import { EventList } from "./event-marks";
import { useFollowing, useMoment, useOpened } from "./open-replay";
import { Plots } from "./plots";
import { ReplayVideo } from "./replay-video";
import { useSecondGhost } from "./second-ghost";
import { Transport } from "./playback-controls";
import "./player.css";

const NOBODY = "robomesh/-/-"; // until the replay has its name
const NONE: readonly never[] = [];
const noSeek = () => undefined;
const FRAMES_HOLD_S = 1; // as for live frames

export function Player({ first, second }: { first: RecordingName; second: RecordingName | null }) {
  const opened = useOpened(first);
  const other = useOpened(second, true);
  const info = useInfo(first);
  const secondInfo = useInfo(second);
  const [shift, setShift] = useState(0);
  const { replay } = opened;
  useFollowing(replay, other.replay, shift);
  const moment = useMoment(replay);
  const happened = useHappened(first, info.value);
  const secondHappened = useHappened(second, secondInfo.value);
  const key = replay?.robotKey ?? NOBODY;
  const description = useTopic(DescriptionSchema, `${key}/description`)?.message;
  const firstS = useFirst(first, info.value);
  useEffect(() => replay?.beginAt(firstS), [replay, firstS]);
  const arm = useOfMoment(replay, "frames", FRAMES_HOLD_S);
  const otherArm = useOfMoment(other.replay, "joints", FRAMES_HOLD_S);
  const ghosted = useSecondGhost(key, description, other.replay?.robotKey ?? null, otherArm === "here");
  const beside = useMemo(
    () => second && { name: second, info: secondInfo.value, shift },
    [second, secondInfo.value, shift],
  );
  const state = replay?.state.value;
  const gone = replay?.gone ?? false;
  const trouble = opened.problem || (gone ? r("player_gone") : state?.text && r("closed", { text: state.text }));
  const events = happened.value?.list ?? NONE;
  const recorded = viewsIn(info.value);
  return (
    <div class={`player ${second ? "two" : ""}`} data-replay={key.split("/")[2]} data-playing={state?.playing ?? false}>
      <div class="player-head">
        <div class="headline">
          <a class="page-link" href={recordingsLink()}>
            {r("back")}
          </a>
          <h1>{info.value?.name || first.file}</h1>
          <ReplayTag robot={info.value?.robot || (state?.ofRobot ?? "")} start={info.value ? startMs(info.value) : 0} />
          <span class="replay-words dim small">{r("replay_words")}</span>
          {info.value?.problem && <Trouble text={info.value.problem} />}
          {info.problem && <Trouble text={r("info_refused", { text: info.problem })} />}
        </div>
        {trouble && (
          <p class="player-trouble" role="alert">
            <span class="shape warning" aria-hidden="true" />
            <span>{trouble}</span>
            <button class="action" onClick={opened.again}>
              {r("open_again")}
            </button>
          </p>
        )}
        {second && (
          <Beside
            first={first}
            name={secondInfo.value?.name || second.file}
            problem={other.problem || secondInfo.problem}
            shift={shift}
            setShift={setShift}
            events={events}
            secondEvents={secondHappened.value?.list ?? NONE}
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
      <div class="player-videos">
        <ReplayVideo replay={replay} arm={arm} description={description} recorded={recorded} title={r("video")} />
        {other.replay && <SecondVideo replay={other.replay} arm={otherArm} info={secondInfo.value} />}
      </div>
      <div class="player-side">
        <EventList asked={happened} moment={moment} seek={replay?.seek ?? noSeek} />
        <Contents
          name={first}
          info={info.value}
          robotKey={replay?.robotKey ?? null}
          views={[...recorded, ...viewsOf(description).map(({ name }) => name)]}
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
        <Transport replay={replay} moment={moment} events={events} />
      ) : (
        <section class="transport waiting" aria-label={r("transport")}>
          <p class="dim">{opened.problem ? "\u00a0" : r("opening")}</p>
        </section>
      )}
    </div>
  );
}

function SecondVideo({ replay, arm, info }: { replay: Replay; arm: OfMoment; info: Recording | null }) {
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
  return (
    <span class="trouble warning">
      <span class="shape warning" aria-hidden="true" />
      {text}
    </span>
  );
}
