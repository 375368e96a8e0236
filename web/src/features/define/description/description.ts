// A robot's description in Define: all values of robot.toml, in the file's own units.

export type Triple = [number, number, number];
export type Range = [number, number];
export type JointType = "rotary" | "prismatic";

export interface Pose {
  xyz: Triple;
  rpy: Triple;
}

/** Appearance of a link; an empty mesh or colour: none. */
export interface Body {
  mesh: string;
  /** The shape for collision checks; empty: the mesh. */
  collision_mesh: string;
  mesh_scale: number;
  mesh_pose: Pose;
  color: string;
}

export interface Joint {
  name: string;
  /** Whether the page gave the name, by the joint's place; it is never saved. */
  numbered: boolean;
  /** For people, in English and Chinese; empty: the name. */
  title: string;
  title_zh: string;
  type: JointType;
  a: number;
  alpha: number;
  d: number;
  theta: number;
  limits: Range;
  max_speed: number;
  max_acceleration: number;
  max_jerk: number;
  home: number;
  /** Empty: the joint's name. */
  link: Body & { name: string };
}

export interface NamedFrame extends Pose {
  name: string;
  link: string;
}

export interface Constraint {
  joints: Record<string, number>;
  limits: Range;
}

export interface View {
  eye: Triple;
  target: Triple;
  up: Triple;
  projection: "orthographic" | "perspective";
}

export interface Units {
  length: "mm" | "m";
  angle: "deg" | "rad";
}

export interface Description {
  name: string;
  title: string;
  title_zh: string;
  provenance: string;
  provenance_zh: string;
  units: Units;
  /** Its pose is the first row's frame, in the base link's. */
  base: Body & { pose: Pose };
  joint: Joint[];
  tool: Pose;
  frame: NamedFrame[];
  constraint: Constraint[];
  view: Record<string, View>;
  collision: { ignore: [string, string][] };
}

/** The server's form: every key is optional, as in the file. */
export type Partly<T> = T extends readonly unknown[] ? T : T extends object ? { [K in keyof T]?: Partly<T[K]> } : T;
export type GivenDescription = Omit<Partly<Description>, "joint" | "frame" | "view"> & {
  joint?: Partly<Joint>[];
  frame?: Partly<NamedFrame>[];
  view?: Record<string, Partly<View>>;
};

export const BASE = "base";
const ORIGIN: Triple = [0, 0, 0];

function pose(given: Partly<Pose> | undefined): Pose {
  return { xyz: [...(given?.xyz ?? ORIGIN)], rpy: [...(given?.rpy ?? ORIGIN)] };
}

function body(given: Partly<Body> | undefined): Body {
  return {
    mesh: given?.mesh ?? "",
    collision_mesh: given?.collision_mesh ?? "",
    mesh_scale: given?.mesh_scale ?? 0.001,
    mesh_pose: pose(given?.mesh_pose),
    color: given?.color ?? "",
  };
}

/** Return a description with every key that its file omits. */
export function complete(given: GivenDescription): Description {
  const units: Units = { length: "mm", angle: "deg", ...given.units };
  return {
    name: given.name ?? "",
    title: given.title ?? "",
    title_zh: given.title_zh ?? "",
    provenance: given.provenance ?? "",
    provenance_zh: given.provenance_zh ?? "",
    units,
    base: { ...body(given.base), pose: pose(given.base?.pose) },
    joint: (given.joint ?? []).map((row) => ({
      ...newJoint(row.name ?? "", row.type ?? "rotary", units),
      ...row,
      link: { ...body(row.link), name: row.link?.name ?? "" },
    })) as Joint[],
    tool: pose(given.tool),
    frame: (given.frame ?? []).map((row) => ({ ...pose(row), name: row.name ?? "", link: row.link ?? BASE })),
    constraint: structuredClone((given.constraint ?? []) as Constraint[]),
    view: Object.fromEntries(
      Object.entries(given.view ?? {}).map(([name, view]) => [
        name,
        { eye: [1, 0, 0], target: ORIGIN, up: [0, 0, 1], projection: "perspective", ...view } as View,
      ]),
    ),
    collision: { ignore: structuredClone((given.collision?.ignore ?? []) as [string, string][]) },
  };
}

