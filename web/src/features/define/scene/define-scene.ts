// The picture of a draft: links at their D-H frames, the rows themselves, and a gizmo to place a shape.

import * as THREE from "three";
import type { TransformControls } from "three/addons/controls/TransformControls.js";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { reasonOf } from "../../../mesh/console/connection";
import { DrawLoop } from "../../../scene/canvas/draw-loop";
import { Viewpoint } from "../../../scene/canvas/viewpoint";
import {
  countFrame,
  disposeScene,
  drawsInSoftware,
  fitToParent,
  makeRenderer,
  observeSize,
  toneMap,
} from "../../../scene/canvas/webgl";
import type { DhRow } from "../../../scene/parts/forward-kinematics";
import { makeGizmo } from "../../../scene/parts/gizmo";
import { readGlb } from "../../../scene/parts/models";
import { lights, palette, surround } from "../../../scene/parts/surroundings";
import { glb } from "../draft/server-requests";
import { Skeleton } from "./dh-skeleton";

const CREASE_ANGLE = 0.6; // rad: sharper edges stay sharp
const PAINT = "paint"; // the material that takes a link's colour
const BARE = "#8a8f94";
const CHOSEN_TINT = 0.55;
const CLICK_PX = 4;

export type Dragging = "off" | "translate" | "rotate";

/** A link's shape; `pose` places the file's geometry, scaled to metres, in the link's frame. */
export interface Shown {
  glb: string;
  scale: number;
  pose: THREE.Matrix4;
  color: string;
}

/** Contents of the picture, in metres. */
export interface Picture {
  placements: readonly THREE.Matrix4[];
  /** Frame of the first row. */
  start: THREE.Matrix4;
  rows: readonly DhRow[];
  shapes: readonly (Shown | null)[];
  /** In the last link's frame. */
  tool: THREE.Matrix4;
  /** Named frames, in the base frame. */
  frames: readonly { name: string; placement: THREE.Matrix4 }[];
  size: number;
  /** Index of the chosen link (0: the base); the tool; or none. */
  chosen: number | "tool" | null;
}

export interface SceneEvents {
  pick: (link: number) => void;
  /** The gizmo's object was dragged to this pose in its link's frame. */
  drag: (pose: THREE.Matrix4) => void;
  dragged: () => void;
  failed: (glb: string, text: string) => void;
}

interface Link {
  group: THREE.Group;
  holder: THREE.Group;
  glb: string;
  model: THREE.Group | null;
}

export class DefineScene {
  readonly view: Viewpoint;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly skeleton = new Skeleton();
  private readonly gizmo: TransformControls;
  private readonly tool = new THREE.Group();
  private readonly links: Link[] = [];
  private readonly models = new Map<string, Promise<THREE.Group>>();
  private readonly observer: ResizeObserver;
  private readonly ending = new AbortController();
  private picture: Picture | null = null;
  private dragging: Dragging = "off";
  private inDrag = false;
  private readonly loop: DrawLoop;
  private floorScale = 1;

  /** @throws Error if the browser has no WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly events: SceneEvents,
  ) {
    this.renderer = makeRenderer(drawsInSoftware(), canvas);
    toneMap(this.renderer);
    this.loop = new DrawLoop(this.renderer, this.draw);
    this.view = new Viewpoint(
      canvas,
      { clip: [0.01, 500], distance: [0.05, 100], damping: false, turnsFlat: true, polarMargin: 0.02 },
      () => this.touch(),
    );
    this.gizmo = makeGizmo(this.view.camera, canvas, this.ending.signal);
    this.listenToGizmo();
    this.scene.add(...lights(), this.skeleton.group, this.tool, this.gizmo.getHelper());
    this.setColours();
    this.listenToPointer();
    this.observer = observeSize(canvas, () => this.resize());
    canvas.addEventListener("webglcontextrestored", this.loop.wake);
    this.resize();
  }

  /** Set background, floor and lines to the page's theme. */
  setColours(): void {
    surround(this.scene, palette())?.scale.setScalar(this.floorScale);
    if (this.picture) this.paintAll();
    this.touch();
  }

