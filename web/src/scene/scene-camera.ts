// The camera of a robot's 3-D view: a view of the description, or where a person put it.

import { create } from "@bufbuild/protobuf";
import * as THREE from "three";
import type { View, Vector3 as ViewPoint } from "../gen/robomesh_pb";
import { View_Projection, ViewSchema } from "../gen/robomesh_pb";
import type { Camera } from "../ui/page/layout";
import { Viewpoint } from "./canvas/viewpoint";

const REST_INTERVAL_MS = 500;

export class SceneCamera {
  readonly viewpoint: Viewpoint;
  /** Called with the camera when a person has moved it, and it rests; undefined: not wanted. */
  moved: ((camera: Camera) => void) | undefined;
  private view: View | undefined;
  private pose = ""; // as asked for
  private reported = "";
  private rested = ""; // since the last view
  private last = "";
  private readonly timer = setInterval(() => this.reportAtRest(), REST_INTERVAL_MS);

  /** `base`: the robot's base in the site's frame, in which views are given. */
  constructor(
    canvas: HTMLCanvasElement,
    private readonly base: THREE.Matrix4,
    changed: () => void,
  ) {
    this.viewpoint = new Viewpoint(
      canvas,
      { clip: [0.02, 60], distance: [0.2, 12], damping: true, turnsFlat: false, polarMargin: 0.05 },
      changed,
    );
  }

  /** Set the camera to a view or to a person's pose, when either is another one than before. */
  show(view: View, pose: readonly number[] | null): void {
    const asked = pose?.join() ?? "";
    const sameView = view.name === this.view?.name;
    if (sameView && asked === this.pose) return;
    // The camera's own report, which the address follows.
    const own = sameView && asked !== "" && asked === this.reported;
    this.view = view;
    this.pose = asked;
    if (own) return;
    this.look(pose ? viewFrom(view, pose) : view);
    this.reported = this.rested = this.last = "";
  }

  private look(view: View): void {
    const point = (at: ViewPoint | undefined) => new THREE.Vector3(at?.x, at?.y, at?.z);
    const up = point(view.up);
    this.viewpoint.look({
      eye: point(view.eye).applyMatrix4(this.base),
      target: point(view.target).applyMatrix4(this.base),
      up: up.lengthSq() ? up.transformDirection(this.base) : new THREE.Vector3(0, 0, 1),
      flat: view.projection === View_Projection.ORTHOGRAPHIC,
    });
  }

  /** Return the current camera as a view in the base frame, for the renderer. */
  now(): View {
    const { camera, controls, isFlat, fieldOfView, flatHeight } = this.viewpoint;
    const toBase = this.base.clone().invert();
    const message = ({ x, y, z }: THREE.Vector3) => ({ x, y, z });
    return create(ViewSchema, {
      name: "own",
      eye: message(camera.position.clone().applyMatrix4(toBase)),
      target: message(controls.target.clone().applyMatrix4(toBase)),
      up: message(camera.up.clone().transformDirection(toBase)),
      ...(isFlat
        ? { projection: View_Projection.ORTHOGRAPHIC, height: flatHeight }
        : { projection: View_Projection.PERSPECTIVE, fieldOfView: THREE.MathUtils.degToRad(fieldOfView) }),
    });
  }

  /** Report the pose once it is another one and two checks found it the same: each report changes the address. */
  private reportAtRest(): void {
    if (!this.view || !this.moved) return;
    const pose = poseOf(this.now());
    const now = pose.join();
    const moved = this.rested !== "" && now !== this.rested;
    if (moved && now === this.last) {
      this.rested = now;
      // A flat view has a zoom, which a pose does not say.
      if (this.view.projection !== View_Projection.ORTHOGRAPHIC) {
        this.reported = now;
        this.moved({ view: this.view.name, pose });
      }
    }
    this.rested ||= now;
    this.last = now;
  }

  dispose(): void {
    clearInterval(this.timer);
    this.viewpoint.dispose();
  }
}

function poseOf({ eye, target }: View): number[] {
  return [eye, target].flatMap((at) => [at?.x ?? 0, at?.y ?? 0, at?.z ?? 0].map((each) => Number(each.toFixed(3))));
}

function viewFrom({ name, projection, up }: View, [x = 0, y = 0, z = 0, ...target]: readonly number[]): View {
  const [tx = 0, ty = 0, tz = 0] = target;
  return create(ViewSchema, {
    name,
    projection,
    up: up ?? { z: 1 },
    eye: { x, y, z },
    target: { x: tx, y: ty, z: tz },
  });
}
