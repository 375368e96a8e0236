// The renderer's picture of the robot: a view of the description, or the camera of the 3-D view.

import { useEffect, useRef, useState } from "preact/hooks";
import type { Description, View } from "../../gen/robomesh_pb";
import { clock } from "../../i18n/format";
import { t, viewText } from "../../i18n/texts";
import { viewsOf } from "../../scene/scene-view";
import { isRemote, topicSelection } from "../../scene/topic-selection";
import { Button } from "../../ui/inputs/button";
import { Select } from "../../ui/inputs/select";
import { Age } from "../../ui/marks/state";
import type { VideoPlace } from "../../ui/page/layout";
import { PLACES } from "../../ui/page/layout";
import { saveFile } from "../../ui/page/save-file";
import { Panel } from "../../ui/panel/panel";
import { useLiveVideo } from "../../video/live-video";
import type { RequestedView } from "../../video/requested-view";
import { standardView } from "../../video/requested-view";
import { dated, saveStill, useRecording } from "./export";

/** The renderer's view of every robot, which follows the arm. */
const CLOSE_VIEW = "close";
const OWN_VIEW = "own";
/** No video, for example because it is not live and would block motion. */
const OFF = "off";
/** A small picture of few bits, for slow links. */
const SLOW_LINK_VIEW = "far";
const OWN_SIZE = { width: 960, height: 540, fps: 30 };
const CHECK_INTERVAL_MS = 300;

export function CameraPanel(props: {
  robotKey: string;
  description: Description | undefined;
  /** The chosen view; empty: the usual one. */
  view: string;
  setView: (view: string) => void;
  place: VideoPlace;
  setPlace: (place: VideoPlace) => void;
  /** Camera of the 3-D view; null: no 3-D view. */
  sceneView: () => View | null;
}) {
  const { robotKey, description } = props;
  const isSlow = topicSelection(robotKey) === "slow";
  const view = props.view || (isSlow ? SLOW_LINK_VIEW : "front");
  const names = [
    ...new Set([
      ...viewsOf(description).map((each) => each.name),
      CLOSE_VIEW,
      ...(isRemote(robotKey) ? [SLOW_LINK_VIEW] : []),
      OWN_VIEW,
      OFF,
    ]),
  ];
  const shown = names.includes(view) ? view : (names[0] ?? "free");
  const own = useOwnView(shown === OWN_VIEW, props.sceneView);
  const isOff = shown === OFF;
  const requested: RequestedView | null = isOff
    ? null
    : shown !== OWN_VIEW
      ? standardView(shown)
      : own && { of: OWN_VIEW, view: own, ...OWN_SIZE };
  const live = useLiveVideo(robotKey, requested, viewText(shown));
  const picture = useRef<HTMLDivElement>(null);
  const [, site = "", robot = ""] = robotKey.split("/");
  const name = `${robot}-${shown}`;
  const recording = useRecording(`/video/${site}/${robot}/${shown}.mp4`, `${name}.mp4`);
  const [problem, setProblem] = useState("");
  const savePicture = () =>
    saveStill(live.place.current).then(
      (blob) => (setProblem(""), saveFile(blob, dated(`${name}.png`))),
      (error: Error) => setProblem(t("record_failed", { text: error.message })),
    );
  const words = problem || recording.problem || live.problem || (live.video || isOff ? "" : t("camera_still"));
  return (
    <Panel
      name="camera"
      title={t("camera")}
      end={
        <>
          {live.step > 0 && (
            <span class="clip small warned" title={t("reduced_hint")}>
              {t("reduced")}
            </span>
          )}
          <Age stale={live.stale} age={live.age} />
          <Select label={t("view")} value={shown} values={names} text={viewText} choose={props.setView} />
          <Select
            class="video-place"
            label={t("video_place")}
            value={props.place}
            values={PLACES}
            text={(each) => t(`video_${each}`)}
            choose={props.setPlace}
          />
        </>
      }
    >
      <div ref={picture} class={`picture grow short anchor ${live.stale ? "stale" : ""}`}>
        {live.picture}
        {!live.any && (
          <p class="picture-word dim">{isOff ? t("video_is_off") : t("camera_waiting", { view: viewText(shown) })}</p>
        )}
        <div class="picture-tools flex gap-4">
          <Button quiet text={t("save_still")} disabled={!live.any} onClick={() => void savePicture()} />
          {shown !== OWN_VIEW && !isOff && (
            <Button
              quiet
              text={recording.on ? t("recording_video", { time: clock(recording.seconds) }) : t("record_video")}
              aria-pressed={recording.on}
              disabled={!live.any}
              onClick={recording.toggle}
            />
          )}
          <Button quiet text={t("full_screen")} onClick={() => void toggleFull(picture.current)} />
        </div>
      </div>
      {words && <p class="footnote dim">{words}</p>}
    </Panel>
  );
}

function toggleFull(element: HTMLElement | null): Promise<void> | undefined {
  return document.fullscreenElement ? document.exitFullscreen() : element?.requestFullscreen();
}

/** Return the 3-D view's camera once it is at rest: each new camera is a new stream of the renderer. */
function useOwnView(on: boolean, sceneView: () => View | null): View | null {
  const [view, setView] = useState<View | null>(null);
  const sceneCamera = useRef(sceneView);
  sceneCamera.current = sceneView;
  useEffect(() => {
    if (!on) return;
    let before = "";
    let settled = "";
    const timer = setInterval(() => {
      const next = sceneCamera.current();
      const identity = next
        ? [next.eye, next.target].flatMap((p) => [p?.x, p?.y, p?.z].map((v) => v?.toFixed(3))).join()
        : "";
      if (next && identity === before && identity !== settled) {
        settled = identity;
        setView(next);
      }
      before = identity;
    }, CHECK_INTERVAL_MS);
    return () => clearInterval(timer);
  }, [on]);
  return view;
}
