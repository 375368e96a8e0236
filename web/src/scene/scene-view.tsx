// The live 3-D panel: views of the description, trail, frames, and a message when stale.

import { create } from "@bufbuild/protobuf";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Description, View } from "../gen/robomesh_pb";
import { KinematicStateSchema, ReplayStateSchema, View_Projection, ViewSchema } from "../gen/robomesh_pb";
import { staleText, whenText } from "../i18n/format";
import { recordingsText as r, t, viewText } from "../i18n/texts";
import { reasonOf } from "../mesh/console/connection";
import { OWN_DRAWING, useShownView } from "../mesh/control/display-freshness";
import type { MomentState } from "../mesh/services/replay-moment";
import { distanceText, useClearanceLevel } from "../mesh/state/clearance";
import { ageOf, isStale } from "../mesh/state/staleness";
import { useTopic } from "../mesh/state/topics";
import { Choice, Toggle } from "../ui/inputs/choice";
import type { Camera } from "../ui/page/layout";
import { theme } from "../ui/page/theme";
import { useFramesAge } from "./frames-age";
import { Neighbours } from "./neighbours";
import { ghost, redLinks, toolPath } from "./overlays";
import type { Nearest } from "./parts/lines";
import type { Stage } from "./parts/stage";
import { Poster } from "./poster";
import type { RobotScene, SceneState } from "./robot-scene";
import { framesTopic } from "./topic-selection";

// Eye of the free camera relative to its target, in multiples of the arm's reach.
const FREE_EYE = { x: 1.2, y: -1.69, z: 0.72 };
const NOMINAL_REACH = 1.1; // m, until the description arrives

let drawing: typeof import("./robot-scene") | null = null;

/** Return what draws in 3-D, loaded once it is `wanted`, because it is larger than the rest of the page. */
function useDrawing(wanted: boolean, failed: (why: string) => void): typeof drawing {
  const [loaded, setLoaded] = useState(drawing);
  useEffect(() => {
    if (!wanted || loaded) return;
    import("./robot-scene").then(
      (all) => setLoaded((drawing = all)),
      (error: unknown) => failed(reasonOf(error)),
    );
  }, [wanted, loaded]);
  return loaded;
}

/** Return the views of a description, the free one first. */
export function viewsOf(description: Description | undefined): readonly View[] {
  const named = description?.views ?? [];
  const free = named.find((view) => view.name === "free") ?? freeView(named);
  return [free, ...named.filter((view) => view.name !== "free")];
}

/** Return a free view at the distance of the others, which is three times the reach. */
function freeView(others: readonly View[]): View {
  const front = others.find((view) => view.name === "front");
  const { eye, target } = front ?? {};
  const away = eye && target ? Math.hypot(eye.x - target.x, eye.y - target.y, eye.z - target.z) : 0;
  const reach = away / 3 || NOMINAL_REACH;
  const at = target ?? { x: 0, y: 0, z: 0.45 * reach };
  return create(ViewSchema, {
    name: "free",
    eye: { x: at.x + FREE_EYE.x * reach, y: at.y + FREE_EYE.y * reach, z: at.z + FREE_EYE.z * reach },
    target: { x: at.x, y: at.y, z: at.z },
    up: { x: 0, y: 0, z: 1 },
    projection: View_Projection.PERSPECTIVE,
  });
}

