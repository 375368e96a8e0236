// The live 3-D picture of one robot: three.js behind five functions, drawn only when something changed.

import { create } from "@bufbuild/protobuf";
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Description, View } from "../gen/robomesh_pb";
import { View_Projection, ViewSchema } from "../gen/robomesh_pb";
import { floorOf } from "../mesh/clearance";
import type { Failed } from "./arm";
import { Arm, loadOrSay, meshUrl } from "./arm";
import type { Nearest } from "./lines";
import { Gap, Path, Trail } from "./lines";
import { colourEdges, dressedFixture, paint } from "./models";
import { floor, lights, palette } from "./surroundings";

const FIELD_OF_VIEW = 32; // degrees, upright
const DEAR_MS = 50; // a picture that takes longer costs the rest of the page its time
const DEAR_ONES = 3; // in a row: the first one of all, and the first after the page was hidden, are dear anywhere
const REST = 3; // times as long as such a picture took, nothing is drawn
const LONGEST_REST_MS = 2000;

/** What somebody else's parts in the picture need: see Program's gizmo. */
export interface Stage {
  scene: THREE.Scene;
  canvas: HTMLCanvasElement;
  /** The robot's base in the site's frame. */
  base: () => THREE.Matrix4;
  /** As they are now: a view takes others. */
  camera: () => THREE.Camera;
  controls: () => OrbitControls;
  /** What is seen, for somebody else to draw. */
  view: () => View;
  changed: () => void;
}

