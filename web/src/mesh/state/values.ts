// Numbers in messages by name, as the recorder names them: "joints/waist/position", "signals/payload.mass", ...

import type { DescMessage, Message } from "@bufbuild/protobuf";
import { createRegistry, fromBinary, ScalarType } from "@bufbuild/protobuf";
import type { ReflectMessage } from "@bufbuild/protobuf/reflect";
import { reflect } from "@bufbuild/protobuf/reflect";
import { FeatureSet_FieldPresence as Presence } from "@bufbuild/protobuf/wkt";
import { file_foxglove_JointStates, type JointStates } from "../../gen/foxglove/JointStates_pb";
import type { Description, KinematicState, Signals } from "../../gen/robomesh_pb";
import { file_robomesh, Description_Joint_Type as JointType } from "../../gen/robomesh_pb";
import { rollPitchYaw } from "../../i18n/format";
import { hello } from "../console/connection";

type Take = (name: string, value: number) => void;

const REGISTRY = createRegistry(file_robomesh, file_foxglove_JointStates);
const TIMES = new Set(["google.protobuf.Timestamp", "google.protobuf.Duration"]);
const DEEPEST = 6;
const JOINT_NUMBERS = ["position", "velocity", "acceleration", "effort"] as const;
const RATES: Record<string, string> = { position: "", velocity: "/s", acceleration: "/s²" };
const ANGLES = ["roll", "pitch", "yaw"] as const;
const MARGIN = "kinematics/margin/";
const SIGNALS = "signals";
// Only the messages have the units of signals. A name means the same for every robot, and is kept with its last unit.
const signalUnits = new Map<string, string>();
const MOST_UNITS = 5000;
const ENDINGS = [
  ["_s", "s"],
  ["_m", "m"],
  ["_hz", "Hz"],
  ["_percent", "%"],
  ["bytes", "B"],
] as const;

/** Return the topics of a robot that have numbers. */
export function topicsOfValues(): readonly string[] {
  return hello.value?.values.map(({ topic }) => topic) ?? [];
}

/** Return the topic of a value; null: none of these. */
export function topicOf(name: string, topics: readonly string[]): string | null {
  return (
    topics
      .filter((topic) => name.startsWith(`${topic}/`))
      .sort((a, b) => b.length - a.length)
      .at(0) ?? null
  );
}

/** Return a function that calls `take` with each number of a topic's message; null: the topic has none. */
export function readerOf(topic: string): ((payload: Uint8Array, take: Take) => void) | null {
  const name = hello.value?.values.find((each) => each.topic === topic)?.schema ?? "";
  const schema = REGISTRY.getMessage(name);
  if (!schema) return null;
  return (payload, take) =>
    valuesOf(schema, fromBinary(schema, payload), (own, value) => take(`${topic}/${own}`, value));
}

/** Call `take` with each number of a message and its name below the topic. */
export function valuesOf(schema: DescMessage, message: Message, take: Take): void {
  if (schema.typeName === "foxglove.JointStates") {
    for (const joint of (message as JointStates).joints)
      for (const name of JOINT_NUMBERS) {
        const value = joint[name];
        if (value !== undefined) take(`${joint.name}/${name}`, value);
      }
  } else if (schema.typeName === "robomesh.KinematicState") kinematics(message as KinematicState, take);
  else if (schema.typeName === "robomesh.Signals") signals(message as Signals, take);
  else fields(reflect(schema, message), "", DEEPEST, take);
}

function kinematics(message: KinematicState, take: Take): void {
  const { toolToBase: pose, linearVelocity: v } = message;
  if (pose.length === 16) {
    for (const [i, axis] of ["x", "y", "z"].entries()) take(`tool/${axis}`, pose[4 * i + 3] ?? 0);
    const angles = rollPitchYaw(pose);
    for (const [i, angle] of ANGLES.entries()) take(`tool/${angle}`, angles[i] ?? 0);
  }
  if (v) take("tool/speed", Math.hypot(v.x, v.y, v.z));
  if (message.manipulability !== undefined) take("manipulability", message.manipulability);
  if (message.singularityMargin !== undefined) take("singularity_margin", message.singularityMargin);
  if (message.clearance) take("clearance", message.clearance.distance);
  if (message.ownClearance) take("own_clearance", message.ownClearance.distance);
  for (const { name, lower, upper } of message.limitMargins) take(`margin/${name}`, Math.min(lower, upper));
}

function signals(message: Signals, take: Take): void {
  for (const { name, unit, value } of message.signals) {
    if (unit) learnUnit(`${SIGNALS}/${name}`, unit);
    if (value.case === "number") take(name, value.value);
    else if (value.case === "on") take(name, Number(value.value));
  }
}

/** Keep the unit of a signal, as a message or a recording has it. */
export function learnUnit(name: string, unit: string): void {
  if (unit && name.startsWith(`${SIGNALS}/`) && (signalUnits.has(name) || signalUnits.size < MOST_UNITS))
    signalUnits.set(name, unit);
}

function fields(message: ReflectMessage, prefix: string, deepest: number, take: Take): void {
  for (const field of message.fields) {
    const name = prefix + field.name;
    const present = field.presence === Presence.IMPLICIT || message.isSet(field);
    if (field.fieldKind === "enum" || (field.fieldKind === "scalar" && isNumber(field.scalar))) {
      if (present) take(name, Number(message.get(field)));
    } else if (field.fieldKind === "message") {
      if (deepest && message.isSet(field) && !TIMES.has(field.message.typeName))
        fields(message.get(field), `${name}/`, deepest - 1, take);
    } else if (field.fieldKind === "list") {
      const { listKind } = field;
      if (listKind === "message") {
        if (!deepest || TIMES.has(field.message.typeName)) continue;
        for (const [i, child] of [...message.get(field)].entries()) {
          const own = (child as ReflectMessage).message as Message & { name?: string };
          fields(child as ReflectMessage, `${name}/${own.name || i}/`, deepest - 1, take);
        }
      } else if (listKind === "enum" || isNumber(field.scalar)) {
        for (const [i, value] of [...message.get(field)].entries()) take(`${name}/${i}`, Number(value));
      }
    }
  }
}

function isNumber(scalar: ScalarType): boolean {
  return scalar !== ScalarType.STRING && scalar !== ScalarType.BYTES;
}

/** Return the unit of a value by its name; empty: no unit, or unknown. */
export function unitOf(name: string, description: Description | undefined): string {
  const [first = "", ...rest] = name.split("/");
  if (first === SIGNALS) return signalUnits.get(name) ?? "";
  const last = rest.pop() ?? first;
  const slides = (joint: string) =>
    description?.joints.some(({ name: own, type }) => own === joint && type === JointType.PRISMATIC) ?? false;
  if (first === "joints") {
    const length = slides(rest.join("/"));
    if (last === "effort") return length ? "N" : "N·m";
    const rate = RATES[last];
    return rate === undefined ? "" : (length ? "m" : "rad") + rate;
  }
  if (first === "kinematics") {
    if (name.startsWith("kinematics/tool/"))
      return (ANGLES as readonly string[]).includes(last) ? "rad" : last.length === 1 ? "m" : "m/s";
    if (name.startsWith(MARGIN)) return slides(name.slice(MARGIN.length)) ? "m" : "rad";
    return last.includes("clearance") ? "m" : "";
  }
  return ENDINGS.find(([ending]) => last.endsWith(ending))?.[1] ?? "";
}
