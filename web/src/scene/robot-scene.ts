// The live 3-D picture of one robot, drawn only after a change.

import { create } from "@bufbuild/protobuf";
import * as THREE from "three";
import type { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Description, View } from "../gen/robomesh_pb";
import { View_Projection, ViewSchema } from "../gen/robomesh_pb";
import { floorOf } from "../mesh/clearance";
import type { Failed } from "./arm";
import { Arm, loadOrReport, meshUrl } from "./arm";
import { DrawBudget, qualities } from "./draw-budget";
import { DrawLoop } from "./draw-loop";
import type { Nearest } from "./lines";
import { Gap, Path, Trail } from "./lines";
import { colourEdges, paint, withEdges } from "./models";
import { KEY_LIGHT, lights, palette, surround } from "./surroundings";
import { Viewpoint } from "./viewpoint";
import { countFrame, disposeScene, drawsInSoftware, makeRenderer, observeSize, parentSize, toneMap } from "./webgl";

/** Interface for parts that other components add: see Program's gizmo. */
export interface Stage {
  scene: THREE.Scene;
  canvas: HTMLCanvasElement;
  /** The robot's base in the site's frame. */
  base: () => THREE.Matrix4;
  /** Current camera and controls: each view replaces them. */
  camera: () => THREE.Camera;
  controls: () => OrbitControls;
  /** The current camera as a view for the renderer. */
  view: () => View;
  changed: () => void;
}

// After the last motion; then a coarse picture is drawn once more, in full.
const REST_MS = 700;

/** A scene on a canvas. `placeFrames` supplies placements; `dispose` frees the GPU. */
export class RobotScene {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly viewpoint: Viewpoint;
  private readonly arm: Arm;
  private readonly neighbours = new Set<Arm>();
  private readonly fixtures = new Map<string, THREE.Group>();
  private readonly axes = new Map<string, THREE.AxesHelper>();
  private readonly trail = new Trail();
  private readonly path = new Path();
  private readonly gap: Gap;
  private base = new THREE.Matrix4();
  private floorAt: number | null = null; // in the site's frame [m]
  private colours = palette();
  private red: ReadonlySet<string> = new Set();
  private dirty = true;
  private framesShown = false;
  private readonly loop: DrawLoop;
  private readonly budget: DrawBudget;
  private fitted = false;
  private sharp = false; // drawn at the best resolution, because nothing moves
  private sharpening = false;
  private restTimer: ReturnType<typeof setTimeout> | undefined;
  private disposed = false;
  private readonly observer: ResizeObserver;

  /** Called when a picture is ready. */
  onDrawn: () => void = () => undefined;

  /** @throws Error if the browser has no WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly prefix: string,
    label: HTMLElement,
  ) {
    const software = drawsInSoftware();
    this.renderer = makeRenderer(software, canvas);
    this.loop = new DrawLoop(this.renderer, this.draw, this.drawn);
    this.budget = new DrawBudget(qualities(software));
    this.renderer.shadowMap.enabled = !software;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    toneMap(this.renderer);
    this.arm = new Arm(this.scene, prefix, "arm", this.changed);
    this.gap = new Gap(label);
    this.scene.add(...lights(), this.trail.line, this.path.line, this.gap.group);
    this.setColours();
    this.viewpoint = new Viewpoint(
      canvas,
      { clip: [0.02, 60], distance: [0.2, 12], damping: true, turnsFlat: false, polarMargin: 0.05 },
      this.changed,
    );
    this.observer = observeSize(canvas, this.resize);
    canvas.addEventListener("webglcontextrestored", this.resize);
    this.resize();
  }

  /** Set background, floor and lines to the page's theme. */
  setColours(): void {
    const colours = (this.colours = palette());
    // Level in the site's frame, whatever the robot's base is tilted by.
    const floor = surround(this.scene, colours, this.floorAt !== null);
    floor?.position.setFromMatrixPosition(this.base).setZ(this.floorAt ?? 0);
    this.canvas.dataset.floor = String(this.floorAt);
    this.trail.line.material.color.set(colours.accent);
    this.path.line.material.color.set(colours.accent);
    this.setRed(this.red);
  }

  private readonly changed = (): void => {
    this.dirty = true;
    this.loop.wake();
  };

  stage(): Stage {
    const { scene, canvas, changed } = this;
    return {
      scene,
      canvas,
      base: () => this.base,
      camera: () => this.viewpoint.camera,
      controls: () => this.viewpoint.controls,
      view: () => this.view(),
      changed,
    };
  }

