// Where the page is: #/ is the fleet, #/<site>/<robot> a robot, #/define and #/define/<name> Define,
// #/program the choice of a robot, #/program/<site>/<robot> its program, #/recordings the recordings,
// #/recordings/<site>/<file> one of them, with /<site>/<file> behind it of another one that it is compared with,
// #/wall the wall, with /<site>/<robot>/<view> for each picture that was chosen, #/events and #/settings.

import { signal } from "@preact/signals";
import type { RobotName } from "../mesh/robot-name";
import { canBe } from "../mesh/robot-name";

// A site of such a name would have its robots' pages hidden behind these.
const DEFINE = "define";
const PROGRAM = "program";
const RECORDINGS = "recordings";
const WALL = "wall";
const PLAIN = ["events", "settings"] as const;

// The console closes the connection of a page that watches an impossible key.
const VIEW = /^[A-Za-z0-9][\w.-]{0,62}$/;

/** What a link says; one that was cut or mistyped says what stands there. */
function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

function readRobot(): RobotName | null {
  const [, first, ...rest] = location.hash.split("/");
  if (first === DEFINE || first === RECORDINGS || first === WALL || readPlain()) return null;
  const [site, robot] = first === PROGRAM ? rest : [first, ...rest];
  return site && robot ? { site: decoded(site), robot: decoded(robot) } : null;
}

/** A page that shows no one thing. */
export type PlainPage = (typeof PLAIN)[number];

function readPlain(): PlainPage | null {
  const first = location.hash.split("/")[1];
  return PLAIN.find((name) => name === first) ?? null;
}

function readDefined(): string | null {
  const [, page, name] = location.hash.split("/");
  return page === DEFINE ? decoded(name ?? "") : null;
}

function readsProgram(): boolean {
  return location.hash.split("/")[1] === PROGRAM;
}

/** A recording, by its file's name. */
export interface RecordingName {
  site: string;
  file: string;
}

function readRecordings(): readonly RecordingName[] | null {
  const [, page, ...rest] = location.hash.split("/").map(decoded);
  if (page !== RECORDINGS) return null;
  return [0, 2].flatMap((i) => (rest[i] && rest[i + 1] ? [{ site: rest[i], file: rest[i + 1] as string }] : []));
}

/** One picture of the wall. */
export interface ViewName extends RobotName {
  view: string;
}

function readWall(): readonly ViewName[] | null {
  const [, page, ...rest] = location.hash.split("/").map(decoded);
  if (page !== WALL) return null;
  const shown: ViewName[] = [];
  for (let i = 0; i + 2 < rest.length; i += 3) {
    const [site, robot, view] = rest.slice(i, i + 3);
    if (site && robot && view && VIEW.test(view) && canBe({ site, robot })) shown.push({ site, robot, view });
  }
  return shown;
}

/** The robot shown, on its own page or its program's; null: another page. */
export const route = signal<RobotName | null>(readRobot());
/** Whether Program is shown, of the robot or to choose one. */
export const programming = signal(readsProgram());
/** The robot that is being defined, "" a new one; null: another page. */
export const defined = signal<string | null>(readDefined());
/** The recordings that are played: one, two that are compared, none: the list; null: another page. */
export const recorded = signal(readRecordings());
/** What the wall shows, none: of every robot one view; null: another page. */
export const walled = signal(readWall());
/** Events or Settings; null: another page. */
export const plain = signal(readPlain());
addEventListener("hashchange", () => {
  route.value = readRobot();
  defined.value = readDefined();
  programming.value = readsProgram();
  recorded.value = readRecordings();
  walled.value = readWall();
  plain.value = readPlain();
});

export function robotLink(site: string, robot: string): string {
  return `#/${encodeURIComponent(site)}/${encodeURIComponent(robot)}`;
}

export function programLink(site: string, robot: string): string {
  return `#/${PROGRAM}/${encodeURIComponent(site)}/${encodeURIComponent(robot)}`;
}

/** Of the list, of one recording, or of two beside each other. */
export function recordingsLink(...shown: readonly RecordingName[]): string {
  return ["#", RECORDINGS, ...shown.flatMap(({ site, file }) => [site, file].map(encodeURIComponent))].join("/");
}

/** Of the wall with these pictures. */
export function wallLink(shown: readonly ViewName[]): string {
  return ["#", WALL, ...shown.flatMap(({ site, robot, view }) => [site, robot, view].map(encodeURIComponent))].join(
    "/",
  );
}
