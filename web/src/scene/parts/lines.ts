// Lines in the 3-D view: the tool's trail, a path that it would take, the shortest distance.

import * as THREE from "three";
import type { Vector3 as Point } from "../../gen/robomesh_pb";
import type { Level } from "../../mesh/state/robot-state";
import type { Palette } from "./surroundings";

const TRAIL_POINTS = 900;
const END_RADIUS = 0.006; // m
const MOST_WAITING = 20; // a second of data
const NEAR_MS = 25; // half of the interval between two
const SAME_PLACE = 1e-4; // m

/** A line drawn over everything: a path behind a link stays visible. */
function line(points: number): THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial> {
  const made = new THREE.Line(
    new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(points * 3), 3)),
    new THREE.LineBasicMaterial({ transparent: true, opacity: 0.9 }),
  );
  made.frustumCulled = false;
  made.visible = false;
  return made;
}

/** The last positions of the tool, in the site's frame. */
export class Trail {
  readonly line = line(TRAIL_POINTS);
  private length = 0;

  show(shown: boolean): void {
    this.line.visible = shown;
    this.length = 0;
    this.line.geometry.setDrawRange(0, 0);
  }

  extend(at: THREE.Vector3): void {
    if (!this.line.visible) return;
    const points = this.line.geometry.getAttribute("position") as THREE.BufferAttribute;
    if (this.length === TRAIL_POINTS) {
      points.array.copyWithin(0, 3);
      this.length--;
    }
    points.setXYZ(this.length++, at.x, at.y, at.z);
    points.needsUpdate = true;
    this.line.geometry.setDrawRange(0, this.length);
  }
}

/** A path through any number of points, in the frame of `group`'s matrix. */
export class Path {
  readonly line = line(0);

  constructor() {
    this.line.matrixAutoUpdate = false;
    this.line.material.depthTest = false;
  }

  show(points: readonly (readonly [number, number, number])[] | null): void {
    this.line.visible = points !== null && points.length > 1;
    this.line.geometry.dispose();
    this.line.geometry = new THREE.BufferGeometry().setAttribute(
      "position",
      new THREE.Float32BufferAttribute((points ?? []).flat(), 3),
    );
  }
}

/** The two nearest points in the site's frame [m], their level, and their distance in words. */
export interface Nearest {
  points: readonly [Point | undefined, Point | undefined];
  level: Level;
  text: string;
}

/** A line between the two nearest points with a ball at each end and a label, in time with the arm's frames. */
export class ClearanceLine {
  readonly group = new THREE.Group();
  private readonly line = line(2);
  private readonly material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true });
  private readonly ends = [0, 1].map(() => new THREE.Mesh(new THREE.SphereGeometry(END_RADIUS, 12, 8), this.material));
  private shown: Nearest | null = null;
  private waiting: { time: number; nearest: Nearest }[] = []; // by source time, ms

  constructor(private readonly label: HTMLElement) {
    this.line.visible = true;
    this.line.material.depthTest = false;
    this.group.add(this.line, ...this.ends);
    this.group.visible = false;
  }

  /** Add the nearest points at a source time [ms]. */
  add(nearest: Nearest, time: number): void {
    const last = this.waiting.at(-1);
    if (last && time < last.time)
      this.waiting = []; // a new publisher
    else if (last && alike(last.nearest, nearest)) return;
    this.waiting.push({ time, nearest });
    if (this.waiting.length > MOST_WAITING) this.waiting.shift();
  }

  /** Hide them; return whether they were shown. */
  hide(): boolean {
    const was = this.group.visible;
    this.waiting = [];
    this.shown = null;
    this.group.visible = false;
    return was;
  }

  /** Whether points wait for the arm's frames. */
  get waits(): boolean {
    return this.waiting.length > 0 && this.waiting.at(-1)?.nearest !== this.shown;
  }

  /** Show the nearest points of the arm's drawn source time [ms]; return whether they changed. */
  showAt(time: number, { dim, warning, alarm }: Palette): boolean {
    const next = this.waiting.findIndex((each) => each.time > time + NEAR_MS);
    const nearest = this.waiting.at(next < 0 ? -1 : next - 1)?.nearest;
    if (!nearest || next === 0 || nearest === this.shown) return false;
    this.shown = nearest;
    const { points, level } = nearest;
    const positions = this.line.geometry.getAttribute("position") as THREE.BufferAttribute;
    points.forEach((point, i) => {
      const at = vector(point);
      positions.setXYZ(i, at.x, at.y, at.z);
      this.ends[i]?.position.copy(at);
    });
    positions.needsUpdate = true;
    const colour = { normal: dim, warning, alarm }[level];
    this.line.material.color.set(colour);
    this.material.color.set(colour);
    this.group.visible = true;
    return true;
  }

  /** Place the label next to the line's middle in the drawn picture of a size [px]. */
  placeLabel(camera: THREE.Camera, width: number, height: number): void {
    const [first, second] = this.ends.map((end) => end.position);
    this.label.hidden = !this.shown;
    if (!this.shown || !first || !second) return;
    this.label.textContent = this.shown.text;
    this.label.dataset.level = this.shown.level;
    const { x, y } = first.clone().lerp(second, 0.5).project(camera);
    this.label.style.translate = `${((x + 1) / 2) * width}px ${((1 - y) / 2) * height}px`;
  }
}

function alike(one: Nearest, other: Nearest): boolean {
  const near = (index: 0 | 1) => vector(one.points[index]).distanceTo(vector(other.points[index])) < SAME_PLACE;
  return one.text === other.text && one.level === other.level && near(0) && near(1);
}

function vector(point: Point | undefined): THREE.Vector3 {
  return new THREE.Vector3(point?.x, point?.y, point?.z);
}
