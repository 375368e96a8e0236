// Format of a recording's facts: size, times, losses, reason.

import type { Recording } from "../gen/robomesh_pb";
import { count, fixed, stampMs } from "./format";
import { recordingsText as r, viewText } from "./texts";

const RECORDED = "recorded-";
const UNITS = ["B", "kB", "MB", "GB", "TB"];

/** Format a size: 912 B, 4.3 MB. */
export function sizeText(bytes: number | bigint): string {
  let value = Number(bytes);
  let unit = 0;
  while (value >= 1000 && unit < UNITS.length - 1) [value, unit] = [value / 1000, unit + 1];
  return `${fixed(value, unit === 0 || value >= 100 ? 0 : 1)}\u202f${UNITS[unit] ?? ""}`;
}

export function startMs({ start }: Recording): number {
  return stampMs(start);
}

export function durationS({ duration }: Recording): number {
  return duration ? Number(duration.seconds) + duration.nanos / 1e9 : 0;
}

/** Format a time within a recording: 00:03.25, 1:02:03.00. */
export function momentText(seconds: number, decimals = 2): string {
  const hundredths = Math.round(Math.max(0, seconds) * 10 ** decimals);
  const whole = Math.floor(hundredths / 10 ** decimals);
  const pad = (value: number) => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  const text = [...(hours ? [String(hours)] : []), pad(Math.floor(whole / 60) % 60), pad(whole % 60)].join(":");
  return decimals ? `${text}.${String(hundredths % 10 ** decimals).padStart(decimals, "0")}` : text;
}

/** Return a channel's short name: robomesh/site/arm/events/renderer is events/renderer. */
export function topicOf(channel: string): string {
  const chunks = channel.split("/");
  return chunks[0] === "robomesh" && chunks.length > 3 ? chunks.slice(3).join("/") : channel;
}

/** Return the recorded robot; of a merged file, possibly several. */
export function robotsOf({ robot, mergedFrom }: Recording): string[] {
  return robot ? [robot] : [...new Set(mergedFrom.map((each) => each.robot))];
}

export function messagesOf({ topics }: Recording): bigint {
  return topics.reduce((sum, { messages }) => sum + messages, 0n);
}

/** Return whether the recording holds nothing to play. */
export function isEmpty(recording: Recording): boolean {
  return !recording.open && messagesOf(recording) === 0n;
}

/** Describe the losses; empty: none. */
export function lostText({ topics }: Recording): string {
  const lost = topics.filter((each) => each.lost > 0n);
  if (lost.length === 0) return "";
  return r("lost", {
    topics: lost.map((each) => r("lost_of", { count: count(each.lost), topic: topicOf(each.topic) })).join(", "),
  });
}

/** Return the operator or the rule that started it. */
export function startedText({ startedBy }: Recording): string {
  if (startedBy === "trace") return r("by_trace");
  if (startedBy === "flight" || startedBy === "flight recorder") return r("by_flight");
  return startedBy === "request" ? r("by_request") : startedBy;
}

/** Return the views with recorded video. */
export function recordedViews({ topics }: Recording): readonly string[] {
  return topics
    .map((each) => topicOf(each.topic))
    .filter((topic) => topic.startsWith("video/"))
    .map((topic) => topic.slice("video/".length));
}

/** Return the name under which a replay publishes a recorded view. */
export function recordedView(view: string): string {
  return RECORDED + view;
}

/** Return a replay's view in words. */
export function viewName(view: string): string {
  return view.startsWith(RECORDED)
    ? r("recorded_view", { view: viewText(view.slice(RECORDED.length)) })
    : viewText(view);
}

/** Return the console's address of a recording's file, or of a part of it. */
export function fileUrl(site: string, file: string, rest = ""): string {
  return `/recordings/${encodeURIComponent(site)}/${encodeURIComponent(file)}${rest}`;
}
