// The live 3-D picture of one robot, drawn only after a change.

import { fromBinary } from "@bufbuild/protobuf";
import * as THREE from "three";
import type { FrameTransforms } from "../gen/foxglove/FrameTransforms_pb";
import { FrameTransformsSchema } from "../gen/foxglove/FrameTransforms_pb";
import { JointStatesSchema } from "../gen/foxglove/JointStates_pb";
import type { Description, View } from "../gen/robomesh_pb";
import type { Sample } from "../mesh/console/connection";
import { watch } from "../mesh/console/connection";
import type { Picture } from "../mesh/control/display-freshness";
import { floorOf } from "../mesh/state/clearance";
import type { Camera } from "../ui/page/layout";
import type { Theme } from "../ui/page/theme";
import { DrawBudget, qualities } from "./canvas/draw-budget";
import { DrawLoop } from "./canvas/draw-loop";
import {
  countFrame,
  disposeScene,
  drawsInSoftware,
  makeRenderer,
  observeSize,
  parentSize,
  toneMap,
} from "./canvas/webgl";
import type { Failed } from "./parts/arm";
import { Arm, loadOrReport, meshUrl } from "./parts/arm";
import type { Forward } from "./parts/forward-kinematics";
import { forwardOf } from "./parts/forward-kinematics";
import { framesOfJoints } from "./parts/frames-of-joints";
import type { Nearest } from "./parts/lines";
import { ClearanceLine, Path, Trail } from "./parts/lines";
import { colourEdges, paint, withEdges } from "./parts/models";
import type { Stage } from "./parts/stage";
import { KEY_LIGHT, lights, palette, surround } from "./parts/surroundings";
import { SceneCamera } from "./scene-camera";

/** What the scene shows of its robot, and how. */
export interface SceneState {
  description: Description;
  /** The topic that places the links: "frames", or joints from which the scene computes them. */
  topic: "frames" | "joints/slow";
  /** Draw the robot grey and translucent, because its data is stale. */
  stale: boolean;
  /** Of a replay; see `FramePlayer`. */
  rate: number;
  theme: Theme;
  trail: boolean;
  frames: boolean;
  /** Joint positions of the ghost [rad] or [m]; null: none. */
  ghost: readonly number[] | null;
  /** Red links (`<robot>/<link>`) and fixtures. */
  red: ReadonlySet<string>;
  /** A path of the tool in the base frame [m]; null: none. */
  path: readonly (readonly [number, number, number])[] | null;
  /** The two nearest points, shown together with the arm at their source time [ms]; null: not known. */
  nearest: { nearest: Nearest; sourceTime: number } | null;
  view: View;
  /** Where a person put the camera; null: where the view has it. */
  pose: readonly number[] | null;
  /** Called when a person has moved the camera; undefined: nothing follows it. */
  moved: ((camera: Camera) => void) | undefined;
  /** Called with each picture that is ready. */
  drew: (picture: Picture) => void;
}

// After the last motion; then a coarse picture is drawn once more, in full.
const REST_MS = 700;
const KEPT_SAMPLES = 16; // more than the drawing lags behind

/** A scene on a canvas. `update` says what it shows; `dispose` frees the GPU. */
export class RobotScene {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera: SceneCamera;
  private readonly prefix: string; // `<site>/<robot>`
  private readonly arm: Arm;
  private readonly neighbours = new Set<Arm>();
  private readonly fixtures = new Map<string, THREE.Group>();
  private readonly axes = new Map<string, THREE.AxesHelper>();
  private readonly trail = new Trail();
  private readonly path = new Path();
  private readonly clearance: ClearanceLine;
  private readonly base = new THREE.Matrix4();
  private floorAt: number | null = null; // in the site's frame [m]
  private colours = palette();
  private state: SceneState | undefined;
  private forward: Forward = () => new Map();
  private received: Sample[] = []; // oldest first
  private unfollow: () => void = () => undefined;
  private dirty = true;
  private readonly loop: DrawLoop;
  private readonly budget: DrawBudget;
  private fitted = false;
  private sharp = false; // drawn at the best resolution, because nothing moves
  private sharpening = false;
  private restTimer: ReturnType<typeof setTimeout> | undefined;
  private disposed = false;
  private readonly observer: ResizeObserver;

  /** @throws Error if the browser has no WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly robotKey: string,
    label: HTMLElement,
  ) {
    const software = drawsInSoftware();
    this.prefix = robotKey.split("/").slice(1).join("/");
    this.renderer = makeRenderer(software, canvas);
    this.loop = new DrawLoop(this.renderer, this.draw, this.drawn);
    this.budget = new DrawBudget(qualities(software));
    this.renderer.shadowMap.enabled = !software;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    toneMap(this.renderer);
    this.arm = new Arm(this.scene, this.prefix, "arm", this.changed);
    this.clearance = new ClearanceLine(label);
    this.scene.add(...lights(), this.trail.line, this.path.line, this.clearance.group);
    this.setColours();
    this.camera = new SceneCamera(canvas, this.base, this.changed);
    this.observer = observeSize(canvas, this.resize);
    canvas.addEventListener("webglcontextrestored", this.resize);
    this.resize();
  }

  /** Show a state; only differences from the last one are drawn again. */
  update(state: SceneState): void {
    const before = this.state;
    this.state = state;
    const changed = (name: keyof SceneState) => before?.[name] !== state[name];
    if (changed("description"))
      this.forward = forwardOf(
        state.description.urdf,
        state.description.joints.map(({ name }) => name),
      );
    if (changed("topic")) this.follow(state.topic);
    if (changed("stale")) {
      this.arm.setStale(state.stale);
      this.loop.hurry();
    }
    this.arm.player.setRate(state.rate);
    if (before && changed("theme")) this.setColours();
    if (changed("trail")) this.trail.show(state.trail);
    if (changed("frames")) this.arm.player.touch();
    if (changed("ghost") || changed("description")) this.showGhost();
    if (changed("red")) this.paintRed();
    if (changed("path")) {
      this.path.show(state.path);
      this.canvas.dataset.path = String(state.path?.length ?? 0);
    }
    if (changed("nearest")) this.showNearest(state.nearest);
    if (changed("trail") || changed("frames") || changed("path")) this.changed();
    this.camera.moved = state.moved;
    this.camera.show(state.view, state.pose);
  }

