// Camera of a 3-D picture: perspective or orthographic, moved by orbit controls or the keyboard.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const FIELD_OF_VIEW = 32; // degrees, upright

/** Position and direction of a camera, in metres. */
export interface CameraPose {
  eye: THREE.Vector3;
  target: THREE.Vector3;
  up: THREE.Vector3;
  /** Orthographic. */
  flat: boolean;
}

export interface ViewpointOptions {
  /** Nearest and farthest distance that is drawn [m]. */
  clip: readonly [near: number, far: number];
  /** Nearest and farthest distance from the target [m]. */
  distance: readonly [near: number, far: number];
  /** The controls glide to a stop. */
  damping: boolean;
  /** An orthographic camera can be turned. */
  turnsFlat: boolean;
  /** Least angle between the camera's direction and the vertical [rad]. */
  polarMargin: number;
}

export class Viewpoint {
  private readonly perspective: THREE.PerspectiveCamera;
  private readonly orthographic: THREE.OrthographicCamera;
  camera: THREE.PerspectiveCamera | THREE.OrthographicCamera;
  controls: OrbitControls;
  /** Whether a person moved the camera since the last `look`. */
  touched = false;
  private aspect = 1;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly options: ViewpointOptions,
    private readonly moved: () => void,
  ) {
    this.perspective = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, ...options.clip);
    this.orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, ...options.clip);
    this.camera = this.perspective;
    this.controls = this.makeControls();
  }

  get isFlat(): boolean {
    return this.camera === this.orthographic;
  }

  /** Vertical field of view of the perspective camera [degrees]. */
  get fieldOfView(): number {
    return this.perspective.fov;
  }

  /** Height of the orthographic picture at its zoom [m]. */
  get flatHeight(): number {
    return (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom;
  }

  look({ eye, target, up, flat }: CameraPose): void {
    this.camera = flat ? this.orthographic : this.perspective;
    this.camera.up.copy(up);
    this.camera.position.copy(eye);
    this.camera.zoom = 1;
    this.controls.dispose();
    this.controls = this.makeControls();
    this.controls.enableRotate = !flat || this.options.turnsFlat;
    this.controls.target.copy(target);
    this.resize(this.aspect);
    this.controls.update();
    this.touched = false;
    this.moved();
  }

  /** Return the current look; the zoom of an orthographic camera becomes the distance of its eye. */
  now(): CameraPose {
    const { target } = this.controls;
    const away = this.camera.position.clone().sub(target).divideScalar(this.camera.zoom);
    return {
      eye: target.clone().add(away),
      target: target.clone(),
      up: this.camera.up.clone(),
      flat: this.isFlat,
    };
  }

  /** Factor that makes letters as large in an orthographic picture as in a perspective one. */
  get letterScale(): number {
    const halfAngle = THREE.MathUtils.degToRad(this.perspective.fov / 2);
    return this.isFlat ? this.flatHeight / 2 / Math.tan(halfAngle) : 1;
  }

  /** Turn about the target by angles [rad] about the vertical and the horizontal, for the keyboard. */
  turn(azimuth: number, polar: number): void {
    if (this.isFlat && !this.options.turnsFlat) return;
    const { polarMargin } = this.options;
    const offset = this.camera.position.clone().sub(this.controls.target);
    const upright = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
    const spherical = new THREE.Spherical().setFromVector3(offset.applyQuaternion(upright));
    spherical.theta += azimuth;
    spherical.phi = THREE.MathUtils.clamp(spherical.phi + polar, polarMargin, Math.PI - polarMargin);
    offset.setFromSpherical(spherical).applyQuaternion(upright.invert());
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.touched = true;
    this.moved();
  }

  resize(aspect: number): void {
    this.aspect = aspect;
    this.perspective.aspect = aspect;
    this.perspective.fov = aspect < 1 ? FIELD_OF_VIEW * 1.35 : FIELD_OF_VIEW; // a narrow picture needs a wider angle
    this.perspective.updateProjectionMatrix();
    const distance = this.orthographic.position.distanceTo(this.controls.target) || 2.5;
    const half = distance * Math.tan(THREE.MathUtils.degToRad(FIELD_OF_VIEW / 2));
    Object.assign(this.orthographic, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    this.orthographic.updateProjectionMatrix();
  }

  private makeControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = this.options.damping && !matchMedia("(prefers-reduced-motion: reduce)").matches;
    controls.dampingFactor = 0.15;
    [controls.minDistance, controls.maxDistance] = this.options.distance;
    controls.addEventListener("change", this.moved);
    controls.addEventListener("start", () => (this.touched = true));
    return controls;
  }

  dispose(): void {
    this.controls.dispose();
  }
}
