// The cameras of the 3-D view: free, and the description's views, parallel or perspective.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const FIELD_OF_VIEW = 32; // degrees, upright

/** Where a camera stands and looks, in metres. */
export interface Look {
  eye: THREE.Vector3;
  target: THREE.Vector3;
  up: THREE.Vector3;
  flat: boolean;
}

export class Viewpoint {
  private readonly perspective = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 500);
  private readonly orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.01, 500);
  camera: THREE.PerspectiveCamera | THREE.OrthographicCamera = this.perspective;
  controls: OrbitControls;
  /** Whether a person moved the camera since the last `look`. */
  touched = false;
  private aspect = 1;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly moved: () => void,
  ) {
    this.controls = this.makeControls();
  }

  look({ eye, target, up, flat }: Look): void {
    this.camera = flat ? this.orthographic : this.perspective;
    this.camera.up.copy(up);
    this.camera.position.copy(eye);
    this.camera.zoom = 1;
    this.controls.dispose();
    this.controls = this.makeControls();
    this.controls.target.copy(target);
    this.resize(this.aspect);
    this.controls.update();
    this.touched = false;
    this.moved();
  }

  /** Where it looks from now; the zoom of a parallel view is how far away its eye is. */
  now(): Look {
    const { target } = this.controls;
    const away = this.camera.position.clone().sub(target).divideScalar(this.camera.zoom);
    return {
      eye: target.clone().add(away),
      target: target.clone(),
      up: this.camera.up.clone(),
      flat: this.camera === this.orthographic,
    };
  }

  /** What is to be as large on a parallel view's picture as 1 is on a perspective one's, at any distance. */
  get letterScale(): number {
    const halfAngle = THREE.MathUtils.degToRad(this.perspective.fov / 2);
    const { top, zoom } = this.orthographic;
    return this.camera === this.orthographic ? top / zoom / Math.tan(halfAngle) : 1;
  }

  /** Turns about the target by an angle [rad] about the vertical and the horizontal: for the keyboard. */
  turn(azimuth: number, polar: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const upright = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
    const spherical = new THREE.Spherical().setFromVector3(offset.applyQuaternion(upright));
    spherical.theta += azimuth;
    spherical.phi = THREE.MathUtils.clamp(spherical.phi + polar, 0.02, Math.PI - 0.02);
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
    controls.minDistance = 0.05;
    controls.maxDistance = 100;
    controls.addEventListener("change", this.moved);
    controls.addEventListener("start", () => (this.touched = true));
    return controls;
  }

  dispose(): void {
    this.controls.dispose();
  }
}
