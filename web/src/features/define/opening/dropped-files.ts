// Dropped or chosen files: uploaded, and used as links, companion files or a URDF's robot.

import { signal } from "@preact/signals";
import { defineText as d } from "../../../i18n/texts";
import { reasonOf } from "../../../mesh/console/connection";
import type { Body, Description } from "../description/description";
import { complete, empty, radians, tidy } from "../description/description";
import { insertJoint, nameFromFile, unusedName } from "../description/edits";
import { baseName, fileName, resolvePath } from "../description/paths";
import type { Draft, Identity } from "../draft/draft";
import { draft, editDraft, identity, isOpen, openDraft } from "../draft/draft";
import { cacheFile } from "../draft/file-cache";
import { missingFiles, readShape, setShape } from "../draft/mesh-files";
import { choosePart, resetSelection } from "../draft/selection";
import type { MeshInfo } from "../draft/server-requests";
import { importRobot, mesh, unzip, upload } from "../draft/server-requests";
import type { PartOrder } from "./part-order";
import { guessOrder, stemOf } from "./part-order";
import { filesByAddress, PART_OF_SHAPE, partsBeside, placeOf } from "./urdf-files";

/** File types that may be meshes; the server decides which it can read. */
const SHAPE = /\.(wrl|wrz|vrml|3ds|stl|obj|ply|off|dae|glb|gltf|dxf|ste?p|ige?s)(\.gz)?$/i;
const USEFUL = [SHAPE, PART_OF_SHAPE, /\.(urdf|toml|zip)$/i];
const MESH_FOLDER = "meshes";
const MOST_NAMED = 6; // of the files that are not taken
const MOST_ORDERED = 10; // that a guessed order names

/** A file with its path in the dropped folder, or its name. */
export interface Dropped {
  path: string;
  file: File;
}

export interface Notice {
  kind: "done" | "refused";
  text: string;
}

/** What is being read; "": nothing. */
export const reading = signal("");
/** The outcome of the last files. */
export const fileNotices = signal<readonly Notice[]>([]);
/** Paths of missing files that the user skipped. */
export const skippedFiles = signal<ReadonlySet<string>>(new Set());
/** A URDF that waits for files; `found` is the number of its shapes that are there. */
export const waitingUrdf = signal<{
  file: string;
  files: Record<string, string>;
  found: number;
  missing: string[];
} | null>(null);

/** Sizes of uploaded files [bytes] by SHA-256. */
const sizes = new Map<string, number>();
let last: Promise<void> = Promise.resolve();
/** The page or draft that the files were dropped on. */
let target: Identity | null = null;

/** Read files after earlier ones, unless their page or draft was closed. */
function enqueue(read: () => Promise<void>): Promise<void> {
  const own = identity.value;
  last = last.then(async () => {
    target = own;
    if (isClosed()) return;
    fileNotices.value = [];
    try {
      await read();
    } catch (error) {
      notice("refused", d("not_done", { text: reasonOf(error) }));
    }
    reading.value = "";
  });
  return last;
}

function isClosed(): boolean {
  return target !== null && !isOpen(target);
}

function notice(kind: Notice["kind"], text: string): void {
  if (!isClosed()) fileNotices.value = [...fileNotices.value, { kind, text }];
}

function refuse(name: string, error: unknown): void {
  notice("refused", d("file_refused", { name, text: reasonOf(error) }));
}

/** Return files of the file dialog, which have no folders. */
export const chosen = (files: readonly File[]): Dropped[] => files.map((file) => ({ path: file.name, file }));