/** Return a description without defaults, to check and save. */
export function concise(from: Description): object {
  const isZero = (at: Pose) => [...at.xyz, ...at.rpy].every((value) => value === 0);
  const shape = (of: Body) => ({
    ...(of.mesh && { mesh: of.mesh }),
    ...(of.collision_mesh && { collision_mesh: of.collision_mesh }),
    ...((of.mesh || of.collision_mesh) && { mesh_scale: of.mesh_scale }),
    ...((of.mesh || of.collision_mesh) && !isZero(of.mesh_pose) && { mesh_pose: of.mesh_pose }),
    ...(of.color && { color: of.color }),
  });
  return {
    name: from.name,
    ...(from.title && { title: from.title }),
    ...(from.title_zh && { title_zh: from.title_zh }),
    ...(from.provenance && { provenance: from.provenance }),
    ...(from.provenance_zh && { provenance_zh: from.provenance_zh }),
    units: from.units,
    base: { ...shape(from.base), ...(!isZero(from.base.pose) && { pose: from.base.pose }) },
    joint: from.joint.map(({ name, numbered: _, title, title_zh, ...row }) => ({
      name,
      ...(title && { title }),
      ...(title_zh && { title_zh }),
      ...row,
      link: { ...(row.link.name && { name: row.link.name }), ...shape(row.link) },
    })),
    tool: from.tool,
    ...(from.frame.length && { frame: from.frame }),
    ...(from.constraint.length && { constraint: from.constraint }),
    ...(Object.keys(from.view).length && { view: from.view }),
    ...(from.collision.ignore.length && { collision: from.collision }),
  };
}

/** Return a description with only a provisional name. */
export function empty(): Description {
  return complete({ name: "my-arm" });
}

/** Metres in the description's unit of length. */
export function metres(units: Units): number {
  return units.length === "mm" ? 0.001 : 1;
}

/** Radians in the description's unit of angle. */
export function radians(units: Units): number {
  return units.angle === "deg" ? Math.PI / 180 : 1;
}

/** Return the symbol of a joint's unit, an angle or a length. */
export function jointUnit(type: JointType, units: Units): string {
  return type === "rotary" ? angleUnit(units) : units.length;
}

export function angleUnit(units: Units): string {
  return units.angle === "deg" ? "°" : "rad";
}

export function linkName(joint: Joint): string {
  return joint.link.name || joint.name;
}

/** Return the names of the links, base first. */
export function linkNames(of: Description): string[] {
  return [BASE, ...of.joint.map(linkName)];
}

/** Return the appearance of each link, base first. */
export function bodies(of: Description): Body[] {
  return [of.base, ...of.joint.map((joint) => joint.link)];
}

// Typical values of a joint in degrees or millimetres, so that only differences need typing.
const USUAL = {
  rotary: { limits: [-180, 180], max_speed: 90, max_acceleration: 360, max_jerk: 3600 },
  prismatic: { limits: [0, 500], max_speed: 250, max_acceleration: 1000, max_jerk: 10000 },
} as const;

/** Return a joint with zero D-H parameters and typical limits. */
export function newJoint(name: string, type: JointType, units: Units): Joint {
  return {
    name,
    numbered: false,
    title: "",
    title_zh: "",
    type,
    a: 0,
    alpha: 0,
    d: 0,
    theta: 0,
    ...usualLimits(type, units),
    home: 0,
    link: { ...body(undefined), name: "" },
  };
}

export function usualLimits(type: JointType, units: Units) {
  const usual = USUAL[type];
  const one = type === "rotary" ? radians(units) / (Math.PI / 180) : metres(units) / 0.001;
  const scaled = (value: number) => tidy(value * one);
  return {
    limits: usual.limits.map(scaled) as Range,
    max_speed: scaled(usual.max_speed),
    max_acceleration: scaled(usual.max_acceleration),
    max_jerk: scaled(usual.max_jerk),
  };
}

/** Round off the last digits, which are artefacts of binary fractions. */
export function tidy(value: number, digits = 12): number {
  return Number(value.toPrecision(digits)) || 0; // and no minus zero
}
