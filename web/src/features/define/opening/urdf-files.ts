// Which of the dropped files a URDF's addresses mean: "package://arm/meshes/visual/link_1.stl".

import { baseName, folderOf, resolvePath } from "../description/paths";

/** A dropped file: its path, and its size in bytes if it is known. */
export interface Candidate {
  path: string;
  size: number;
}

/** Files that shapes refer to: pictures, materials, buffers. */
export const PART_OF_SHAPE = /\.(png|jpe?g|tga|bmp|gif|tiff?|mtl|bin)$/i;

/** Return the file for each address, by the most folders in common; addresses without a file are left out.
 *
 * Files of one name, dropped without their folders: the largest is what is seen, the smallest what collides. */
export function filesByAddress(
  addresses: readonly string[],
  candidates: readonly Candidate[],
): ReadonlyMap<string, string> {
  const found = new Map<string, string>();
  for (const address of addresses) {
    const collides = /collision/i.test(address);
    const best = candidates
      .filter(({ path }) => baseName(path) === baseName(decoded(address)))
      .map((each) => ({ ...each, common: commonSteps(decoded(address), each.path) }))
      .sort((one, other) => other.common - one.common || (collides ? one.size - other.size : other.size - one.size))[0];
    if (best) found.set(address, best.path);
  }
  return found;
}

/** Return the places of what a moved file may refer to: in its folder, or in its neighbouring folders and subfolders. */
export function partsBeside(from: string, to: string, paths: readonly string[]): ReadonlyMap<string, string> {
  const [own, ownTo] = [folderOf(from), folderOf(to)];
  // Without folders, all files are in one folder.
  const [folder, folderTo] = own ? [folderOf(own), folderOf(ownTo)] : ["", ownTo];
  return new Map(
    paths
      .filter((path) => PART_OF_SHAPE.test(path) && path.startsWith(folder))
      .map((path) => [folderTo + path.slice(folder.length), path]),
  );
}

/** Return where the server looks for an address of a URDF. */
export function placeOf(urdf: string, address: string): string {
  const [, inPackage] = /^(?:package|model):\/\/(.*)$/.exec(decoded(address)) ?? [];
  return inPackage ?? resolvePath(urdf, decoded(address).replace(/^file:(\/\/)?/, ""));
}

/** Return the number of equal steps at the ends of two paths. */
function commonSteps(one: string, other: string): number {
  const [first, second] = [one, other].map((path) => path.toLowerCase().split("/").reverse()) as [string[], string[]];
  const differs = first.findIndex((step, i) => step !== second[i]);
  return differs < 0 ? first.length : differs;
}

function decoded(address: string): string {
  try {
    return decodeURIComponent(address);
  } catch {
    return address;
  }
}
