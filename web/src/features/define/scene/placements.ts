// Conversions between a draft's units and the metres and radians of its drawing.

import { Euler, type Matrix4, Quaternion, Vector3 } from "three";
import { type DhRow, transformOf } from "../../../scene/parts/forward-kinematics";
import type { Description, Joint, Pose, Triple, Units } from "../description/description";
import { metres, radians, tidy } from "../description/description";

export function rowAt(joint: Joint, position: number, units: Units): DhRow {
  const rotary = joint.type === "rotary";
  return {
    theta: (joint.theta + (rotary ? position : 0)) * radians(units),
    d: (joint.d + (rotary ? 0 : position)) * metres(units),
    a: joint.a * metres(units),
    alpha: joint.alpha * radians(units),
  };
}

/** Return `Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)` in metres. */
export function poseMatrix(pose: Pose, units: Units): Matrix4 {
  const [x, y, z] = pose.xyz.map((value) => value * metres(units)) as Triple;
  const [roll, pitch, yaw] = pose.rpy.map((value) => value * radians(units)) as Triple;
  return transformOf([x, y, z], [roll, pitch, yaw]);
}

/** Return a placement's pose, rounded to micrometres and thousandths of a degree. */
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

/** Return an upper bound of the tool's distance from the base's origin [m]. */
export function reach(of: Description): number {
  const one = metres(of.units);
  let total = Math.hypot(...of.base.pose.xyz) + Math.hypot(...of.tool.xyz);
  for (const { a, d, type, limits } of of.joint) {
    total += Math.hypot(a, d) + (type === "prismatic" ? Math.max(Math.abs(limits[0]), Math.abs(limits[1])) : 0);
  }
  return total * one;
}
