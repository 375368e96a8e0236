// Where the page is: #/ is the fleet, #/<site>/<robot> a robot.

import { signal } from "@preact/signals";

export interface RobotName {
  site: string;
  robot: string;
}

function read(): RobotName | null {
  const [, site, robot] = location.hash.split("/");
  return site && robot ? { site: decodeURIComponent(site), robot: decodeURIComponent(robot) } : null;
}

/** The robot shown; null: the fleet. */
export const route = signal<RobotName | null>(read());
addEventListener("hashchange", () => (route.value = read()));

export function robotLink(site: string, robot: string): string {
  return `#/${encodeURIComponent(site)}/${encodeURIComponent(robot)}`;
}
