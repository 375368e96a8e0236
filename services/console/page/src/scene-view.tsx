// The live 3-D panel: views of the description, trail and frames, and a word when it is stale.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { create } from "@bufbuild/protobuf";
import { staleText, timeOfDay } from "./format";
import { ViewSchema, View_Projection } from "./gen/robomesh_pb";
import type { Description, View } from "./gen/robomesh_pb";
import { ghost } from "./ghost";
import { watch } from "./mesh";
import { Choice, Toggle } from "./parts";
import { RobotScene } from "./scene";
import { t, textOr } from "./texts";
import { theme } from "./theme";
import { useFramesAge } from "./frames-age";
import { isStale } from "./topics";

// Where the free camera stands, from the target, in lengths of the arm's reach.
const FREE_EYE = { x: 1.2, y: -1.69, z: 0.72 };
const NOMINAL_REACH = 1.1; // m, until the description is there

/** Views of a description, the free one first. */
export function viewsOf(description: Description | undefined): readonly View[] {
  const named = description?.views ?? [];
  const free = named.find((view) => view.name === "free") ?? freeView(named);
  return [free, ...named.filter((view) => view.name !== "free")];
}

/** A free view as far away as the others, which stand three reaches from their target. */
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

export function viewText(name: string): string {
  return textOr(`view_${name}`, name);
}

export function SceneView(props: {
  robotKey: string;
  description: Description | undefined;
  stale: boolean;
  age: number | null | undefined;
  lostAt: number | null;
}) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const scene = useRef<RobotScene | null>(null);
  const [problem, setProblem] = useState("");
  const [loaded, setLoaded] = useState(false);
  const [view, setView] = useState("free");
  const [trail, setTrail] = useState(false);
  const [frames, setFrames] = useState(false);
  const { robotKey, description } = props;
  const prefix = robotKey.split("/").slice(1).join("/");
  const framesAge = useFramesAge(robotKey);
  const stale = props.stale || isStale("frames", framesAge);
  const age = props.stale ? props.age : framesAge;

  // One scene for one description: a changed one begins anew.
  const identity = useMemo(
    () => description && JSON.stringify([description.links, description.baseToSite]),
    [description],
  );
  useEffect(() => {
    if (!canvas.current || !description) return;
    setProblem("");
    setLoaded(false);
    let made: RobotScene;
    try {
      made = new RobotScene(canvas.current, prefix);
    } catch {
      setProblem(t("no_webgl"));
      return;
    }
    scene.current = made;
    const missing = new Map<string, string>();
    const stop = watch(`${robotKey}/frames`, (sample) =>
      made.placeFrames(sample.payload, sample.sourceTime, sample.arrived),
    );
    void made
      .load(description, (link, text) => {
        if (text) missing.set(link, t("model_failed", { link, text }));
        else missing.delete(link);
        setProblem([...missing.values()][0] ?? "");
      })
      .then(() => setLoaded(true));
    return () => {
      stop();
      made.dispose();
      scene.current = null;
    };
  }, [identity]);
  useEffect(() => scene.current?.setStale(stale), [stale, identity, loaded]);
  useEffect(() => scene.current?.setColours(), [theme.value]);
  useEffect(() => scene.current?.showTrail(trail), [trail, identity]);
  useEffect(() => scene.current?.showFrames(frames), [frames, identity]);
  useEffect(() => scene.current?.showGhost(ghost.value), [ghost.value, loaded]);
  const views = viewsOf(description);
  const chosen = views.find((each) => each.name === view) ?? freeView([]);
  useEffect(() => scene.current?.look(chosen), [chosen.name, identity]);

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
  const waiting = !description ? t("waiting_description") : !loaded && !problem ? t("loading_model") : "";
  return (
    <section class={`panel scene ${stale && loaded ? "is-stale" : ""}`} aria-label={t("scene")}>
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
      </div>
      <div class="scene-tools">
        <Choice
          label={t("view")}
          values={views.map((each) => each.name)}
          chosen={chosen.name}
          text={viewText}
          choose={setView}
        />
        <div class="scene-toggles">
          <Toggle on={trail} set={setTrail}>
            {t("show_trail")}
          </Toggle>
          <Toggle on={frames} set={setFrames}>
            {t("show_frames")}
          </Toggle>
        </div>
      </div>
      {waiting && <p class="scene-word dim">{waiting}</p>}
      {problem && <p class="scene-word trouble">{problem}</p>}
      {stale && (loaded || problem) && (
        <p class="scene-stale" role="status">
          <span class="shape warning" aria-hidden="true" />
          {age === undefined ? t("no_data") : staleText(age)}
          {props.lostAt !== null && <span class="dim">{t("no_link_since", { time: timeOfDay(props.lostAt) })}</span>}
        </p>
      )}
    </section>
  );
}
