// The 3-D panel: the arm at the sliders' positions, its D-H rows, and the gizmo.

import { signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { Matrix4 } from "three";
import { defineText as d, t, viewText } from "../../../i18n/texts";
import type { CameraPose } from "../../../scene/canvas/viewpoint";
import { linkPlacements } from "../../../scene/parts/forward-kinematics";
import { Choice, Toggle } from "../../../ui/inputs/choice";
import { theme } from "../../../ui/page/theme";
import type { Pose } from "../description/description";
import { bodies, linkNames } from "../description/description";
import type { Draft } from "../draft/draft";
import { draft, editDraft, endUndoStep } from "../draft/draft";
import { readShape, shapeOf } from "../draft/mesh-files";
import { choosePart, chosenBody, chosenPart, positions } from "../draft/selection";
import type { Dragging, Picture, Shown } from "./define-scene";
import { DefineScene } from "./define-scene";
import { poseMatrix, poseOf, rowAt } from "./placements";
import { cameraOf, sizeOf, USUAL_VIEWS } from "./views";

/** The scene's camera, for the views tab; null: there is no scene. */
export const currentCamera = signal<(() => CameraPose) | null>(null);
/** The requested view; a new object requests it again. */
export const requestedView = signal<{ name: string }>({ name: "free" });

function pictureOf(now: Draft): Picture {
  const { description } = now;
  const rows = description.joint.map((joint, index) =>
    rowAt(joint, positions.value[index] ?? joint.home, description.units),
  );
  let widest = 0;
  const shapes = bodies(description).map((body): Shown | null => {
    const shape = body.mesh ? shapeOf(body.mesh, now.files) : undefined;
    if (typeof shape !== "object" || !("info" in shape) || !(body.mesh_scale > 0)) return null;
    const { glb, min, max } = shape.info;
    widest = Math.max(widest, ...max.map((value, axis) => (value - (min[axis] ?? 0)) * body.mesh_scale));
    return { glb, scale: body.mesh_scale, pose: poseMatrix(body.mesh_pose, description.units), color: body.color };
  });
  const part = chosenPart.value;
  const start = poseMatrix(description.base.pose, description.units);
  const placements = linkPlacements(start, rows);
  const links = linkNames(description);
  return {
    placements,
    start,
    rows,
    frames: description.frame.map((frame) => ({
      name: frame.name,
      placement: (placements[links.indexOf(frame.link)] ?? new Matrix4())
        .clone()
        .multiply(poseMatrix(frame, description.units)),
    })),
    shapes,
    tool: poseMatrix(description.tool, description.units),
    size: sizeOf(description, widest),
    chosen: part === "base" ? 0 : part === "tool" ? "tool" : part + 1,
  };
}

export function ScenePanel() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const scene = useRef<DefineScene | null>(null);
  const [problem, setProblem] = useState("");
  const [rows, setRows] = useState(true);
  const [shapesShown, setShapes] = useState(true);
  const [dragging, setDragging] = useState<Dragging>("off");
  const now = draft.value;
  const picture = now && pictureOf(now);

  useEffect(() => {
    if (!canvas.current) return;
    let made: DefineScene;
    const retried = new Set<string>();
    try {
      made = new DefineScene(canvas.current, {
        pick: (link) => choosePart(link === 0 ? "base" : link - 1),
        drag: (pose) => placeChosen(poseOf(pose, draft.value?.description.units ?? { length: "mm", angle: "deg" })),
        dragged: endUndoStep,
        failed: (glb, text) => {
          setProblem(text);
          if (!text || retried.has(glb)) return;
          retried.add(glb);
          made.forget(glb);
          void convertAgain(glb);
        },
      });
    } catch {
      setProblem(d("no_webgl"));
      return;
    }
    scene.current = made;
    currentCamera.value = () => made.view.now();
    return () => {
      currentCamera.value = null;
      made.dispose();
      scene.current = null;
    };
  }, []);
  useEffect(() => {
    if (picture) scene.current?.show(picture);
  });
  useEffect(() => scene.current?.setColours(), [theme.value]);
  useEffect(() => scene.current?.showRows(rows), [rows]);
  useEffect(() => scene.current?.showShapes(shapesShown), [shapesShown]);
  useEffect(() => scene.current?.drag(dragging), [dragging]);
  useEffect(() => {
    if (now && picture) scene.current?.view.look(cameraOf(requestedView.value.name, now.description, picture.size));
  }, [requestedView.value]);
  // Until the user moves the camera, it keeps the whole arm in the picture.
  useEffect(() => {
    const view = scene.current?.view;
    if (view && !view.touched && now && picture)
      view.look(cameraOf(requestedView.value.name, now.description, picture.size));
  }, [picture?.size]);

  const onKey = (event: KeyboardEvent) => {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!turn) return;
    event.preventDefault();
    scene.current?.view.turn(turn[0] ?? 0, turn[1] ?? 0);
  };
  const views = [...new Set(["free", ...USUAL_VIEWS, ...Object.keys(now?.description.view ?? {})])];
  return (
    <section class="panel scene define-scene" aria-label={d("scene")}>
      <div class="canvas-place">
        <canvas
          ref={canvas}
          tabIndex={0}
          role="img"
          aria-label={`${d("scene")}. ${d("scene_hint")}`}
          title=""
          onKeyDown={onKey}
        />
      </div>
      <div class="scene-tools flex wrap spread anchor gap-8 pad-8">
        <Choice
          label={t("view")}
          values={views}
          chosen={requestedView.value.name}
          text={viewText}
          choose={(name) => (requestedView.value = { name })}
        />
        <div class="scene-toggles">
          <Toggle text={d("show_rows")} on={rows} set={setRows} />
          <Toggle text={d("show_shapes")} on={shapesShown} set={setShapes} />
        </div>
      </div>
      <div class="scene-foot row spread gap-8">
        <span title={d("gizmo_hint")}>
          <Choice
            label={d("gizmo")}
            values={["off", "translate", "rotate"] as const}
            chosen={dragging}
            text={(how) => d(`gizmo_${how}`)}
            choose={setDragging}
          />
        </span>
        {dragging !== "off" && picture && !canPlace(picture) && (
          <span class="scene-hint flex small gap-12 pad-4-8">{d("gizmo_hint")}</span>
        )}
        {rows && (
          <span class="scene-legend flex small gap-12 pad-4-8">
            <span class="key-z">{d("legend_z")}</span>
            <span class="key-d">{d("legend_d")}</span>
            <span class="key-a">{d("legend_a")}</span>
          </span>
        )}
      </div>
      {problem && <p class="scene-word trouble">{problem}</p>}
    </section>
  );
}

function canPlace({ chosen: part, shapes }: Picture): boolean {
  return part === "tool" || (part !== null && Boolean(shapes[part]));
}

/** Apply a drag of the gizmo: one undo step until it ends. */
function placeChosen(pose: Pose): void {
  editDraft((now) => {
    if (chosenPart.value === "tool") now.description.tool = pose;
    else {
      const body = chosenBody(now.description);
      if (body) body.mesh_pose = pose;
    }
  }, "gizmo");
}

/** Convert a shape again that the server has dropped, so that it is shown again. */
async function convertAgain(glb: string): Promise<void> {
  const now = draft.value;
  if (!now) return;
  for (const { mesh } of bodies(now.description)) {
    const shape = mesh ? shapeOf(mesh, now.files) : undefined;
    if (typeof shape === "object" && "info" in shape && shape.info.glb === glb) await readShape(mesh, now.files);
  }
}