  /** Set background, floor and lines to the page's theme. */
  private setColours(): void {
    const colours = (this.colours = palette());
    // Level in the site's frame, whatever the robot's base is tilted by.
    const floor = surround(this.scene, colours, this.floorAt !== null);
    floor?.position.setFromMatrixPosition(this.base).setZ(this.floorAt ?? 0);
    this.canvas.dataset.floor = String(this.floorAt);
    this.trail.line.material.color.set(colours.accent);
    this.path.line.material.color.set(colours.accent);
    this.paintRed();
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
      camera: () => this.camera.viewpoint.camera,
      controls: () => this.camera.viewpoint.controls,
      view: () => this.camera.now(),
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
    const compiled = (ghost: THREE.Group) => this.renderer.compile(ghost, this.camera.viewpoint.camera, this.scene);
    await Promise.all([this.arm.load(description, failed, compiled), this.loadFixtures(description, failed)]);
    this.showGhost();
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
        this.paintRed();
      }),
    );
  }

  /** Take placements from another topic. */
  private follow(topic: SceneState["topic"]): void {
    this.unfollow();
    this.received = [];
    this.unfollow = watch(`${this.robotKey}/${topic}`, (sample) => {
      this.received.push(sample);
      if (this.received.length > KEPT_SAMPLES) this.received.shift();
      this.arm.placeFrames(this.framesIn(topic, sample.payload), sample.sourceTime, sample.arrived);
      if (this.clearance.waits) this.loop.wake();
      this.reportPicture();
    });
  }

  private framesIn(topic: SceneState["topic"], payload: Uint8Array): FrameTransforms {
    if (topic === "frames" || !this.state) return fromBinary(FrameTransformsSchema, payload);
    return framesOfJoints(this.prefix, this.state.description, this.forward, fromBinary(JointStatesSchema, payload));
  }

  /** Report the publication that is drawn. */
  private reportPicture(): void {
    const { moving, shown } = this.arm.player;
    const newest = moving ? this.received.findLast(({ sourceTime }) => sourceTime <= shown) : this.received.at(-1);
    // After the loss of its WebGL context, as with a GPU's reset, the canvas shows an old picture.
    if (newest) this.state?.drew(this.renderer.getContext().isContextLost() ? null : newest);
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

  private get red(): ReadonlySet<string> {
    return this.state?.red ?? new Set();
  }

  private paintRed(): void {
    const { red } = this;
    for (const arm of [this.arm, ...this.neighbours]) arm.setRed(red);
    const { alarm, dim } = this.colours;
    for (const [name, group] of this.fixtures) {
      paint(group, { stale: false, red: red.has(name), kind: "fixture" }, alarm);
      colourEdges(group, red.has(name) ? alarm : dim);
    }
    this.canvas.dataset.red = [...red].sort().join(" ");
    this.changed();
  }

  private showGhost(): void {
    const positions = this.state?.ghost;
    this.canvas.dataset.ghost = String(this.arm.showGhost(positions ? this.forward(positions) : null));
  }

  private showNearest(found: SceneState["nearest"]): void {
    if (found) this.clearance.add(found.nearest, found.sourceTime);
    else if (this.clearance.hide()) this.changed();
    if (this.clearance.waits) this.loop.wake();
  }

  /** Turn the free camera by angles [rad] about the vertical and the horizontal, for the keyboard. */
  turn(azimuth: number, polar: number): void {
    this.camera.viewpoint.turn(azimuth, polar);
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
    this.camera.viewpoint.resize(width / height);
    this.canvas.dataset.pixelRatio = String(pixelRatio);
    this.renderer.setPixelRatio(pixelRatio);
    this.renderer.setSize(width, height, false);
  }

  private readonly drawn = (tookMs: number, at: number): void => {
    this.reportPicture();
    this.clearance.placeLabel(this.camera.viewpoint.camera, this.canvas.clientWidth, this.canvas.clientHeight);
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
    if (this.clearance.showAt(this.arm.player.shown, this.colours)) this.dirty = true;
    const arms = [this.arm, ...this.neighbours];
    for (const neighbour of this.neighbours) if (neighbour.placeAt(at)) this.dirty = true;
    const { camera, controls } = this.camera.viewpoint;
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
      axes.visible = this.state?.frames ?? false;
      placement.decompose(axes.position, axes.quaternion, axes.scale);
    }
    for (const at of this.arm.player.passed(`${this.prefix}/tool`)) this.trail.extend(at);
    this.dirty = true;
  }

  dispose(): void {
    this.disposed = true;
    this.unfollow();
    clearTimeout(this.restTimer);
    this.loop.dispose();
    this.observer.disconnect();
    this.camera.dispose();
    for (const arm of [this.arm, ...this.neighbours]) arm.remove();
    disposeScene(this.scene, this.renderer);
  }
}
