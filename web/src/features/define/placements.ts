// Where links are: the product of standard D-H rows, for drawing. The server's answer is what counts.

import { Euler, Matrix4, Quaternion, Vector3 } from "three";
import type { Description, Joint, Pose, Triple, Units } from "./description";
import { metres, radians, tidy } from "./description";

const UNIT_SCALE = new Vector3(1, 1, 1);

/** A joint's D-H row at a position, in metres and radians. */
export interface Row {
  theta: number;
  d: number;
  a: number;
  alpha: number;
}

export function rowAt(joint: Joint, position: number, units: Units): Row {
  const rotary = joint.type === "rotary";
  return {
    theta: (joint.theta + (rotary ? position : 0)) * radians(units),
    d: (joint.d + (rotary ? 0 : position)) * metres(units),
    a: joint.a * metres(units),
    alpha: joint.alpha * radians(units),
  };
}

/** `Rot(z, theta) Trans(0, 0, d)`: from the joint's axis to the foot of the common normal. */
export function alongAxis({ theta, d }: Row): Matrix4 {
  return new Matrix4().makeRotationZ(theta).setPosition(0, 0, d);
}

/** `Trans(a, 0, 0) Rot(x, alpha)`: from there to the link's frame. */
export function alongNormal({ a, alpha }: Row): Matrix4 {
  return new Matrix4().makeRotationX(alpha).setPosition(a, 0, 0);
}

/** Placement of every link in the base frame [m], base first; `start` is the frame in which the rows begin. */
export function linkPlacements(start: Matrix4, rows: readonly Row[]): Matrix4[] {
  const placements = [new Matrix4()];
  let previous = start;
  for (const row of rows) {
    previous = previous.clone().multiply(alongAxis(row)).multiply(alongNormal(row));
    placements.push(previous);
  }
  return placements;
}

/** `Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)` in metres. */
export function poseMatrix(pose: Pose, units: Units): Matrix4 {
  const [x, y, z] = pose.xyz.map((value) => value * metres(units)) as Triple;
  const [roll, pitch, yaw] = pose.rpy.map((value) => value * radians(units)) as Triple;
  const turn = new Quaternion().setFromEuler(new Euler(roll, pitch, yaw, "ZYX"));
  return new Matrix4().compose(new Vector3(x, y, z), turn, UNIT_SCALE);
}

/** The pose of a placement, as finely as one would type it: micrometres and thousandths of a degree. */
export function poseOf(placement: Matrix4, units: Units): Pose {
  const at = new Vector3();
  const turn = new Quaternion();
  placement.decompose(at, turn, new Vector3());
  const { x: roll, y: pitch, z: yaw } = new Euler().setFromQuaternion(turn, "ZYX");
  const degrees = (angle: number) =>
    tidy(((Math.round((angle * 180e3) / Math.PI) / 1e3) * Math.PI) / 180 / radians(units));
  const length = (value: number) => tidy(Math.round(value * 1e6) / 1e6 / metres(units));
  return {
    xyz: [length(at.x), length(at.y), length(at.z)],
    rpy: [degrees(roll), degrees(pitch), degrees(yaw)],
  };
}

/** How far from the base's origin the tool can come [m]: an upper bound. */
export function reach(of: Description): number {
  const one = metres(of.units);
  let total = Math.hypot(...of.base.pose.xyz) + Math.hypot(...of.tool.xyz);
  for (const { a, d, type, limits } of of.joint) {
    total += Math.hypot(a, d) + (type === "prismatic" ? Math.max(Math.abs(limits[0]), Math.abs(limits[1])) : 0);
  }
  return total * one;
}
