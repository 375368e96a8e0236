// Choice of a robot's topics: for one at another site those that fit a slow link, unless the operator wants all.

import { signal } from "@preact/signals";
import { hello } from "../mesh/console/connection";
import { isReplay } from "../mesh/state/robot-name";

export const TOPIC_SELECTIONS = ["slow", "all"] as const;
export type TopicSelection = (typeof TOPIC_SELECTIONS)[number];

const requested = signal<ReadonlyMap<string, TopicSelection>>(new Map());

/** Return whether the robot is at another site than this console. */
export function isRemote(robotKey: string): boolean {
  const [, site, robot = ""] = robotKey.split("/");
  return hello.value !== null && hello.value.site !== site && !isReplay(robot);
}

export function topicSelection(robotKey: string): TopicSelection {
  return requested.value.get(robotKey) ?? (isRemote(robotKey) ? "slow" : "all");
}

export function selectTopics(robotKey: string, reach: TopicSelection): void {
  requested.value = new Map(requested.value).set(robotKey, reach);
}

/** Return the topic of the robot's joint states, whole or thinned. */
export function jointsTopic(robotKey: string): "joints" | "joints/slow" {
  return topicSelection(robotKey) === "slow" ? "joints/slow" : "joints";
}

/** Return the topic that supplies the 3-D view's placements. */
export function framesTopic(robotKey: string): "frames" | "joints/slow" {
  return topicSelection(robotKey) === "slow" ? "joints/slow" : "frames";
}
