// Route of the page, read from the address's hash, and links to each page.

import { batch, signal } from "@preact/signals";
import type { RobotName } from "../../mesh/state/robot-name";
import { canBe, isReplay } from "../../mesh/state/robot-name";

/** The name of a recording's file and the site that has it. */
export interface RecordingName {
  site: string;
  file: string;
}

/** One view of a robot on the wall. */
export interface ViewName extends RobotName {
  view: string;
}

/** The page that the hash names, and what it shows. */
export type Route =
  | { page: "fleet" | "events" | "settings" }
  /** `#/<site>/<robot>`; a replay is a robot too. */
  | { page: "robot"; robot: RobotName }
  /** `#/program/<site>/<robot>`, then a text's SHA-256; null: `#/program`, which offers a choice of robots. */
  | { page: "program"; robot: RobotName | null; sha256: string }
  /** `#/cell/<site>/<robot>`: the fixtures and the floor around a robot. */
  | { page: "cell"; robot: RobotName }
  /** `#/define/<name>`; "": a new robot. */
  | { page: "define"; name: string }
  /** `#/recordings`, the list; then `/<site>/<file>` for one recording or two to compare. */
  | { page: "recordings"; recordings: readonly RecordingName[] }
  /** `#/wall`, one view of every robot; then `/<site>/<robot>/<view>` for each chosen view. */
  | { page: "wall"; views: readonly ViewName[] };

// The console closes the connection of a page that subscribes to an invalid key.
const VIEW = /^[A-Za-z0-9][\w.-]{0,62}$/;

// A site with the name of a page could not link to its robots.
function readRoute(): Route {
  const [, first = "", ...rest] = (location.hash.split("?")[0] ?? "").split("/").map(decoded);
  switch (first) {
    case "events":
    case "settings":
      return { page: first };
    case "define":
      return { page: "define", name: rest[0] ?? "" };
    case "recordings":
      return { page: "recordings", recordings: readRecordings(rest) };
    case "wall":
      return { page: "wall", views: readViews(rest) };
    case "program": {
      const robot = readRobot(rest);
      // A replay has no program: show its own page.
      return robot && isReplay(robot.robot)
        ? { page: "robot", robot }
        : { page: "program", robot, sha256: rest[2] ?? "" };
    }
    case "cell": {
      const robot = readRobot(rest);
      return robot ? { page: isReplay(robot.robot) ? "robot" : "cell", robot } : { page: "fleet" };
    }
    default: {
      const robot = readRobot([first, ...rest]);
      return robot ? { page: "robot", robot } : { page: "fleet" };
    }
  }
}

function readRobot([site, robot]: readonly string[]): RobotName | null {
  return site && robot ? { site, robot } : null;
}

function readRecordings(parts: readonly string[]): RecordingName[] {
  const recordings: RecordingName[] = [];
  for (const i of [0, 2]) {
    const [site, file] = parts.slice(i, i + 2);
    if (site && file) recordings.push({ site, file });
  }
  return recordings;
}

function readViews(parts: readonly string[]): ViewName[] {
  const views: ViewName[] = [];
  for (let i = 0; i + 2 < parts.length; i += 3) {
    const [site, robot, view] = parts.slice(i, i + 3);
    if (site && robot && view && VIEW.test(view) && canBe({ site, robot })) views.push({ site, robot, view });
  }
  return views;
}

/** Decode a part of the hash; return it unchanged if it is malformed. */
function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

function readQuery(): string {
  const at = location.hash.indexOf("?");
  return at < 0 ? "" : location.hash.slice(at + 1);
}

export const route = signal(readRoute());
/** The layout in the address, as text; empty: the default. */
export const layoutQuery = signal(readQuery());
addEventListener("hashchange", () => {
  // Together: a layout belongs to its robot.
  batch(() => {
    route.value = readRoute();
    layoutQuery.value = readQuery();
  });
});

/** Write a layout into the address, without a new entry in the browser's history. */
export function setLayoutQuery(text: string): void {
  const page = location.hash.split("?")[0] ?? "";
  history.replaceState(history.state, "", text ? `${page}?${text}` : page);
  layoutQuery.value = text;
}

/** Return the robot that a route shows, on its own page, its program's or its cell's. */
export function robotOf(shown: Route): RobotName | null {
  return shown.page === "robot" || shown.page === "program" || shown.page === "cell" ? shown.robot : null;
}

export function robotLink(site: string, robot: string): string {
  return link(site, robot);
}

/** Link to a robot's program; to the text of one that ran, by its SHA-256. */
export function programLink(site: string, robot: string, ...sha256: readonly string[]): string {
  return link("program", site, robot, ...sha256);
}

/** Link to what stands around a robot. */
export function cellLink(site: string, robot: string): string {
  return link("cell", site, robot);
}

/** Link to the list, to one recording, or to two to compare. */
export function recordingsLink(...shown: readonly RecordingName[]): string {
  return link("recordings", ...shown.flatMap(({ site, file }) => [site, file]));
}

/** Link to the wall with these views. */
export function wallLink(shown: readonly ViewName[]): string {
  return link("wall", ...shown.flatMap(({ site, robot, view }) => [site, robot, view]));
}

function link(...parts: readonly string[]): string {
  return ["#", ...parts.map(encodeURIComponent)].join("/");
}
