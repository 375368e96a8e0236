// Requests of Define to the console's server.

import { t } from "../../../i18n/texts";
import { RefusedRequest, readRefusal } from "../../../mesh/console/refusal";
import type { GivenDescription } from "../description/description";
import { concise } from "../description/description";
import type { Draft } from "./draft";
import { identity } from "./draft";
import { cachedFile } from "./file-cache";

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

export interface LoadedRobot {
  description: GivenDescription;
  files: Record<string, string>;
  notes: string[];
}

/** A robot at the site. */
export interface SiteRobot extends LoadedRobot {
  /** Revision of its folder; each change creates a new one. */
  revision: string;
}

export interface MeshInfo {
  glb: string;
  triangles: number;
  min: [number, number, number];
  max: [number, number, number];
  /** Of its surface, spread evenly. */
  points: [number, number, number][];
  warnings: string[];
  missing: string[];
  /** Guessed metres in the file's unit. */
  scale: number;
  up: "y" | "z";
  /** Reasons for these guesses. */
  guess: string;
}

export interface Checked {
  problems: Problem[];
  /** 4x4 by rows, metres; null if the description has problems. */
  tool: number[][] | null;
}

/** Why a pair of links is ignored (the first three), or its shape for checks: robots/bodies/verdicts.py. */
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
  /** Numbers in the reason: positions, percent, triangles, seconds, gigabytes. */
  values: Readonly<Record<string, number>>;
}

async function send(path: string, init?: RequestInit): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(`/define${path}`, init);
  } catch (error) {
    if (init?.signal?.aborted) throw error;
    throw new RefusedRequest(0, t("not_connected"));
  }
  if (answer.ok) return answer;
  throw await readRefusal(answer);
}

/** Return the problems of a description that was refused; empty: it was refused for another reason. */
export function problemsOf({ reply }: RefusedRequest): Problem[] {
  return (reply.problems as Problem[] | undefined) ?? [];
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

// "Gone": the server's store dropped the files for others.
const FORGOTTEN = 410;

/** Send a request with a draft's files; if the server has dropped some, upload them and repeat it. */
async function withFiles(files: Readonly<Record<string, string>>, asked: () => Promise<Response>): Promise<Response> {
  try {
    return await asked();
  } catch (error) {
    if (!(error instanceof RefusedRequest) || error.status !== FORGOTTEN) throw error;
    // Opening a saved robot restores its own files.
    const { owner } = identity.value;
    let sent = owner
      ? await robot(owner).then(
          () => 1,
          () => 0,
        )
      : 0;
    for (const [path, sha] of Object.entries(files)) {
      const bytes = await cachedFile(sha);
      if (bytes) sent += Number((await upload(path, bytes)).sha === sha);
    }
    if (!sent) throw error;
    return asked();
  }
}

export const robots = () => json<Robots>(send("/robots"));

export const robot = (name: string) => json<SiteRobot>(send(`/robots/${encodeURIComponent(name)}`));

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

/** Return how each pair is checked; pairs that the draft ignores are included. */
export function collisions(of: Draft): Promise<{ pairs: Pair[] }> {
  return json(withFiles(of.files, () => post("/collisions", body(of))));
}

/** Return a URDF, an OpenHRP VRML file or a robot.toml as a draft. */
export function importRobot(
  file: string,
  files: Readonly<Record<string, string>>,
): Promise<LoadedRobot & { missing: string[] }> {
  return json(post("/import", { file, files }));
}

/** Return the files of a zip archive, SHA-256 by path. */
export async function unzip(file: string, sha: string): Promise<Record<string, string>> {
  const answer = await json<{ files: Record<string, string> }>(post("/unzip", { file, files: { [file]: sha } }));
  return answer.files;
}

/** @param revision Revision that may be overwritten without a question; "": none. */
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