  /** Load the models of the arm and the fixtures. */
  async load(description: Description, failed: Failed): Promise<void> {
    if (description.baseToSite.length === 16) this.base.fromArray(description.baseToSite).transpose();
    this.floorAt = floorOf(description);
    this.path.line.matrix.copy(this.base);
    this.setColours();
    for (const frame of description.frames) {
      const axes = new THREE.AxesHelper(frame.name === "tool" ? 0.14 : 0.09);
      axes.visible = false;
      this.axes.set(`${this.prefix}/${frame.name}`, axes);
      this.scene.add(axes);
    }
    // Compile the ghosts' shaders now: during the first drag they would block the page, and its lease would expire.
    const compiled = (ghost: THREE.Group) => this.renderer.compile(ghost, this.viewpoint.camera, this.scene);
    await Promise.all([this.arm.load(description, failed, compiled), this.loadFixtures(description, failed)]);
  }

  private async loadFixtures({ fixtures }: Description, failed: Failed): Promise<void> {
    await Promise.all(
      fixtures.map(async ({ name, mesh, meshSha256, fixtureToSite, color }) => {
        const url = meshUrl(this.prefix, mesh, meshSha256);
        const model = await loadOrReport(
          url,
          () => !this.disposed,
          (why) => failed(name, why),
        );
        if (!model) return;
        const group = withEdges(model, color);
        if (fixtureToSite.length === 16) group.matrix.fromArray(fixtureToSite).transpose();
        this.fixtures.set(name, group);
        this.scene.add(group);
        this.canvas.dataset.fixtures = String(this.fixtures.size);
        this.setRed(this.red);
      }),
    );
  }

  /** Add a FrameTransforms payload. */
  placeFrames(payload: Uint8Array, sourceTimeMs: number, arrivedMs: number): void {
    this.arm.placeFrames(payload, sourceTimeMs, arrivedMs);
    if (this.gap.waits) this.loop.wake();
  }

  /** Source time [ms] of the frames that are drawn; infinite if they equal the newest. */
  get drawnTime(): number {
    const { moving, shown } = this.arm.player;
    return moving ? shown : Number.POSITIVE_INFINITY;
  }

  /** Set a replay's rate; see `FramePlayer`. */
  setRate(rate: number): void {
    this.arm.player.setRate(rate);
  }

  /** Draw the robot grey and translucent when its data is stale. */
  setStale(stale: boolean): void {
    this.arm.setStale(stale);
    this.loop.hurry();
  }

  /** Add another robot of the cell, dimmed; it receives its own placements. */
  addNeighbour(prefix: string, description: Description): Arm {
    const neighbour = new Arm(this.scene, prefix, "neighbour", this.changed);
    this.neighbours.add(neighbour);
    this.canvas.dataset.neighbours = String(this.neighbours.size);
    neighbour.setRed(this.red);
    // A neighbour's missing model is shown on its own page.
    void neighbour.load(description, () => undefined);
    return neighbour;
  }

  removeNeighbour(neighbour: Arm): void {
    this.neighbours.delete(neighbour);
    neighbour.remove();
  }

  /** Draw links (`<robot>/<link>`) and fixtures red. */
  setRed(names: ReadonlySet<string>): void {
    this.red = names;
    for (const arm of [this.arm, ...this.neighbours]) arm.setRed(names);
    const { alarm, dim } = this.colours;
    for (const [name, group] of this.fixtures) {
      paint(group, { stale: false, red: names.has(name), kind: "fixture" }, alarm);
      colourEdges(group, names.has(name) ? alarm : dim);
    }
    this.canvas.dataset.red = [...names].sort().join(" ");
    this.changed();
  }

  /** Show the ghost at placements in the base frame; null hides it. */
  showGhost(placements: ReadonlyMap<string, THREE.Matrix4> | null): void {
    this.canvas.dataset.ghost = String(this.arm.showGhost(placements));
  }

  /** Show a path of the tool in the base frame [m]; null: none. */
  showPath(points: readonly (readonly [number, number, number])[] | null): void {
    this.path.show(points);
    this.canvas.dataset.path = String(points?.length ?? 0);
    this.changed();
  }

  /** Show the two nearest points together with the arm at their source time [ms]; null: none. */
  showGap(nearest: Nearest | null, sourceTimeMs = 0): void {
    if (nearest) this.gap.add(nearest, sourceTimeMs);
    else if (this.gap.hide()) this.changed();
    if (this.gap.waits) this.loop.wake();
  }

  showTrail(shown: boolean): void {
    this.trail.show(shown);
    this.changed();
  }

  showFrames(shown: boolean): void {
    this.framesShown = shown;
    this.arm.player.touch();
    this.changed();
  }

