// Forward kinematics in the page: a description's URDF to placements of its links, thirty times a second.

import * as THREE from "three";

/** Placements of every link in the base frame at joint positions [rad] or [m], in the robot's order.
 *
 * The matrices are filled in again by the next call. */
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

/** How a robot's links move with its joints; a text that is no URDF places nothing. */
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
      origin: new THREE.Matrix4()
        .makeRotationFromEuler(new THREE.Euler(roll, pitch, yaw, "ZYX")) // about fixed x, then y, then z
        .setPosition(x, y, z),
      axis: new THREE.Vector3(...numbers("axis", "xyz", "1 0 0")).normalize(),
      mimic: leader
        ? { leader, multiplier: Number(read("mimic", "multiplier") || 1), offset: Number(read("mimic", "offset") || 0) }
        : null,
    };
  });
}

/** Joints in an order in which each link is placed before what hangs on it. */
function fromRoot(joints: readonly Joint[]): Joint[] {
  const byParent = Map.groupBy(joints, (joint) => joint.parent);
  const children = new Set(joints.map((joint) => joint.child));
  const ordered = joints.filter((joint) => !children.has(joint.parent));
  for (const joint of ordered) ordered.push(...(byParent.get(joint.child) ?? [])); // grows as it goes
  return ordered;
}
