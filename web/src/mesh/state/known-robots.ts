// Robots known by presence or by their publications; without replays.

import { computed, signal } from "@preact/signals";
import { presence } from "../console/connection";
import { isReplay } from "./robot-name";

/** In the place of a service's name: presence of the operator in control. */
export const OPERATOR = "operator";

const publishing = signal<ReadonlySet<string>>(new Set());

/** Keys `robomesh/<site>/<robot>`, sorted. */
export const fleetRobots = computed<readonly string[]>(() => {
  const keys = new Set(publishing.value);
  for (const key of presence.value) {
    const [root, site, robot, , service] = key.split("/");
    if (robot !== "-" && service !== OPERATOR) keys.add(`${root}/${site}/${robot}`);
  }
  return [...keys].filter((key) => !isReplay(key.split("/")[2] ?? "")).sort();
});

/** Remember the robots in the keys of topics. */
export function addKnownRobots(topicKeys: Iterable<string>): void {
  const robots = [...topicKeys].map((key) => key.split("/").slice(0, 3).join("/"));
  if (robots.some((key) => !publishing.value.has(key))) publishing.value = new Set([...publishing.value, ...robots]);
}