/** Return every file of a drop, including those in folders. */
export async function droppedFiles(data: DataTransfer): Promise<Dropped[]> {
  const entries = [...data.items].map((item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  if (entries.length === 0) return chosen([...data.files]);
  return (await Promise.all(entries.map(filesOf))).flat();
}

async function filesOf(entry: FileSystemEntry): Promise<Dropped[]> {
  if (entry instanceof FileSystemFileEntry || entry.isFile) {
    const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
    return [{ path: entry.fullPath.replace(/^\//, ""), file }];
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const found: FileSystemEntry[] = [];
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) break; // a reader returns a hundred at a time
    found.push(...some);
  }
  return (await Promise.all(found.map(filesOf))).flat();
}

/** Upload and keep files; return SHA-256 by path. A zip archive counts as its files. */
async function sendAll(dropped: readonly Dropped[]): Promise<Map<string, string>> {
  const sent = new Map<string, string>();
  // Files of several folders that were dropped without them.
  const free = (path: string, number = 2): string => {
    const other = `${number}/${path}`;
    return sent.has(other) ? free(path, number + 1) : other;
  };
  for (const [index, { path, file }] of dropped.entries()) {
    if (isClosed()) break;
    reading.value = d("reading", { name: file.name, number: index + 1, count: dropped.length });
    try {
      const { sha } = await upload(file.name, file);
      await cacheFile(sha, file);
      sizes.set(sha, file.size);
      if (!/\.zip$/i.test(path)) sent.set(sent.has(path) ? free(path) : path, sha);
      else for (const [inside, its] of Object.entries(await unzip(file.name, sha))) sent.set(inside, its);
    } catch (error) {
      refuse(file.name, error);
    }
  }
  return sent;
}

/** Process files: place missing ones, start a robot from a URDF or robot.toml, make each mesh file a link.
 *
 * @param asRobot A VRML file is a robot, as in OpenHRP, not a link. */
export function takeFiles(dropped: readonly Dropped[] | Promise<readonly Dropped[]>, asRobot = false): Promise<void> {
  return enqueue(async () => take(await dropped, asRobot));
}

async function take(dropped: readonly Dropped[], asRobot: boolean): Promise<void> {
  if (dropped.length === 0) {
    notice("refused", d("nothing_dropped"));
    return;
  }
  const sorted = [...dropped].sort((one, other) =>
    one.path.localeCompare(other.path, "en", { numeric: true, sensitivity: "base" }),
  );
  const useful = sorted.filter(({ path }) => USEFUL.some((each) => each.test(path)));
  const others = sorted.filter((each) => !useful.includes(each)).map(({ path }) => path);
  const sent = await sendAll(useful);
  if (isClosed()) return;
  const paths = [...sent.keys()];
  const robotFile =
    paths.find((path) => /(^|\/)robot\.toml$/.test(path)) ??
    paths.find((path) => /\.urdf$/i.test(path)) ??
    (asRobot ? paths.find((path) => /\.(wrl|wrz|vrml)$/i.test(path)) : undefined);
  const waiting = waitingUrdf.value;
  const template = others.find((path) => /\.xacro$/i.test(path));
  if (waiting && !robotFile) await readUrdf(waiting.file, { ...waiting.files, ...Object.fromEntries(sent) });
  else if (robotFile) await readUrdf(robotFile, Object.fromEntries(sent), { others });
  else if (template) notice("refused", d("xacro", { name: template }));
  else await takeShapes(sent);
}

async function takeShapes(sent: Map<string, string>): Promise<void> {
  const missing = missingFiles();
  const draftFiles = draft.value?.files ?? {};
  const added: Record<string, string> = {};
  const changed: string[] = [];
  const newPaths: string[] = [];
  for (const [path, sha] of sent) {
    const name = fileName(path);
    const wanted = missing.filter((each) => baseName(each.path) === baseName(path));
    const own = `${MESH_FOLDER}/${path}`;
    for (const each of wanted) {
      added[each.path] = sha;
      changed.push(each.of);
    }
    if (wanted.length > 0) continue;
    if (draftFiles[own] === undefined && SHAPE.test(name)) newPaths.push(own);
    added[own] = sha;
  }
  const { infos, parts } = await readLinks(newPaths, { ...draftFiles, ...added });
  if (isClosed()) return;
  if (!draft.value) {
    if (infos.size === 0) {
      if (fileNotices.value.length === 0) notice("refused", d("none_to_read"));
      return;
    }
    openDraft({ description: empty(), files: {} });
    resetSelection();
  }
  for (const path of newPaths) if (!infos.has(path) && !parts.has(path)) delete added[path];
  const links = draft.value?.description.joint.length ?? 0;
  const order = guessOrder([...infos].map(([path, info]) => ({ path, points: pointsOf(info) })));
  editDraft((now) => {
    Object.assign(now.files, added); // it may have changed while these were read
    for (const path of order.paths) {
      const info = infos.get(path);
      if (info) addLink(now.description, path, info);
    }
  });
  if ((draft.value?.description.joint.length ?? 0) > links) choosePart(links);
  const files = draft.value?.files ?? {};
  await Promise.all(changed.map((path) => readShape(path, files)));
  const whole =
    sent.size === 1 ? d("read_one", { name: [...sent.keys()][0] ?? "" }) : d("read_done", { count: sent.size });
  if (fileNotices.value.length === 0) notice("done", whole);
  if (order.paths.length > 1) notice("done", orderText(order));
}

/** Return points of a mesh's surface [m], z up: parts of an assembly lie where they touch. */
function pointsOf({ points, scale, up }: MeshInfo): number[][] {
  return points.map(([x, y, z]) => (up === "y" ? [x, -z, y] : [x, y, z]).map((value) => value * scale));
}

/** Say that an order is a guess, and how it was guessed. */
function orderText({ paths, by, unnamed }: PartOrder): string {
  const shown = (all: readonly string[]) => {
    const names = all.map((path) => stemOf(path));
    return names.slice(0, MOST_ORDERED).join(" → ") + (names.length > MOST_ORDERED ? " → …" : "");
  };
  const left =
    by === "names" && unnamed.length > 0 ? ` ${d("order_unnamed", { names: unnamed.map(stemOf).join(", ") })}` : "";
  return `${d(`order_${by}`, { order: shown(paths) })}${left} ${d("order_correct")}`;
}

/** Read new mesh files; those that another refers to (Inline) are its parts, not links. */
async function readLinks(paths: readonly string[], files: Readonly<Record<string, string>>) {
  const infos = new Map<string, MeshInfo>();
  const parts = new Set<string>();
  for (const [index, path] of paths.entries()) {
    if (isClosed()) break;
    reading.value = d("reading", { name: path, number: index + 1, count: paths.length });
    try {
      // Read it alone first: the other files that it then lacks are its parts.
      const withoutOthers = Object.fromEntries(
        Object.entries(files).filter(([name]) => name === path || !paths.includes(name)),
      );
      let info = await mesh(path, withoutOthers);
      const own = info.missing.map((name) => resolvePath(path, name)).filter((name) => paths.includes(name));
      for (const part of own) parts.add(part);
      if (own.length > 0) info = await mesh(path, files);
      infos.set(path, info);
      setShape(path, files, { info });
    } catch (error) {
      refuse(path.slice(MESH_FOLDER.length + 1), error);
    }
  }
  for (const part of parts) infos.delete(part);
  return { infos, parts };
}

/** Add links: the first of an empty description is its base; each other comes with a joint at the end. */
function addLink(into: Description, path: string, info: MeshInfo): void {
  if (into.joint.length === 0 && !into.base.mesh) {
    shapeBody(into, into.base, path, info);
    return;
  }
  const joint = insertJoint(into, into.joint.length);
  const name = nameFromFile(path);
  const taken = ["base", "tool", ...into.joint.flatMap((other) => [other.name, other.link.name])];
  joint.link.name = taken.includes(name) ? unusedName(`${name}_`, taken) : name;
  shapeBody(into, joint.link, path, info);
}

/** Give a link a mesh file, with its guessed unit, and upright. */
function shapeBody(of: Description, body: Body, path: string, info: MeshInfo): void {
  body.mesh = path;
  body.collision_mesh = "";
  body.mesh_scale = info.scale;
  const quarter = tidy(Math.PI / 2 / radians(of.units));
  body.mesh_pose = { xyz: [0, 0, 0], rpy: [info.up === "y" ? quarter : 0, 0, 0] };
}

/** Give a link the chosen file, with the files of its folder. */
export function takeShapeFor(dropped: readonly Dropped[], find: (of: Description) => Body | undefined): Promise<void> {
  return enqueue(async () => {
    const sent = [...(await sendAll(dropped))].map(([path, sha]): [string, string] => [`${MESH_FOLDER}/${path}`, sha]);
    const added = Object.fromEntries(sent);
    const { infos } = await readLinks(
      Object.keys(added).filter((path) => SHAPE.test(path)),
      { ...draft.value?.files, ...added },
    );
    const [first] = infos;
    if (!first || isClosed()) return;
    editDraft((now) => {
      Object.assign(now.files, added);
      const body = find(now.description);
      if (body) shapeBody(now.description, body, ...first);
    });
  });
}

/** Open the waiting URDF without its missing files. */
export function continueWithoutMissing(): Promise<void> {
  const waiting = waitingUrdf.value;
  return enqueue(async () => {
    if (waiting) await readUrdf(waiting.file, waiting.files, { without: true });
  });
}

/** Open a URDF's robot; if files are missing, wait for them unless it is opened `without` them.
 *
 * `others`: paths of dropped files that no robot can use. */
async function readUrdf(
  file: string,
  files: Record<string, string>,
  { without = false, others = [] }: { without?: boolean; others?: readonly string[] } = {},
): Promise<void> {
  reading.value = d("reading", { name: file, number: 1, count: 1 });
  try {
    if (draft.value) throw new Error(d("urdf_twice"));
    // Alone, a URDF misses every file that it names.
    const alone = /\.urdf$/i.test(file) ? { [file]: files[file] ?? "" } : files;
    const named = (await importRobot(file, alone)).missing;
    const { placed, used } = placedFor(named, file, files);
    const answer = await importRobot(file, { ...files, ...placed });
    if (isClosed()) return;
    const found = named.length - answer.missing.length;
    const unused = Object.keys(files).filter((path) => alone !== files && path !== file && !used.has(path));
    nameUnused([...unused, ...others]);
    if (answer.missing.length > 0 && !without) {
      const kept = alone === files ? files : { ...alone, ...placed };
      waitingUrdf.value = { file, files: kept, found, missing: answer.missing };
      return;
    }
    waitingUrdf.value = null;
    if (draft.value) throw new Error(d("urdf_twice")); // another draft has been opened
    const made: Draft = { description: complete(answer.description), files: answer.files };
    resetSelection();
    openDraft(made);
    if (alone !== files && named.length > 0) notice("done", d("urdf_read", { name: file, found, count: named.length }));
    for (const text of answer.notes) notice("done", text);
  } catch (error) {
    refuse(file, error);
  }
}

/** Return files at the places where a URDF expects them, and the paths that are used for it. */
function placedFor(addresses: readonly string[], urdf: string, files: Readonly<Record<string, string>>) {
  const paths = Object.keys(files);
  const candidates = paths.map((path) => ({ path, size: sizes.get(files[path] ?? "") ?? 0 }));
  const placed: Record<string, string> = {};
  const used = new Set<string>();
  const place = (to: string, path: string) => {
    placed[to] = files[path] ?? "";
    used.add(path);
  };
  for (const [address, path] of filesByAddress(addresses, candidates)) {
    const to = placeOf(urdf, address);
    place(to, path);
    for (const [part, partPath] of partsBeside(path, to, paths)) place(part, partPath);
  }
  return { placed, used };
}

function nameUnused(paths: readonly string[]): void {
  if (paths.length === 0) return;
  const names = paths.slice(0, MOST_NAMED).join(", ");
  const more = paths.length - MOST_NAMED;
  notice("done", more > 0 ? d("unused_more", { names, more }) : d("unused", { names }));
}