  /** Set the camera to a view of the description; its points are in the robot's base frame. */
  look(view: View): void {
    const point = (v: { x: number; y: number; z: number } | undefined) =>
      new THREE.Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
    const up = point(view.up);
    this.viewpoint.look({
      eye: point(view.eye).applyMatrix4(this.base),
      target: point(view.target).applyMatrix4(this.base),
      up: up.lengthSq() ? up.transformDirection(this.base) : new THREE.Vector3(0, 0, 1),
      flat: view.projection === View_Projection.ORTHOGRAPHIC,
    });
  }

  /** Return the current camera as a view in the base frame, for the renderer. */
  view(): View {
    const { camera, controls, isFlat, fieldOfView, flatHeight } = this.viewpoint;
    const toBase = this.base.clone().invert();
    const { x, y, z } = controls.target.clone().applyMatrix4(toBase);
    const eye = camera.position.clone().applyMatrix4(toBase);
    const up = camera.up.clone().transformDirection(toBase);
    const view = create(ViewSchema, {
      name: "own",
      eye: { x: eye.x, y: eye.y, z: eye.z },
      target: { x, y, z },
      up: { x: up.x, y: up.y, z: up.z },
    });
    if (isFlat) {
      view.projection = View_Projection.ORTHOGRAPHIC;
      view.height = flatHeight;
    } else {
      view.projection = View_Projection.PERSPECTIVE;
      view.fieldOfView = THREE.MathUtils.degToRad(fieldOfView);
    }
    return view;
  }

  /** Turn the free camera by angles [rad] about the vertical and the horizontal, for the keyboard. */
  turn(azimuth: number, polar: number): void {
    this.viewpoint.turn(azimuth, polar);
  }

  /** Take the size at the next frame: a resized canvas is empty until then. */
  private readonly resize = (): void => {
    this.fitted = false;
    this.changed();
  };

  private fit(): void {
    this.fitted = true;
    const { width, height } = parentSize(this.canvas);
    const { pixelRatio } = this.sharp ? this.budget.best : this.budget.quality;
    this.viewpoint.resize(width / height);
    this.canvas.dataset.pixelRatio = String(pixelRatio);
    this.renderer.setPixelRatio(pixelRatio);
    this.renderer.setSize(width, height, false);
  }

  private readonly drawn = (tookMs: number, at: number): void => {
    this.onDrawn();
    this.gap.placeLabel(this.viewpoint.camera, this.canvas.clientWidth, this.canvas.clientHeight);
    countFrame(this.canvas);
    clearTimeout(this.restTimer);
    if (this.sharp) return; // a single frame says nothing about the machine's speed
    if (this.budget.quality !== this.budget.best) this.restTimer = setTimeout(this.sharpen, REST_MS);
    const { quality } = this.budget;
    this.loop.pauseUntil(at + this.budget.take(tookMs, at));
    if (this.budget.quality === quality) return;
    const light = this.scene.getObjectByName(KEY_LIGHT);
    if (light) light.castShadow = this.budget.quality.shadows;
    this.resize();
  };

  private readonly sharpen = (): void => {
    this.sharpening = true;
    this.resize();
  };

  private readonly draw = (at: number): boolean => {
    const placements = this.arm.placeAt(at);
    if (placements) this.place(placements);
    if (this.gap.showAt(this.arm.player.shown, this.colours)) this.dirty = true;
    const arms = [this.arm, ...this.neighbours];
    for (const neighbour of this.neighbours) if (neighbour.placeAt(at)) this.dirty = true;
    const { camera, controls } = this.viewpoint;
    if (controls.enableDamping) controls.update(); // calls `changed` until the camera is at rest
    const dirty = this.dirty;
    this.dirty = false;
    if (arms.some(({ player }) => player.moving)) this.loop.wake();
    if (!dirty) return false;
    if (this.sharp !== this.sharpening) this.fitted = false;
    this.sharp = this.sharpening;
    this.sharpening = false;
    if (!this.fitted) this.fit();
    this.renderer.render(this.scene, camera);
    return true;
  };

  private place(placements: ReadonlyMap<string, THREE.Matrix4>): void {
    for (const [frame, axes] of this.axes) {
      const placement = placements.get(frame);
      if (!placement) continue;
      axes.visible = this.framesShown;
      placement.decompose(axes.position, axes.quaternion, axes.scale);
    }
    for (const at of this.arm.player.passed(`${this.prefix}/tool`)) this.trail.extend(at);
    this.dirty = true;
  }

  dispose(): void {
    this.disposed = true;
    clearTimeout(this.restTimer);
    this.loop.dispose();
    this.observer.disconnect();
    this.viewpoint.dispose();
    for (const arm of [this.arm, ...this.neighbours]) arm.remove();
    disposeScene(this.scene, this.renderer);
  }
}