export function SceneView(props: {
  robotKey: string;
  description: Description | undefined;
  stale: boolean;
  age: number | null | undefined;
  lostAt: number | null;
  /** Replay only: whether its joints belong to the replay's current moment. */
  arm?: MomentState;
  /** Called with each new scene, and with null at its end, so that other components can add parts. */
  staged?: (stage: Stage | null) => void;
  /** The view, and where a person put its camera; absent: the component keeps it. */
  camera?: Camera;
  setCamera?: (camera: Camera) => void;
}) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const label = useRef<HTMLSpanElement>(null);
  const scene = useRef<RobotScene | null>(null);
  const [problem, setProblem] = useState("");
  const [loaded, setLoaded] = useState(false);
  const [ownView, setOwnView] = useState("free");
  const view = props.camera?.view ?? ownView;
  const setView = (name: string) => (props.setCamera ? props.setCamera({ view: name, pose: null }) : setOwnView(name));
  const [trail, setTrail] = useState(false);
  const [frames, setFrames] = useState(false);
  const { robotKey, description } = props;
  const topic = framesTopic(robotKey);
  const framesAge = useFramesAge(robotKey, topic);
  const drawn = useShownView(robotKey, OWN_DRAWING, topic, () => canvas.current);
  const replayed = description?.replay !== undefined;
  // A paused replay sends no frames, and they are not stale; its page shows whether it is available.
  const absent = props.arm === "absent" || props.arm === "coming";
  // Not drawn yet is not stale.
  const coming = framesAge === undefined;
  const staleJoints = props.stale && (props.age !== undefined || props.arm !== undefined);
  const stale = staleJoints || absent || (!replayed && !coming && isStale(topic, framesAge, description));
  const age = staleJoints ? props.age : framesAge;
  const rate = useTopic(ReplayStateSchema, `${robotKey}/replay`)?.message.speed || 1;

  // A changed description gets a new scene.
  const identity = useMemo(
    () =>
      description &&
      JSON.stringify([description.links, description.fixtures, description.floor, description.baseToSite]),
    [description],
  );
  // The joints are shown first.
  const code = useDrawing(description !== undefined, setProblem);
  useEffect(() => {
    if (!canvas.current || !label.current || !description || !code) return;
    setProblem("");
    setLoaded(false);
    let made: RobotScene;
    try {
      made = new code.RobotScene(canvas.current, robotKey, label.current);
    } catch {
      setProblem(t("no_webgl"));
      return;
    }
    scene.current = made;
    props.staged?.(made.stage());
    const missing = new Map<string, string>();
    void made
      .load(description, (link, text) => {
        if (text) missing.set(link, t("model_failed", { link, text }));
        else missing.delete(link);
        setProblem([...missing.values()][0] ?? "");
      })
      .then(() => setLoaded(true));
    return () => {
      props.staged?.(null);
      made.dispose();
      scene.current = null;
    };
  }, [identity, code]);
  const views = viewsOf(description);
  const chosen = views.find((each) => each.name === view) ?? freeView([]);
  const near = useNearest(robotKey, description);
  const state: SceneState | undefined = description && {
    description,
    topic,
    stale,
    rate,
    theme: theme.value,
    trail,
    frames,
    ghost: ghost.value?.robotKey === robotKey ? ghost.value.positions : null,
    red: redLinks.value,
    path: toolPath.value,
    nearest: near,
    view: chosen,
    pose: props.camera?.pose ?? null,
    moved: props.setCamera,
    drew: (picture) => (drawn.picture = picture),
  };
  useEffect(() => void (state && scene.current?.update(state)));

  const onKey = (event: KeyboardEvent) => {
    const step = 0.1;
    const turns: Record<string, [number, number]> = {
      ArrowLeft: [-step, 0],
      ArrowRight: [step, 0],
      ArrowUp: [0, -step],
      ArrowDown: [0, step],
    };
    const turn = turns[event.key];
    if (!turn) return;
    event.preventDefault();
    scene.current?.turn(...turn);
  };
  const waiting = problem
    ? ""
    : !description
      ? t("waiting_description")
      : !loaded
        ? t("loading_model")
        : coming && !replayed && !stale
          ? t("waiting_frames")
          : "";
  return (
    <section class={`panel scene ${stale && loaded ? "is-stale" : ""}`} aria-label={t("scene")} data-moment={props.arm}>
      <div class="canvas-place">
        <canvas
          key={identity ?? "none"}
          ref={canvas}
          tabIndex={0}
          role="img"
          aria-label={`${t("scene")}. ${t("scene_hint")}`}
          onKeyDown={onKey}
          data-loaded={loaded}
        />
        <span class="scene-label nowrap small pad-0-8" ref={label} hidden />
      </div>
      {waiting && <Poster robotKey={robotKey} view={chosen.name} why={waiting} />}
      <div class="scene-tools flex wrap spread anchor gap-8 pad-8">
        <Choice
          label={t("view")}
          values={views.map((each) => each.name)}
          chosen={chosen.name}
          text={viewText}
          choose={setView}
        />
        <div class="scene-toggles">
          <Toggle text={t("show_trail")} on={trail} set={setTrail} />
          <Toggle text={t("show_frames")} on={frames} set={setFrames} />
        </div>
      </div>
      {replayed && <span class="replay-mark">{t("replay")}</span>}
      {scene.current && loaded && description?.cell && !replayed && topic === "frames" && (
        <Neighbours robotKey={robotKey} cell={description.cell} scene={scene.current} />
      )}
      {problem && <p class="scene-word trouble">{problem}</p>}
      {!staleJoints && props.arm === "absent" && (loaded || problem) && (
        <p class="scene-stale row nowrap large warned gap-4 pad-8-16" role="status">
          {r("no_joints_then")}
        </p>
      )}
      {stale && (staleJoints || !absent) && (loaded || problem) && (
        <p class="scene-stale row nowrap large warned gap-4 pad-8-16" role="status">
          <span class="shape warning" aria-hidden="true" />
          {/* Announce it once, not each second. */}
          <span aria-live="off">{age === undefined ? t("no_data") : staleText(age)}</span>
          {props.lostAt !== null && <span class="dim">{t("no_link_since", { time: whenText(props.lostAt) })}</span>}
        </p>
      )}
    </section>
  );
}

/** Return the two nearest points of the arm and its surroundings; null: not known. */
function useNearest(
  robotKey: string,
  description: Description | undefined,
): { nearest: Nearest; sourceTime: number } | null {
  const latest = useTopic(KinematicStateSchema, `${robotKey}/kinematics`);
  const clearance = latest?.message.clearance;
  const level = useClearanceLevel(robotKey, clearance);
  const known = clearance && !isStale("kinematics", ageOf(latest), description);
  return useMemo(() => {
    if (!known) return null;
    const { firstPoint, secondPoint } = clearance;
    const nearest = { points: [firstPoint, secondPoint] as const, level, text: distanceText(clearance) };
    return { nearest, sourceTime: latest.sample.sourceTime };
  }, [known, clearance, level]);
}
