// Playback of frames at the display's rate: interpolated between the two newest, at most 100 ms late.

import * as THREE from "three";
import type { FrameTransforms } from "../../gen/foxglove/FrameTransforms_pb";

interface Pose {
  position: THREE.Vector3;
  rotation: THREE.Quaternion;
}
interface Keyed {
  time: number; // source time, ms
  poses: Map<string, Pose>; // in the site's frame
}

const BEHIND_MS = 60;
const MAX_FRAMES = 12;
const GAP_MS = 1000; // of source time at this page's rate
const SAME_PLACE = 1e-4; // m, or an element of a quaternion: less than a pixel of the nearest view

/** Frames on arrival, placements when drawn. */
export class FramePlayer {
  private readonly frames: Keyed[] = [];
  private skew = Number.POSITIVE_INFINITY; // page clock minus source clock of the least delayed frame, ms
  private rate = 1;
  private readonly placements = new Map<string, THREE.Matrix4>();
  private settled = false;
  private shownTime = Number.NEGATIVE_INFINITY; // source time of the last result, ms
  private passedTime = Number.NEGATIVE_INFINITY;

  /** Add a message; return whether the placements change because of it. */
  add(message: FrameTransforms, sourceTime: number, arrived: number): boolean {
    const newest = this.frames.at(-1);
    const early = arrived - sourceTime / this.rate;
    if (newest && (sourceTime <= newest.time || sourceTime - newest.time > GAP_MS * Math.max(1, this.rate))) {
      this.begin(); // a new publisher, a replay's jump, or a long gap: do not interpolate across it
    }
    // A replay was paused: its frames are later from now on.
    if (early - this.skew > GAP_MS) this.skew = early;
    // Forget slowly, which compensates for drifting clocks.
    this.skew = Math.min(this.skew + 0.05, early);
    const poses = inSite(message);
    const [before, last] = this.frames.slice(-2);
    // At rest the last two frames share their poses, and the later one gets the time of the newest message.
    if (before && last && before.poses === last.poses && alike(poses, last.poses)) {
      last.time = sourceTime;
      return !this.settled;
    }
    const latest = this.frames.at(-1);
    const same = latest !== undefined && alike(poses, latest.poses);
    this.frames.push({ time: sourceTime, poses: same ? latest.poses : poses });
    if (this.frames.length > MAX_FRAMES) this.frames.shift();
    this.settled &&= same;
    return !this.settled;
  }

  /** Whether later placements differ from the last result. */
  get moving(): boolean {
    return !this.settled && this.frames.length > 0;
  }

  /** Set how fast source time passes; not 1 in replays only. */
  setRate(rate: number): void {
    if (rate === this.rate) return;
    this.rate = rate;
    const newest = this.frames.at(-1);
    this.begin();
    if (newest) this.frames.push(newest);
  }

  private begin(): void {
    this.frames.length = 0;
    this.skew = Number.POSITIVE_INFINITY;
    this.passedTime = Number.NEGATIVE_INFINITY;
  }

  /** Source time [ms] of the last result. */
  get shown(): number {
    return this.shownTime;
  }

  /** Return the placements again at the next call although nothing moved. */
  touch(): void {
    this.settled = false;
  }

  /** Return the positions of a frame up to the drawn time, each once, at any frame rate. */
  passed(name: string): readonly THREE.Vector3[] {
    const from = this.passedTime;
    this.passedTime = this.shownTime;
    return this.frames
      .filter((frame) => frame.time > from && frame.time <= this.shownTime)
      .flatMap((frame) => frame.poses.get(name)?.position ?? []);
  }

  /** Return placements at a time of the page's clock [ms]; null: unchanged. */
  at(time: number): ReadonlyMap<string, THREE.Matrix4> | null {
    const newest = this.frames.at(-1);
    if (!newest) return null;
    const displayTime = (time - this.skew - BEHIND_MS) * this.rate;
    this.shownTime = Math.min(displayTime, newest.time);
    if (this.settled) return null;
    const after = this.frames.find((frame) => frame.time >= displayTime) ?? newest;
    const before = this.frames[this.frames.indexOf(after) - 1] ?? after;
    const span = after.time - before.time;
    const share = span > 0 ? THREE.MathUtils.clamp((displayTime - before.time) / span, 0, 1) : 1;
    this.settled = before.poses === newest.poses || (after === newest && share === 1);
    for (const [name, end] of after.poses) {
      const start = before.poses.get(name) ?? end;
      const position = start.position.clone().lerp(end.position, share);
      const rotation = start.rotation.clone().slerp(end.rotation, share);
      const placement = this.placements.get(name) ?? new THREE.Matrix4();
      this.placements.set(name, placement.compose(position, rotation, ONE));
    }
    return this.placements;
  }
}

function alike(first: Keyed["poses"], second: Keyed["poses"]): boolean {
  if (first.size !== second.size) return false;
  for (const [name, { position: p, rotation: r }] of first) {
    const other = second.get(name);
    if (!other) return false;
    const { position: q, rotation: s } = other;
    const apart = [p.x - q.x, p.y - q.y, p.z - q.z, r.x - s.x, r.y - s.y, r.z - s.z, r.w - s.w];
    if (apart.some((value) => Math.abs(value) > SAME_PLACE)) return false;
  }
  return true;
}

const ONE = new THREE.Vector3(1, 1, 1);

/** Return poses in the site's frame, whatever frame each was given in. */
function inSite(message: FrameTransforms): Map<string, Pose> {
  const given = new Map(message.transforms.map((transform) => [transform.childFrameId, transform]));
  const poses = new Map<string, Pose>();
  const poseOf = (name: string, depth: number): Pose | null => {
    const known = poses.get(name);
    if (known) return known;
    const transform = given.get(name);
    if (!transform || depth > given.size) return null;
    const { translation: p, rotation: r } = transform;
    const own: Pose = {
      position: new THREE.Vector3(p?.x ?? 0, p?.y ?? 0, p?.z ?? 0),
      rotation: new THREE.Quaternion(r?.x ?? 0, r?.y ?? 0, r?.z ?? 0, r?.w ?? 1),
    };
    const parent = poseOf(transform.parentFrameId, depth + 1);
    if (parent) {
      own.position.applyQuaternion(parent.rotation).add(parent.position);
      own.rotation.premultiply(parent.rotation);
    }
    poses.set(name, own);
    return own;
  };
  for (const name of given.keys()) poseOf(name, 0);
  return poses;
}
