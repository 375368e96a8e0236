// Contents of the draft's mesh files, read by the server once for each content.

import { effect, signal } from "@preact/signals";
import { reasonOf } from "../../../mesh/console/connection";
import { bodies } from "../description/description";
import { resolvePath } from "../description/paths";
import { draft } from "./draft";
import type { MeshInfo } from "./server-requests";
import { mesh } from "./server-requests";

export type Shape = { info: MeshInfo } | { error: string } | "reading";

/** By `shapeKey`. */
export const shapes = signal<ReadonlyMap<string, Shape>>(new Map());

/** A mesh file and all files that it may refer to. */
export function shapeKey(path: string, files: Readonly<Record<string, string>>): string {
  return `${path} ${files[path] ?? ""}`;
}

export function shapeOf(path: string, files: Readonly<Record<string, string>>): Shape | undefined {
  return shapes.value.get(shapeKey(path, files));
}

export function setShape(path: string, files: Readonly<Record<string, string>>, shape: Shape): void {
  shapes.value = new Map([...shapes.value, [shapeKey(path, files), shape]]);
}

/** Request a mesh file's contents again. */
export async function readShape(path: string, files: Readonly<Record<string, string>>): Promise<Shape> {
  let shape: Shape;
  try {
    shape = { info: await mesh(path, files) };
  } catch (error) {
    shape = { error: reasonOf(error) };
  }
  setShape(path, files, shape);
  return shape;
}

/** Request the contents of every mesh file of the draft until the returned function is called. */
export function startReading(): () => void {
  return effect(() => {
    const now = draft.value;
    if (!now) return;
    for (const { mesh: path } of bodies(now.description)) {
      if (!path || !now.files[path] || shapes.peek().has(shapeKey(path, now.files))) continue;
      setShape(path, now.files, "reading");
      void readShape(path, now.files);
    }
  });
}

export interface MissingFile {
  /** The mesh file that refers to it. */
  of: string;
  /** The name in that file. */
  name: string;
  /** Its path in the description's folder. */
  path: string;
}

/** Missing files that the draft's mesh files refer to. */
export function missingFiles(): MissingFile[] {
  const now = draft.value;
  if (!now) return [];
  const found = new Map<string, MissingFile>();
  for (const { mesh: of } of bodies(now.description)) {
    const shape = shapeOf(of, now.files);
    if (typeof shape !== "object" || !("info" in shape)) continue;
    for (const name of shape.info.missing) {
      const path = resolvePath(of, name);
      if (!now.files[path]) found.set(path, { of, name, path });
    }
  }
  return [...found.values()];
}
