// The live 3-D picture of one robot: three.js behind five functions, drawn only when something changed.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { fromBinary } from "@bufbuild/protobuf";
import { FrameTransformsSchema } from "./gen/foxglove/FrameTransforms_pb";
import { View_Projection } from "./gen/robomesh_pb";
import type { Description, View } from "./gen/robomesh_pb";
import { FramePlayer } from "./frame-player";
import { floor, lights, palette } from "./scene-surroundings";

const FIELD_OF_VIEW = 32; // degrees, upright
const TRAIL_POINTS = 900;
const SAME_PLACE = 2e-3; // m, or of a rotation's matrix
const LATE_MS = 45;
const LATE_FRAMES = 15;
const SOFTWARE_FRAME_MS = 60;
const LATE_FRAME_MS = 120;
const NO_ANSWER = 504; // the mesh's service did not answer
const ASK_AGAIN_MS = 2000;
const CREASE_ANGLE = 0.6; // rad: sharper edges stay sharp

/** A scene on a canvas. Placements come by `placeFrames`; `dispose` frees the GPU. */
export class RobotScene {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly perspective = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.02, 60);
  private readonly orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.02, 60);
  private camera: THREE.PerspectiveCamera | THREE.OrthographicCamera = this.perspective;
  private controls: OrbitControls;
  private readonly player = new FramePlayer();
  private readonly links = new Map<string, THREE.Group>();
  private readonly ghosts = new Map<string, THREE.Group>();
  private readonly axes = new Map<string, THREE.AxesHelper>();
  private readonly trail: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  private trailLength = 0;
  private base = new THREE.Matrix4();
  private stale = false;
  private dirty = true;
  private framesShown = false;
  private request = 0;
  private drawnAt = 0;
  private late = 0;
  private disposed = false;
  private spared: number;
  private shortest: number; // ms between two pictures, at least
  private readonly observer: ResizeObserver;

  /** @throws Error where the browser has no WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly prefix: string,
  ) {
    const software = drawsInSoftware();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !software, alpha: false });
    this.renderer.setPixelRatio(software ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = !software;
    this.spared = software ? 1 : 0;
    this.shortest = software ? SOFTWARE_FRAME_MS : 0;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.05;
    this.trail = new THREE.Line(
      new THREE.BufferGeometry().setAttribute(
        "position",
        new THREE.BufferAttribute(new Float32Array(TRAIL_POINTS * 3), 3),
      ),
      new THREE.LineBasicMaterial({ transparent: true, opacity: 0.9 }),
    );
    this.trail.frustumCulled = false;
    this.trail.visible = false;
    this.scene.add(...lights(), this.trail);
    this.setColours();
    this.controls = this.makeControls();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas.parentElement ?? canvas);
    this.resize();
    this.request = requestAnimationFrame(this.frame);
  }

  /** Background, floor and lines after the page's theme. */
  setColours(): void {
    const colours = palette();
    this.scene.background = new THREE.Color(colours.background);
    const old = this.scene.getObjectByName("floor");
    if (old) this.scene.remove(old);
    const made = floor(colours);
    made.name = "floor";
    made.applyMatrix4(this.base);
    this.scene.add(made);
    this.trail.material.color.set(colours.accent);
    this.dirty = true;
  }

  /** Loads the links' meshes; `failed` hears why one cannot be yet, and "" when it could. */
  async load(description: Description, failed: (link: string, why: string) => void): Promise<void> {
    if (description.baseToSite.length === 16) this.base.fromArray(description.baseToSite).transpose();
    this.setColours();
    for (const frame of description.frames) {
      const axes = new THREE.AxesHelper(frame.name === "tool" ? 0.14 : 0.09);
      axes.visible = false;
      this.axes.set(`${this.prefix}/${frame.name}`, axes);
      this.scene.add(axes);
    }
    const loader = new GLTFLoader();
    await Promise.all(
      description.links.map(async ({ name, mesh, meshSha256, color }) => {
        if (!mesh) return;
        try {
          const url = `/mesh/${this.prefix}/${encodeURIComponent(mesh)}?sha=${meshSha256}`;
          let answer = await fetch(url);
          // Its service may be starting: said at once, and asked until it is there.
          while (answer.status === NO_ANSWER && !this.disposed) {
            failed(name, await answer.text());
            await new Promise((resolve) => setTimeout(resolve, ASK_AGAIN_MS));
            answer = await fetch(url);
          }
          if (!answer.ok) throw new Error(await answer.text());
          if (this.disposed) return;
          failed(name, "");
          const { scene } = await loader.parseAsync(await answer.arrayBuffer(), "");
          this.addLink(`${this.prefix}/${name}`, scene, color);
        } catch (error) {
          failed(name, error instanceof Error ? error.message : String(error));
        }
      }),
    );
  }

  private addLink(frame: string, model: THREE.Group, color: string): void {
    model.traverse((part) => {
      if (!(part instanceof THREE.Mesh)) return;
      part.castShadow = true;
      part.receiveShadow = true;
      if (!part.geometry.getAttribute("normal")) part.geometry = toCreasedNormals(part.geometry, CREASE_ANGLE);
      const own = part.material instanceof THREE.MeshStandardMaterial ? part.material : null;
      const material = new THREE.MeshStandardMaterial({
        color: own?.color ?? new THREE.Color(color || "#8a8f94"),
        vertexColors: part.geometry.hasAttribute("color"),
        map: own?.map ?? null,
        roughness: 0.55,
        metalness: 0.1,
        side: THREE.DoubleSide,
      });
      part.material = material;
      part.userData["colour"] = material.color.clone();
    });
    const group = new THREE.Group();
    group.add(model);
    group.matrixAutoUpdate = false;
    group.visible = false; // until its frame has come
    this.links.set(frame, group);
    this.scene.add(group);
    this.paint();
    this.player.touch();
  }

  /** Takes a FrameTransforms payload. */
  placeFrames(payload: Uint8Array, sourceTimeMs: number, arrivedMs: number): void {
    this.player.add(fromBinary(FrameTransformsSchema, payload), sourceTimeMs, arrivedMs);
  }

  /** Grey and translucent when what is known of the robot is old. */
  setStale(stale: boolean): void {
    if (stale === this.stale) return;
    this.stale = stale;
    this.paint();
  }

  private paint(): void {
    for (const group of this.links.values()) {
      group.traverse((part) => {
        if (!(part instanceof THREE.Mesh)) return;
        const material = part.material as THREE.MeshStandardMaterial;
        material.color.copy(part.userData["colour"] as THREE.Color);
        if (this.stale) material.color.set("#7d8387");
        material.vertexColors = !this.stale && part.geometry.hasAttribute("color");
        material.transparent = this.stale;
        material.opacity = this.stale ? 0.38 : 1;
        material.needsUpdate = true;
        part.castShadow = !this.stale;
      });
    }
    this.dirty = true;
  }

  /** Shows where the links would be, as placements in the base frame by rows; null: not at all. */
  showGhost(placements: ReadonlyMap<string, readonly number[]> | null): void {
    for (const [frame, group] of this.links) {
      const placement = placements?.get(frame.slice(this.prefix.length + 1));
      let copy = this.ghosts.get(frame);
      if (!copy && placement) {
        copy = this.ghostOf(group);
        this.ghosts.set(frame, copy);
        this.scene.add(copy);
      }
      if (!copy) continue;
      if (placement) copy.matrix.fromArray(placement).transpose().premultiply(this.base);
      // A link that stays where it is needs no ghost over it.
      copy.visible = placement !== undefined && !alike(copy.matrix, group.matrix);
    }
    this.canvas.dataset["ghost"] = String([...this.ghosts.values()].filter((copy) => copy.visible).length);
    this.dirty = true;
  }

  private ghostOf(group: THREE.Group): THREE.Group {
    const copy = group.clone();
    copy.matrixAutoUpdate = false;
    const material = new THREE.MeshStandardMaterial({
      color: palette().accent,
      transparent: true,
      opacity: 0.4,
      depthWrite: false,
    });
    copy.traverse((part) => {
      if (!(part instanceof THREE.Mesh)) return;
      part.material = material;
      part.castShadow = false;
    });
    return copy;
  }

  showTrail(shown: boolean): void {
    this.trail.visible = shown;
    this.trailLength = 0;
    this.trail.geometry.setDrawRange(0, 0);
    this.dirty = true;
  }

  showFrames(shown: boolean): void {
    this.framesShown = shown;
    this.player.touch();
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

  /** A machine that is late gets no shadow, then fewer pictures, so that the rest of the page is not late too. */
  private spare(took: number): void {
    if (took > 1000 || this.spared === 2) return; // hidden meanwhile; nothing left to spare
    this.late = Math.max(0, this.late + (took > this.shortest + LATE_MS ? 1 : -2));
    if (this.late < LATE_FRAMES) return;
    this.late = 0;
    this.spared++;
    this.scene.traverse((part) => {
      if (part instanceof THREE.DirectionalLight) part.castShadow = false;
    });
    this.renderer.setPixelRatio(1);
    if (this.spared === 2) this.shortest = LATE_FRAME_MS;
    this.resize();
  }

  private readonly frame = (at: number): void => {
    this.request = requestAnimationFrame(this.frame);
    if (at - this.drawnAt < this.shortest) return;
    const placements = this.player.at(at);
    if (placements) this.place(placements);
    if (this.controls.enableDamping) this.controls.update();
    const took = at - this.drawnAt;
    this.drawnAt = at;
    if (!this.dirty) return;
    this.dirty = false;
    this.spare(took);
    this.renderer.render(this.scene, this.camera);
    this.canvas.dataset["drawn"] = String(Number(this.canvas.dataset["drawn"] ?? 0) + 1);
  };

  private place(placements: ReadonlyMap<string, THREE.Matrix4>): void {
    for (const [frame, placement] of placements) {
      const group = this.links.get(frame);
      if (group) {
        group.matrix.copy(placement);
        group.visible = true;
      }
      const axes = this.axes.get(frame);
      if (axes) {
        axes.visible = this.framesShown;
        placement.decompose(axes.position, axes.quaternion, axes.scale);
      }
    }
    for (const at of this.player.passed(`${this.prefix}/tool`)) this.extendTrail(at);
    this.dirty = true;
  }

  private extendTrail(at: THREE.Vector3): void {
    if (!this.trail.visible) return;
    const points = this.trail.geometry.getAttribute("position") as THREE.BufferAttribute;
    if (this.trailLength === TRAIL_POINTS) {
      points.array.copyWithin(0, 3);
      this.trailLength--;
    }
    points.setXYZ(this.trailLength++, at.x, at.y, at.z);
    points.needsUpdate = true;
    this.trail.geometry.setDrawRange(0, this.trailLength);
  }

  dispose(): void {
    this.disposed = true;
    cancelAnimationFrame(this.request);
    this.observer.disconnect();
    this.controls.dispose();
    this.scene.traverse((part) => {
      if (!(part instanceof THREE.Mesh || part instanceof THREE.Line)) return;
      part.geometry.dispose();
      for (const material of [part.material].flat()) material.dispose();
    });
    this.renderer.dispose();
  }
}

/** Whether the browser draws 3-D without a graphics processor: then every pixel is the main processor's. */
function drawsInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const name = context && names ? String(context.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

function alike(first: THREE.Matrix4, second: THREE.Matrix4): boolean {
  return first.elements.every((value, i) => Math.abs(value - (second.elements[i] ?? 0)) < SAME_PLACE);
}
