// Define's requests to the console's server.

import { t } from "../../i18n/texts";
import type { GivenDescription } from "./description";
import { concise } from "./description";
import type { Draft } from "./draft";
import { identity } from "./draft";
import { keptFile } from "./kept-files";

export interface Problem {
  path: (string | number)[];
  text: string;
}

export interface KnownRobot {
  name: string;
  title: string;
  origin: "library" | "site";
  joints: number;
  running: boolean;
}

export interface Robots {
  robots: KnownRobot[];
  can_start: boolean;
  folder: string;
}

export interface Loaded {
  description: GivenDescription;
  files: Record<string, string>;
  notes: string[];
}

/** A robot as the site has it. */
export interface Opened extends Loaded {
  /** Of all that is in its folder: another one, once that is changed. */
  revision: string;
}

export interface MeshInfo {
  glb: string;
  triangles: number;
  min: [number, number, number];
  max: [number, number, number];
  materials: string[];
  warnings: string[];
  missing: string[];
  /** Metres in the file's unit, guessed. */
  scale: number;
  up: "y" | "z";
  /** Why these are guessed, in words. */
  guess: string;
}

export interface Checked {
  problems: Problem[];
  /** 4x4 by rows, metres; null where the description has problems. */
  tool: number[][] | null;
  links: Record<string, number[][]>;
}

/** Why a pair of links is ignored (the first three), or as what it is checked: robots/collision/verdicts.py. */
export type PairKind =
  | "adjacent"
  | "description"
  | "always"
  | "apart"
  | "false_contacts"
  | "too_large"
  | "collision_meshes"
  | "visual_meshes"
  | "touching"
  | "no_surface"
  | "not_studied";

export interface Pair {
  links: [string, string];
  kind: PairKind;
  /** What the reason names: positions, percent, triangles, seconds, gigabytes. */
  values: Readonly<Record<string, number>>;
}

/** A request that was refused, or not answered; the text is for people. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    text: string,
    readonly problems: Problem[] = [],
    /** What would be saved over was changed since it was opened. */
    readonly isChanged = false,
  ) {
    super(text);
  }
}

async function send(path: string, init?: RequestInit): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(`/define${path}`, init);
  } catch (error) {
    if (init?.signal?.aborted) throw error;
    throw new Refused(0, t("not_connected"));
  }
  if (answer.ok) return answer;
  const text = await answer.text();
  let problems: Problem[] = [];
  let words = text;
  let changed = false;
  try {
    const said = JSON.parse(text) as { problems?: Problem[]; text?: string; changed?: boolean };
    problems = said.problems ?? [];
    changed = said.changed ?? false;
    words = said.text ?? problems.map((problem) => problem.text).join("; ");
  } catch {
    // it is text already
  }
  throw new Refused(answer.status, words || `HTTP ${answer.status}`, problems, changed);
}

function post(path: string, body: unknown, signal?: AbortSignal): Promise<Response> {
  return send(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    ...(signal && { signal }),
  });
}

async function json<T>(answer: Promise<Response>): Promise<T> {
  return (await (await answer).json()) as T;
}

// "Gone": the server's store has made room for other files.
const FORGOTTEN = 410;

/** Asks with a draft's files; where the server has forgotten some, sends again what is kept here, and asks again. */
async function withFiles(files: Readonly<Record<string, string>>, asked: () => Promise<Response>): Promise<Response> {
  try {
    return await asked();
  } catch (error) {
    if (!(error instanceof Refused) || error.status !== FORGOTTEN) throw error;
    // A saved robot's own files are put back by opening it.
    const { owner } = identity.value;
    let sent = owner
      ? await robot(owner).then(
          () => 1,
          () => 0,
        )
      : 0;
    for (const [path, sha] of Object.entries(files)) {
      const bytes = await keptFile(sha);
      if (bytes) sent += Number((await upload(path, bytes)).sha === sha);
    }
    if (!sent) throw error;
    return asked();
  }
}

export const robots = () => json<Robots>(send("/robots"));

export const robot = (name: string) => json<Opened>(send(`/robots/${encodeURIComponent(name)}`));

export function upload(name: string, bytes: Blob): Promise<{ sha: string; size: number }> {
  return json(send(`/files?name=${encodeURIComponent(name)}`, { method: "POST", body: bytes }));
}

export function mesh(file: string, files: Readonly<Record<string, string>>): Promise<MeshInfo> {
  return json(withFiles(files, () => post("/mesh", { file, files })));
}

export async function glb(sha: string): Promise<ArrayBuffer> {
  return (await send(`/glb/${sha}`)).arrayBuffer();
}

function body(of: Draft): { description: object; files: Record<string, string> } {
  return { description: concise(of.description), files: of.files };
}

export function check(of: Draft, joints: readonly number[] | null, signal: AbortSignal): Promise<Checked> {
  return json(withFiles(of.files, () => post("/check", { ...body(of), joints }, signal)));
}

/** How each pair is checked; those that the draft ignores are judged like all others. */
export function collisions(of: Draft): Promise<{ pairs: Pair[] }> {
  return json(withFiles(of.files, () => post("/collisions", body(of))));
}

/** A URDF, an OpenHRP VRML file or a robot.toml as a draft. */
export function importRobot(
  file: string,
  files: Readonly<Record<string, string>>,
): Promise<Loaded & { missing: string[] }> {
  return json(post("/import", { file, files }));
}

/** The files of a zip archive, SHA-256 by path. */
export async function unzip(file: string, sha: string): Promise<Record<string, string>> {
  const answer = await json<{ files: Record<string, string> }>(post("/unzip", { file, files: { [file]: sha } }));
  return answer.files;
}

/** @param revision Of the robot that it is saved over without a question; "": of none. */
export function save(
  of: Draft,
  revision: string,
  overwrite: boolean,
): Promise<{ name: string; folder: string; revision: string }> {
  return json(withFiles(of.files, () => post("/save", { ...body(of), revision, overwrite })));
}

export async function zip(of: Draft): Promise<Blob> {
  return (await withFiles(of.files, () => post("/zip", body(of)))).blob();
}

export const start = (name: string) => json<{ site: string; robot: string }>(post("/start", { name }));
export const stop = (name: string) => json<{ site: string; robot: string }>(post("/stop", { name }));