  show(picture: Picture): void {
    const before = this.picture;
    this.picture = picture;
    // A larger floor, in whole metres, for an arm beyond the floor of 1.6 m.
    const scale = Math.max(1, Math.ceil(picture.size / 1.6));
    if (scale !== this.floorScale) {
      this.floorScale = scale;
      this.scene.getObjectByName("floor")?.scale.setScalar(scale);
    }
    while (this.links.length > picture.placements.length)
      this.scene.remove(this.links.pop()?.group ?? new THREE.Group());
    picture.placements.forEach((placement, index) => {
      const link = this.links[index] ?? this.addLink();
      link.group.matrix.copy(placement);
      const shape = picture.shapes[index] ?? null;
      const isDragged = this.inDrag && index === before?.chosen;
      if (shape && !isDragged) {
        shape.pose.decompose(link.holder.position, link.holder.quaternion, link.holder.scale);
      }
      void this.give(link, shape);
    });
    const last = picture.placements.at(-1) ?? new THREE.Matrix4();
    const tool = last.clone().multiply(picture.tool);
    if (!(this.inDrag && picture.chosen === "tool"))
      tool.decompose(this.tool.position, this.tool.quaternion, this.tool.scale);
    const row = typeof picture.chosen === "number" && picture.chosen > 0 ? picture.chosen - 1 : null;
    this.skeleton.update(picture, tool, row);
    this.paintAll();
    this.attach();
    this.canvas.dataset.tool = JSON.stringify(tool.clone().transpose().elements);
    this.touch();
  }

  /** Load a failed model again when it is next shown. */
  forget(glb: string): void {
    this.models.delete(glb);
  }

  showRows(shown: boolean): void {
    this.skeleton.group.visible = shown;
    this.touch();
  }

  showShapes(shown: boolean): void {
    for (const { holder } of this.links) holder.visible = shown;
    this.touch();
  }

  drag(how: Dragging): void {
    this.dragging = how;
    if (how !== "off") this.gizmo.setMode(how);
    this.attach();
  }

  private addLink(): Link {
    const link: Link = { group: new THREE.Group(), holder: new THREE.Group(), glb: "", model: null };
    link.group.matrixAutoUpdate = false;
    link.group.add(link.holder);
    this.scene.add(link.group);
    this.links.push(link);
    return link;
  }

  /** Load a link's model, unless another one is wanted by then. */
  private async give(link: Link, shape: Shown | null): Promise<void> {
    const wanted = shape?.glb ?? "";
    if (link.glb !== wanted) {
      link.glb = wanted;
      if (link.model) link.holder.remove(link.model);
      link.model = null;
      if (wanted) {
        try {
          const model = (await this.model(wanted)).clone();
          if (link.glb !== wanted) return;
          model.traverse((part) => {
            if (part instanceof THREE.Mesh) part.material = (part.material as THREE.Material).clone();
          });
          link.model = model;
          link.holder.add(model);
          this.events.failed(wanted, "");
        } catch (error) {
          if (link.glb === wanted) link.glb = ""; // retried when shown again
          this.events.failed(wanted, reasonOf(error));
        }
        const now = this.picture?.shapes[this.links.indexOf(link)];
        if (now && link.model) link.model.scale.setScalar(now.scale);
        this.paintAll();
        this.attach();
        this.touch();
      }
    }
    if (link.model && shape) link.model.scale.setScalar(shape.scale);
    this.canvas.dataset.shapes = String(this.links.filter(({ model }) => model).length);
  }

  private model(sha: string): Promise<THREE.Group> {
    let model = this.models.get(sha);
    if (!model) {
      model = glb(sha).then(async (bytes) => {
        const scene = await readGlb(bytes);
        scene.traverse((part) => {
          if (!(part instanceof THREE.Mesh)) return;
          if (!part.geometry.getAttribute("normal")) part.geometry = toCreasedNormals(part.geometry, CREASE_ANGLE);
          const own = part.material as THREE.MeshStandardMaterial;
          part.material = new THREE.MeshStandardMaterial({
            name: own.name,
            color: own.color ?? new THREE.Color(BARE),
            vertexColors: part.geometry.hasAttribute("color"),
            transparent: own.transparent,
            opacity: own.opacity,
            roughness: 0.55,
            metalness: 0.1,
            side: THREE.DoubleSide,
          });
          part.userData.colour = (own.color ?? new THREE.Color(BARE)).getHex(); // a clone keeps plain values
        });
        return scene;
      });
      this.models.set(sha, model);
    }
    return model;
  }