/** A scene on a canvas. Placements come by `placeFrames`; `dispose` frees the GPU. */
export class RobotScene {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly perspective = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.02, 60);
  private readonly orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.02, 60);
  private camera: THREE.PerspectiveCamera | THREE.OrthographicCamera = this.perspective;
  private controls: OrbitControls;
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
  private request = 0;
  private drawnAt = 0;
  private drawing: WebGLSync | null = null; // until the picture is done
  private nextAt = 0;
  private dear = 0;
  private disposed = false;
  private readonly observer: ResizeObserver;

  /** @throws Error where the browser has no WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly prefix: string,
    label: HTMLElement,
  ) {
    const software = drawsInSoftware();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !software, alpha: false });
    this.renderer.setPixelRatio(software ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = !software;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.05;
    this.arm = new Arm(this.scene, prefix, "arm", this.changed);
    this.gap = new Gap(label);
    this.scene.add(...lights(), this.trail.line, this.path.line, this.gap.group);
    this.setColours();
    this.controls = this.makeControls();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas.parentElement ?? canvas);
    this.resize();
    this.request = requestAnimationFrame(this.frame);
  }

  /** Background, floor and lines after the page's theme. */
  setColours(): void {
    const colours = (this.colours = palette());
    this.scene.background = new THREE.Color(colours.background);
    const old = this.scene.getObjectByName("floor");
    if (old) this.scene.remove(old);
    if (this.floorAt !== null) {
      const made = floor(colours);
      made.name = "floor";
      // Level in the site's frame, however the robot stands on it.
      made.position.setFromMatrixPosition(this.base).setZ(this.floorAt);
      this.scene.add(made);
    }
    this.canvas.dataset.floor = String(this.floorAt);
    this.trail.line.material.color.set(colours.accent);
    this.path.line.material.color.set(colours.accent);
    this.setRed(this.red);
  }

  private readonly changed = (): void => {
    this.dirty = true;
  };

  stage(): Stage {
    const { scene, canvas, changed } = this;
    return {
      scene,
      canvas,
      base: () => this.base,
      camera: () => this.camera,
      controls: () => this.controls,
      view: () => this.view(),
      changed,
    };
  }

  /** Loads the models of the arm and of what stands around it. */
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
    // Made when a target is first dragged, a ghost's shader would hold up the page, and with it the lease.
    const compiled = (ghost: THREE.Group) => this.renderer.compile(ghost, this.camera, this.scene);
    await Promise.all([this.arm.load(description, failed, compiled), this.loadFixtures(description, failed)]);
  }

  private async loadFixtures({ fixtures }: Description, failed: Failed): Promise<void> {
    await Promise.all(
      fixtures.map(async ({ name, mesh, meshSha256, fixtureToSite, color }) => {
        const url = meshUrl(this.prefix, mesh, meshSha256);
        const model = await loadOrSay(
          url,
          () => !this.disposed,
          (why) => failed(name, why),
        );
        if (!model) return;
        const group = dressedFixture(model, color);
        if (fixtureToSite.length === 16) group.matrix.fromArray(fixtureToSite).transpose();
        this.fixtures.set(name, group);
        this.scene.add(group);
        this.canvas.dataset.fixtures = String(this.fixtures.size);
        this.setRed(this.red);
      }),
    );
  }

  /** Takes a FrameTransforms payload. */
  placeFrames(payload: Uint8Array, sourceTimeMs: number, arrivedMs: number): void {
    this.arm.placeFrames(payload, sourceTimeMs, arrivedMs);
  }

  /** How fast a replay passes; see `FramePlayer`. */
  setRate(rate: number): void {
    this.arm.player.setRate(rate);
  }

  /** Grey and translucent when what is known of the robot is old. */
  setStale(stale: boolean): void {
    this.arm.setStale(stale);
  }

  /** Another robot of the cell, drawn dimmed until it is removed; its placements are its own to take. */
  addNeighbour(prefix: string, description: Description): Arm {
    const neighbour = new Arm(this.scene, prefix, "neighbour", this.changed);
    this.neighbours.add(neighbour);
    this.canvas.dataset.neighbours = String(this.neighbours.size);
    neighbour.setRed(this.red);
    // A neighbour without its model is no trouble of this robot's: its own page says why.
    void neighbour.load(description, () => undefined);
    return neighbour;
  }

  removeNeighbour(neighbour: Arm): void {
    this.neighbours.delete(neighbour);
    neighbour.remove();
  }

  /** Draws links (`<robot>/<link>`) and fixtures red. */
  setRed(names: ReadonlySet<string>): void {
    this.red = names;
    for (const arm of [this.arm, ...this.neighbours]) arm.setRed(names);
    const { alarm, dim } = this.colours;
    for (const [name, group] of this.fixtures) {
      paint(group, { stale: false, red: names.has(name), kind: "fixture" }, alarm);
      colourEdges(group, names.has(name) ? alarm : dim);
    }
    this.canvas.dataset.red = [...names].sort().join(" ");
    this.dirty = true;
  }

  /** Shows where the links would be, as placements in the base frame; null: not at all. */
  showGhost(placements: ReadonlyMap<string, THREE.Matrix4> | null): void {
    this.canvas.dataset.ghost = String(this.arm.showGhost(placements));
  }

  /** Shows a path of the tool, in the base frame [m]; null: none. */
  showPath(points: readonly (readonly [number, number, number])[] | null): void {
    this.path.show(points);
    this.canvas.dataset.path = String(points?.length ?? 0);
    this.dirty = true;
  }

  /** Shows the nearest two points when the arm is drawn where it was at their source time [ms]; null: none. */
  showGap(nearest: Nearest | null, sourceTimeMs = 0): void {
    if (nearest) this.gap.add(nearest, sourceTimeMs);
    else this.gap.hide();
    this.dirty = true;
  }

  showTrail(shown: boolean): void {
    this.trail.show(shown);
    this.dirty = true;
  }

  showFrames(shown: boolean): void {
    this.framesShown = shown;
    this.arm.player.touch();
    this.dirty = true;
  }

  /** Looks from a view of the description; its points are in the robot's base frame. */
  look(view: View): void {
    const point = (v: { x: number; y: number; z: number } | undefined) =>
      new THREE.Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
    const eye = point(view.eye).applyMatrix4(this.base);
    const target = point(view.target).applyMatrix4(this.base);
    const flat = view.projection === View_Projection.ORTHOGRAPHIC;
    this.camera = flat ? this.orthographic : this.perspective;
    const up = point(view.up);
    this.camera.up.copy(up.lengthSq() ? up.transformDirection(this.base) : new THREE.Vector3(0, 0, 1));
    this.camera.position.copy(eye);
    this.camera.zoom = 1;
    this.controls.dispose();
    this.controls = this.makeControls();
    this.controls.enableRotate = !flat;
    this.controls.target.copy(target);
    this.resize();
    this.controls.update();
  }

  /** The camera as it is now, as a view in the base's frame, for somebody else to draw. */
  view(): View {
    const camera = this.camera;
    const toBase = this.base.clone().invert();
    const { x, y, z } = this.controls.target.clone().applyMatrix4(toBase);
    const eye = camera.position.clone().applyMatrix4(toBase);
    const up = camera.up.clone().transformDirection(toBase);
    const view = create(ViewSchema, {
      name: "own",
      eye: { x: eye.x, y: eye.y, z: eye.z },
      target: { x, y, z },
      up: { x: up.x, y: up.y, z: up.z },
    });
    if (camera === this.perspective) {
      view.projection = View_Projection.PERSPECTIVE;
      view.fieldOfView = THREE.MathUtils.degToRad(this.perspective.fov);
    } else {
      view.projection = View_Projection.ORTHOGRAPHIC;
      view.height = (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom;
    }
    return view;
  }

  private makeControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    controls.dampingFactor = 0.15;
    controls.minDistance = 0.2;
    controls.maxDistance = 12;
    controls.addEventListener("change", () => (this.dirty = true));
    return controls;
  }

  /** Turns the free camera by an angle [rad] about the vertical and the horizontal: for the keyboard. */
  turn(azimuth: number, polar: number): void {
    if (this.camera !== this.perspective) return;
    const offset = this.camera.position.clone().sub(this.controls.target);
    const upright = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
    const spherical = new THREE.Spherical().setFromVector3(offset.applyQuaternion(upright));
    spherical.theta += azimuth;
    spherical.phi = THREE.MathUtils.clamp(spherical.phi + polar, 0.05, Math.PI - 0.05);
    offset.setFromSpherical(spherical).applyQuaternion(upright.invert());
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.dirty = true;
  }

  private resize(): void {
    const box = (this.canvas.parentElement ?? this.canvas).getBoundingClientRect();
    const width = Math.max(1, Math.floor(box.width));
    const height = Math.max(1, Math.floor(box.height));
    this.renderer.setSize(width, height, false);
    this.perspective.aspect = width / height;
    // A narrow picture needs a wider angle for the same arm.
    this.perspective.fov = width < height ? FIELD_OF_VIEW * 1.35 : FIELD_OF_VIEW;
    this.perspective.updateProjectionMatrix();
    const distance = this.orthographic.position.distanceTo(this.controls.target) || 2.5;
    const half = distance * Math.tan(THREE.MathUtils.degToRad(FIELD_OF_VIEW / 2));
    const side = (half * width) / height;
    Object.assign(this.orthographic, { left: -side, right: side, top: half, bottom: -half });
    this.orthographic.updateProjectionMatrix();
    this.dirty = true;
  }

  /** Whether the last picture is done. After a dear one, drawing rests; after some, shadows are spared. */
  private isDone(at: number): boolean {
    if (!this.drawing) return true;
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    if (gl.getSyncParameter(this.drawing, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) return false;
    gl.deleteSync(this.drawing);
    this.drawing = null;
    const took = at - this.drawnAt;
    this.dear = took < DEAR_MS ? 0 : this.dear + 1;
    if (this.dear > 0) this.nextAt = at + Math.min(REST * took, LONGEST_REST_MS);
    if (this.dear !== DEAR_ONES) return true;
    this.scene.traverse((part) => {
      if (part instanceof THREE.DirectionalLight) part.castShadow = false;
    });
    if (this.renderer.getPixelRatio() > 1) {
      this.renderer.setPixelRatio(1);
      this.resize();
    }
    return true;
  }

  private readonly frame = (): void => {
    this.request = requestAnimationFrame(this.frame);
    const at = performance.now();
    if (!this.isDone(at) || at < this.nextAt) return;
    const placements = this.arm.placeAt(at);
    if (placements) this.place(placements);
    for (const neighbour of this.neighbours) if (neighbour.placeAt(at)) this.dirty = true;
    if (this.controls.enableDamping) this.controls.update();
    if (!this.dirty) return;
    this.dirty = false;
    this.drawnAt = at;
    this.renderer.render(this.scene, this.camera);
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.gap.placeLabel(this.camera, this.canvas.clientWidth, this.canvas.clientHeight);
    this.drawing = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.canvas.dataset.drawn = String(Number(this.canvas.dataset.drawn ?? 0) + 1);
  };

  private place(placements: ReadonlyMap<string, THREE.Matrix4>): void {
    for (const [frame, axes] of this.axes) {
      const placement = placements.get(frame);
      if (!placement) continue;
      axes.visible = this.framesShown;
      placement.decompose(axes.position, axes.quaternion, axes.scale);
    }
    this.gap.showAt(this.arm.player.shown, this.colours);
    for (const at of this.arm.player.passed(`${this.prefix}/tool`)) this.trail.extend(at);
    this.dirty = true;
  }

  dispose(): void {
    this.disposed = true;
    cancelAnimationFrame(this.request);
    this.observer.disconnect();
    this.controls.dispose();
    for (const arm of [this.arm, ...this.neighbours]) arm.remove();
    this.scene.traverse((part) => {
      if (!(part instanceof THREE.Mesh || part instanceof THREE.Line)) return;
      part.geometry.dispose();
      for (const material of [part.material].flat()) material.dispose();
    });
    this.renderer.dispose();
  }
}

/** Whether the browser draws 3-D without a graphics processor: then every pixel is the main processor's.
 *
 * @throws Error where it draws none. */
export function drawsInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) throw new Error("no WebGL");
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const name = names ? String(context.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}
