// Format of numbers, times and ages: degrees and millimetres, fixed decimals, a true minus sign.

import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { Description, Description_Joint } from "../gen/robomesh_pb";
import { Description_Joint_Type } from "../gen/robomesh_pb";
import { language, t } from "./texts";

const DEGREES = 180 / Math.PI;
const UPRIGHT = 1e-6; // the cosine of a pitch so close to 90 degrees is noise
export const DASH = "–";

/** Format a number with fixed decimals and a figure-wide minus. */
export function fixed(value: number | undefined, decimals: number): string {
  if (value === undefined || !Number.isFinite(value)) return DASH;
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Format a whole number with thousands separators: 4,312. */
export function count(value: number | bigint): string {
  return value.toLocaleString("en-GB");
}

export const toDegrees = (radians: number): number => radians * DEGREES;
export const toRadians = (degrees: number): number => degrees / DEGREES;

/** Return how a joint's values are shown: unit, decimals, and the factor from SI. */
export interface JointUnit {
  unit: string;
  decimals: number;
  factor: number;
}

export function jointUnit(joint: Description_Joint): JointUnit {
  switch (joint.type) {
    case Description_Joint_Type.PRISMATIC:
      return { unit: "mm", decimals: 1, factor: 1000 };
    case Description_Joint_Type.ROTARY:
    case Description_Joint_Type.TYPE_UNSPECIFIED:
      return { unit: "°", decimals: 2, factor: DEGREES };
    default: // of a newer program: as it was sent
      return { unit: "", decimals: 4, factor: 1 };
  }
}

/** Return a joint's title in the page's language; its name is the identifier. */
export function jointTitle({ name, title, titleZh }: Description_Joint): string {
  return (language.value === "zh" && titleZh) || title || name;
}

/** Return a robot's title and the source of its dimensions, in the page's language. */
export function robotTitle({ title, titleZh }: Description): string {
  return (language.value === "zh" && titleZh) || title;
}

export function provenanceText({ provenance, provenanceZh }: Description): string {
  return (language.value === "zh" && provenanceZh) || provenance;
}

export function jointText(joint: Description_Joint, value: number | undefined): string {
  const { unit, decimals, factor } = jointUnit(joint);
  const space = unit === "°" ? "" : "\u202f";
  return `${fixed(value === undefined ? undefined : value * factor, decimals)}${space}${unit}`;
}

/** Format an age in s: 3 s, 4 min, 2 h. */
export function ageText(seconds: number): string {
  if (seconds < 100) return `${Math.floor(seconds)}\u202fs`;
  if (seconds < 6000) return `${Math.floor(seconds / 60)}\u202fmin`;
  return `${Math.floor(seconds / 3600)}\u202fh`;
}

export function staleText(age: number | null): string {
  return age === null ? t("stale_unknown") : t("stale_for", { age: ageText(age) });
}

/** Format a duration like a clock: 00:12, 61:03. */
export function clock(seconds: number): string {
  const whole = Math.floor(seconds);
  return [Math.floor(whole / 60), whole % 60].map((part) => String(part).padStart(2, "0")).join(":");
}

/** Return the local time of day, to the second, where a title or heading has the zone. */
export function timeOfDay(ms: number): string {
  return new Date(ms).toLocaleTimeString("en-GB", { hour12: false });
}

/** Return the local date: 2026-11-21. */
export function dateOf(ms: number): string {
  const date = new Date(ms);
  const pad = (value: number) => String(value).padStart(2, "0");
  return [date.getFullYear(), pad(date.getMonth() + 1), pad(date.getDate())].join("-");
}

/** Return the zone at a time: +08:00. */
export function zoneOf(ms: number): string {
  const minutes = -new Date(ms).getTimezoneOffset();
  return (minutes < 0 ? "-" : "+") + clock(Math.abs(minutes));
}

/** Return a local time as in the terminal and in pictures: 2026-11-29 14:02:11+08:00; 0 is not known.
 *
 * @param exact - with milliseconds. */
export function timeText(ms: number, exact = false): string {
  const at = new Date(ms || Number.NaN);
  if (Number.isNaN(at.getTime())) return DASH;
  const fraction = exact ? `.${String(at.getMilliseconds()).padStart(3, "0")}` : "";
  return `${dateOf(ms)} ${timeOfDay(ms)}${fraction}${zoneOf(ms)}`;
}

/** Return a local time for a sentence, with its zone; without its date on the same day as `now`. */
export function whenText(ms: number, now = Date.now()): string {
  return dateOf(ms) === dateOf(now) ? timeText(ms).slice("2026-11-29 ".length) : timeText(ms);
}

/** Return a time stamp [ms since the Unix epoch]; 0: not known. */
export function stampMs(stamp: Timestamp | undefined): number {
  return stamp ? timestampMs(stamp) : 0;
}

export function stampTime(stamp: Timestamp | undefined): string {
  return stamp ? timeOfDay(timestampMs(stamp)) : DASH;
}

export function stampWhen(stamp: Timestamp | undefined): string {
  return stamp ? whenText(timestampMs(stamp)) : DASH;
}

export function stampFull(stamp: Timestamp | undefined): string {
  return stamp ? timeText(timestampMs(stamp)) : "";
}

/** Return roll, pitch, yaw [rad] (about fixed x, y, z) of a 4x4 placement, by rows.
 *
 * At a pitch of ±90 degrees only the sum of roll and yaw is defined: yaw is 0. */
export function rollPitchYaw(m: readonly number[]): [number, number, number] {
  const [r11 = 1, , , , r21 = 0, r22 = 1, r23 = 0, , r31 = 0, r32 = 0, r33 = 1] = m;
  const level = Math.hypot(r11, r21);
  const pitch = Math.atan2(-r31, level);
  if (level < UPRIGHT) return [Math.atan2(-r23, r22), pitch, 0];
  return [Math.atan2(r32, r33), pitch, Math.atan2(r21, r11)];
}