  private paintAll(): void {
    const accent = new THREE.Color(palette().accent);
    this.links.forEach((link, index) => {
      const color = this.picture?.shapes[index]?.color ?? "";
      const isChosen = this.picture?.chosen === index;
      const parts: THREE.Mesh<THREE.BufferGeometry, THREE.MeshStandardMaterial>[] = [];
      link.model?.traverse((part) => part instanceof THREE.Mesh && parts.push(part));
      const painted = parts.some((part) => part.material.name === PAINT);
      for (const part of parts) {
        part.material.color.setHex(part.userData.colour as number);
        const takes = /^#[0-9a-f]{6}$/i.test(color) && (!painted || part.material.name === PAINT);
        if (takes) part.material.color.set(color);
        if (isChosen) part.material.color.lerp(accent, CHOSEN_TINT);
      }
    });
  }

  private attach(): void {
    const chosen = this.picture?.chosen ?? null;
    const link = typeof chosen === "number" ? this.links[chosen] : undefined;
    const object = chosen === "tool" ? this.tool : link?.model ? link.holder : null;
    this.gizmo.camera = this.view.camera;
    if (this.dragging === "off" || !object) this.gizmo.detach();
    else if (this.gizmo.object !== object) this.gizmo.attach(object);
    this.canvas.dataset.gizmo = this.gizmo.object ? this.dragging : "";
    this.touch();
  }

  private listenToGizmo(): void {
    this.gizmo.addEventListener("change", () => this.touch());
    this.gizmo.addEventListener("dragging-changed", (event) => {
      this.inDrag = event.value === true;
      this.view.controls.enabled = !this.inDrag;
      if (!this.inDrag) this.events.dragged();
    });
    this.gizmo.addEventListener("objectChange", () => {
      const object = this.gizmo.object;
      if (!object) return;
      object.updateMatrix();
      const pose = object.matrix.clone();
      const last = this.picture?.placements.at(-1);
      if (object === this.tool && last) pose.premultiply(last.clone().invert());
      this.events.drag(pose);
    });
  }

  private listenToPointer(): void {
    const { signal } = this.ending;
    let from = { x: 0, y: 0 };
    this.canvas.addEventListener("pointerdown", ({ clientX: x, clientY: y }) => (from = { x, y }), { signal });
    this.canvas.addEventListener(
      "pointerup",
      ({ clientX: x, clientY: y }) => {
        if (this.inDrag || this.gizmo.axis || Math.hypot(x - from.x, y - from.y) > CLICK_PX) return;
        const box = this.canvas.getBoundingClientRect();
        const at = new THREE.Vector2(((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2);
        const ray = new THREE.Raycaster();
        ray.setFromCamera(at, this.view.camera);
        const hits = this.links.flatMap(({ holder }, index) =>
          ray.intersectObject(holder, true).map(({ distance }) => ({ index, distance })),
        );
        const nearest = hits.sort((one, other) => one.distance - other.distance)[0];
        if (nearest) this.events.pick(nearest.index);
      },
      { signal },
    );
  }

  private touch(): void {
    this.loop.wake();
  }

  private resize(): void {
    this.view.resize(fitToParent(this.renderer));
    this.touch();
  }

  private readonly draw = (): boolean => {
    this.gizmo.camera = this.view.camera;
    this.skeleton.scaleLetters(this.view.letterScale);
    this.renderer.render(this.scene, this.view.camera);
    countFrame(this.canvas);
    return true;
  };

  dispose(): void {
    this.ending.abort();
    this.loop.dispose();
    this.observer.disconnect();
    this.gizmo.detach();
    this.gizmo.dispose();
    this.view.dispose();
    this.skeleton.dispose();
    disposeScene(this.scene, this.renderer);
  }
}
