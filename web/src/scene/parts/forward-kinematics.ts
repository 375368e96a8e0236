// Forward kinematics for drawing: placements of links from a URDF, or from standard D-H rows.
// The kinematics service's answer counts; these are drawn thirty times a second.

import * as THREE from "three";

/** Function from joint positions [rad] or [m], in the robot's order, to placements of every link in the base frame.
 *
 * The next call overwrites the matrices. */
export type Forward = (positions: readonly number[]) => ReadonlyMap<string, THREE.Matrix4>;

interface Joint {
  name: string;
  type: string;
  parent: string;
  child: string;
  origin: THREE.Matrix4; // joint's frame in its parent's
  axis: THREE.Vector3;
  mimic: { leader: string; multiplier: number; offset: number } | null;
}

/** Return the forward kinematics of a robot; an invalid URDF has no placements. */
export function forwardOf(urdf: string, jointNames: readonly string[]): Forward {
  const joints = fromRoot(readJoints(urdf));
  const children = new Set(joints.map((joint) => joint.child));
  const placements = new Map(
    joints.flatMap((joint) => [joint.parent, joint.child]).map((link) => [link, new THREE.Matrix4()]),
  );
  const index = new Map(jointNames.map((name, i) => [name, i]));
  const motion = new THREE.Matrix4();
  return (positions) => {
    const positionOf = (name: string) => positions[index.get(name) ?? -1] ?? 0;
    for (const { name, type, parent, child, origin, axis, mimic } of joints) {
      const from = placements.get(parent);
      const to = placements.get(child);
      if (!from || !to) continue;
      if (!children.has(parent)) from.identity();
      const value = mimic ? mimic.multiplier * positionOf(mimic.leader) + mimic.offset : positionOf(name);
      to.multiplyMatrices(from, origin);
      if (type === "prismatic") to.multiply(motion.makeTranslation(axis.clone().multiplyScalar(value)));
      else if (type !== "fixed") to.multiply(motion.makeRotationAxis(axis, value));
    }
    return placements;
  };
}

function readJoints(urdf: string): Joint[] {
  const document = new DOMParser().parseFromString(urdf, "text/xml");
  return [...document.querySelectorAll("robot > joint")].map((element) => {
    const read = (child: string, attribute: string) => element.querySelector(child)?.getAttribute(attribute) ?? "";
    const numbers = (child: string, attribute: string, otherwise: string) =>
      (read(child, attribute) || otherwise).trim().split(/\s+/).map(Number);
    const [x = 0, y = 0, z = 0] = numbers("origin", "xyz", "0 0 0");
    const [roll = 0, pitch = 0, yaw = 0] = numbers("origin", "rpy", "0 0 0");
    const leader = read("mimic", "joint");
    return {
      name: element.getAttribute("name") ?? "",
      type: element.getAttribute("type") ?? "fixed",
      parent: read("parent", "link"),
      child: read("child", "link"),
      origin: transformOf([x, y, z], [roll, pitch, yaw]),
      axis: new THREE.Vector3(...numbers("axis", "xyz", "1 0 0")).normalize(),
      mimic: leader
        ? { leader, multiplier: Number(read("mimic", "multiplier") || 1), offset: Number(read("mimic", "offset") || 0) }
        : null,
    };
  });
}

/** Sort joints so that each link is placed before its children. */
function fromRoot(joints: readonly Joint[]): Joint[] {
  const byParent = Map.groupBy(joints, (joint) => joint.parent);
  const children = new Set(joints.map((joint) => joint.child));
  const ordered = joints.filter((joint) => !children.has(joint.parent));
  for (const joint of ordered) ordered.push(...(byParent.get(joint.child) ?? [])); // grows during the loop
  return ordered;
}

/** Return the transform `Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)`, in metres and radians. */
export function transformOf(xyz: Numbers3, [roll, pitch, yaw]: Numbers3): THREE.Matrix4 {
  return new THREE.Matrix4().makeRotationFromEuler(new THREE.Euler(roll, pitch, yaw, "ZYX")).setPosition(...xyz);
}
type Numbers3 = readonly [number, number, number];

/** A joint's D-H row at a position, in metres and radians. */
export interface DhRow {
  theta: number;
  d: number;
  a: number;
  alpha: number;
}

/** Return `Rot(z, theta) Trans(0, 0, d)`: from the joint's axis to the foot of the common normal. */
export function alongAxis({ theta, d }: DhRow): THREE.Matrix4 {
  return new THREE.Matrix4().makeRotationZ(theta).setPosition(0, 0, d);
}

/** Return `Trans(a, 0, 0) Rot(x, alpha)`: from the foot of the common normal to the link's frame. */
function alongNormal({ a, alpha }: DhRow): THREE.Matrix4 {
  return new THREE.Matrix4().makeRotationX(alpha).setPosition(a, 0, 0);
}

/** Return the placement of every link in the base frame [m], base first; `start` is the frame of the first row. */
export function linkPlacements(start: THREE.Matrix4, rows: readonly DhRow[]): THREE.Matrix4[] {
  const placements = [new THREE.Matrix4()];
  let previous = start;
  for (const row of rows) {
    previous = previous.clone().multiply(alongAxis(row)).multiply(alongNormal(row));
    placements.push(previous);
  }
  return placements;
}
