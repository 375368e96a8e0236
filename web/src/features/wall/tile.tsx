// One picture of the wall: live while visible, with the robot's state and the picture's age.

import { useEffect, useRef, useState } from "preact/hooks";
import type { ControllerState, Description, ReplayState } from "../../gen/robomesh_pb";
import { t, viewText, wallText as w } from "../../i18n/texts";
import { isReplay } from "../../mesh/state/robot-name";
import { problemOf, replayWord, stateText, stateWord } from "../../mesh/state/robot-state";
import type { Latest } from "../../mesh/state/topics";
import { Age, State } from "../../ui/marks/state";
import { Tag } from "../../ui/marks/tag";
import type { ViewName } from "../../ui/page/route";
import { robotLink } from "../../ui/page/route";
import { useLiveVideo } from "../../video/live-video";
import { requestFor } from "./grid";

export function WallTile(props: {
  shown: ViewName;
  controller: Latest<ControllerState> | undefined;
  description: Description | undefined;
  replay: Latest<ReplayState> | undefined;
  known: boolean;
  remove: () => void;
}) {
  const { shown, controller, description } = props;
  const place = useRef<HTMLElement>(null);
  const pictured = useRef<HTMLDivElement>(null);
  const [visible, setVisible] = useState(false);
  const [{ width, height }, setSize] = useState({ width: 0, height: 0 });
  useEffect(() => {
    const tile = place.current;
    if (!tile || !pictured.current) return;
    let onScreen = false;
    const updateVisible = () => setVisible(onScreen && document.visibilityState === "visible");
    const entering = new IntersectionObserver(
      ([entry]) => ((onScreen = entry?.isIntersecting ?? false), updateVisible()),
    );
    const sizing = new ResizeObserver(([entry]) => {
      const box = entry?.contentRect;
      if (box) setSize({ width: Math.round(box.width), height: Math.round(box.height) });
    });
    entering.observe(tile);
    sizing.observe(pictured.current);
    document.addEventListener("visibilitychange", updateVisible);
    return () => {
      entering.disconnect();
      sizing.disconnect();
      document.removeEventListener("visibilitychange", updateVisible);
    };
  }, []);
  const robotKey = `robomesh/${shown.site}/${shown.robot}`;
  const view = viewText(shown.view);
  const label = `${shown.robot}, ${view}`;
  const watched = visible && width > 0 && height > 0 && props.known;
  const live = useLiveVideo(robotKey, watched ? requestFor(shown.view, width, height) : null, label);
  const replayed = isReplay(shown.robot);
  const state = replayed ? replayWord(props.replay, controller) : stateWord(controller);
  const ended = replayed && (!props.known || state.word === "state_replay_ended");
  const problem = problemOf(state, controller?.message);
  const word = ended
    ? w("replay_ended")
    : !props.known
      ? w("gone")
      : !visible && live.any
        ? w("hidden")
        : live.any
          ? ""
          : live.problem || w("waiting");
  return (
    <article
      ref={place}
      class={`wall-tile stack narrow short ${state.level} ${live.stale || ended || !watched ? "stale" : ""}`}
      tabIndex={0}
      aria-label={`${label}: ${stateText(state)}`}
      onDblClick={() => (location.hash = robotLink(shown.site, shown.robot))}
    >
      <div ref={pictured} class="wall-picture grow short anchor">
        {live.picture}
        {word && <p class="picture-word dim">{word}</p>}
        {live.stale && !ended && (
          <p class="wall-stale row nowrap gap-8">
            <span class="shape warning" aria-hidden="true" />
            <Age stale age={live.age} />
          </p>
        )}
        {problem && (
          <p class={`wall-problem small warned pad-4-8 ${state.level}`} title={problem}>
            {problem}
          </p>
        )}
        <button class="wall-remove" aria-label={w("remove", { robot: shown.robot, view })} onClick={props.remove}>
          ×
        </button>
      </div>
      <div class="wall-line row nowrap gap-8 pad-0-8">
        <a href={robotLink(shown.site, shown.robot)} title={`${shown.site}/${shown.robot}`}>
          {shown.robot}
        </a>
        <span class="dim">{view}</span>
        {live.step > 0 && (
          <span class="clip small warned" title={t("reduced_hint")}>
            {t("reduced")}
          </span>
        )}
        {replayed ? (
          <Tag kind="replay">{w("replay")}</Tag>
        ) : (
          description?.simulated && <Tag kind="simulated">{t("simulated")}</Tag>
        )}
        <State state={state} />
      </div>
    </article>
  );
}
