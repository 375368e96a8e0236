// Edits of a description that change several values. Each changes the copy that it receives.

import type { Body, Description, Joint, JointType, Pose, Triple, Units } from "./description";
import { BASE, linkName, metres, newJoint, radians, tidy, usualLimits } from "./description";

/** Return a free name: "joint3". */
export function unusedName(stem: string, taken: readonly string[]): string {
  for (let number = 1; ; number++) if (!taken.includes(`${stem}${number}`)) return `${stem}${number}`;
}

/** Return a valid name of a link or joint from a file's name. */
export function nameFromFile(path: string): string {
  const stem = path.replace(/^.*\//, "").replace(/\.[^.]*$/, "");
  return stem.replace(/[^A-Za-z0-9_.-]+/g, "_").replace(/^[^A-Za-z0-9]+/, "") || "link";
}

/** Insert a joint and its link into the chain, with a name by its place; return the joint. */
export function insertJoint(into: Description, at: number): Joint {
  const joint = { ...newJoint("", "rotary", into.units), numbered: true };
  into.joint.splice(at, 0, joint);
  renumber(into);
  return joint;
}

/** Remove a joint and its link, and all references to them. */
export function removeJoint(from: Description, at: number): void {
  const [gone] = from.joint.splice(at, 1);
  if (!gone) return;
  const link = linkName(gone);
  from.frame = from.frame.filter((frame) => frame.link !== link);
  from.collision.ignore = from.collision.ignore.filter((pair) => !pair.includes(link));
  for (const constraint of from.constraint) delete constraint.joints[gone.name];
  from.constraint = from.constraint.filter((constraint) => Object.keys(constraint.joints).length > 0);
  renumber(from);
}

export function moveJoint(of: Description, from: number, to: number): void {
  const [moved] = of.joint.splice(from, 1);
  if (moved) of.joint.splice(to, 0, moved);
  renumber(of);
}

/** Make a joint's link the base: each link before it, and the base, move on by one joint. */
export function makeBase(of: Description, at: number): void {
  const links = of.joint.map(({ link }) => link);
  const chosen = links[at];
  if (!chosen) return;
  const { name, ...body } = chosen;
  const { pose: place, ...base } = of.base;
  const moved = [{ ...base, name: baseLinkName(base, of) }, ...links.slice(0, at)];
  moved.forEach((link, index) => {
    const joint = of.joint[index];
    if (joint) joint.link = link;
  });
  of.base = { ...body, pose: place };
}

/** Return a name for the base's shape when it becomes a link's. */
function baseLinkName({ mesh }: Body, of: Description): string {
  if (!mesh) return "";
  const name = nameFromFile(mesh);
  const taken = [BASE, "tool", ...of.joint.flatMap((joint) => [joint.name, joint.link.name])];
  return taken.includes(name) ? unusedName(`${name}_`, taken) : name;
}

/** Name joints whose names the page gave by their places: "joint1", "joint2"; names that a user typed stay.
 *
 * @param reserved A name that another joint or link is about to get. */
export function renumber(of: Description, reserved = ""): void {
  const typed = [BASE, "tool", reserved];
  for (const { name, numbered, link } of of.joint) typed.push(...(numbered ? [link.name] : [name, link.name || name]));
  const joints = new Map<string, string>();
  const links = new Map<string, string>();
  of.joint.forEach((joint, index) => {
    if (!joint.numbered) return;
    const place = `joint${index + 1}`;
    const name = typed.includes(place) ? unusedName(`${place}_`, typed) : place;
    joints.set(joint.name, name);
    if (!joint.link.name) links.set(joint.name, name);
    joint.name = name;
  });
  // All at once: two joints may exchange their names.
  const newLink = (link: string) => links.get(link) ?? link;
  for (const frame of of.frame) frame.link = newLink(frame.link);
  of.collision.ignore = of.collision.ignore.map((pair) => pair.map(newLink) as [string, string]);
  for (const constraint of of.constraint) {
    constraint.joints = Object.fromEntries(
      Object.entries(constraint.joints).map(([key, factor]) => [joints.get(key) ?? key, factor]),
    );
  }
}

/** Change a joint's type; its limits are reset, because the unit differs. */
export function setType(of: Description, at: number, type: JointType): void {
  const joint = of.joint[at];
  if (joint) Object.assign(joint, { type, ...usualLimits(type, of.units), home: 0 });
}

/** Rename a joint; constraints and references to its link follow. */
export function renameJoint(of: Description, at: number, name: string): void {
  const joint = of.joint[at];
  if (!joint) return;
  joint.numbered = false;
  renumber(of, name);
  const [old, oldLink] = [joint.name, linkName(joint)];
  joint.name = name;
  linkRenamed(of, oldLink, linkName(joint));
  for (const constraint of of.constraint) {
    constraint.joints = Object.fromEntries(
      Object.entries(constraint.joints).map(([key, factor]) => [key === old ? name : key, factor]),
    );
  }
  renumber(of);
}

export function renameLink(of: Description, at: number, name: string): void {
  const joint = of.joint[at];
  if (!joint) return;
  renumber(of, name);
  const old = linkName(joint);
  joint.link.name = name === joint.name ? "" : name;
  linkRenamed(of, old, linkName(joint));
}

function linkRenamed(of: Description, old: string, name: string): void {
  for (const frame of of.frame) if (frame.link === old) frame.link = name;
  of.collision.ignore = of.collision.ignore.map(
    (pair) => pair.map((link) => (link === old ? name : link)) as [string, string],
  );
}

/** Convert the robot to other units. */
export function setUnits(of: Description, units: Units): void {
  const length = (value: number) => tidy((value * metres(of.units)) / metres(units));
  // With more digits of a radian than of a degree, 90° is 90° again after a change to radians and back.
  const digits = units.angle === "rad" ? 15 : 12;
  const angle = (value: number) => tidy((value * radians(of.units)) / radians(units), digits);
  const lengths = (values: Triple) => values.map(length) as Triple;
  const place = (pose: Pose) => {
    pose.xyz = lengths(pose.xyz);
    pose.rpy = pose.rpy.map(angle) as Triple;
  };
  const kinds = new Map(of.joint.map((joint) => [joint.name, joint.type]));
  for (const joint of of.joint) {
    const own = joint.type === "rotary" ? angle : length;
    joint.a = length(joint.a);
    joint.d = length(joint.d);
    joint.alpha = angle(joint.alpha);
    joint.theta = angle(joint.theta);
    joint.limits = [own(joint.limits[0]), own(joint.limits[1])];
    for (const key of ["max_speed", "max_acceleration", "max_jerk", "home"] as const) joint[key] = own(joint[key]);
    place(joint.link.mesh_pose);
  }
  for (const constraint of of.constraint) {
    const first = kinds.get(Object.keys(constraint.joints)[0] ?? "");
    const own = first === "prismatic" ? length : angle;
    constraint.limits = [own(constraint.limits[0]), own(constraint.limits[1])];
  }
  for (const pose of [of.base.mesh_pose, of.base.pose, of.tool, ...of.frame]) place(pose);
  for (const view of Object.values(of.view)) {
    view.eye = lengths(view.eye);
    view.target = lengths(view.target);
  }
  of.units = units;
}
