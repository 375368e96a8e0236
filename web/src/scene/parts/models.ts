// Models of the 3-D view: loaded from the mesh, given the page's materials, painted, copied as ghosts.

import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { t } from "../../i18n/texts";
import { readRefusal } from "../../mesh/console/refusal";

const NOT_YET: readonly number[] = [503, 504]; // the mesh service is busy, or did not answer
const ASK_AGAIN_MS = 2000;
const CREASE_ANGLE = 0.6; // rad: sharper edges stay sharp
const STALE_COLOUR = new THREE.Color("#7d8387");
const MUTED = 0.6;
const STALE_OPACITY = 0.38;
const FIXTURE_OPACITY = 0.7;
const FIXTURE_COLOUR = "#6f7c88";
const NO_COLOUR = 0xcccccc; // placeholder of models without colour: see robots/shapes/geometry.py
const EDGE_ANGLE = 30; // degrees: sharper ones are drawn
const MOST_CORNERS = 100_000; // finding the edges of more takes too long

/** Appearance of a model. */
export interface Paint {
  stale: boolean;
  red: boolean;
  /** Other parts than the arm: a neighbour is muted, a fixture translucent. */
  kind: Kind;
}
export type Kind = "arm" | "neighbour" | "fixture";

/** Load a GLB, with retries; null: no longer wanted.
 *
 * `failed` receives the reason for each retry. @throws Error with the reason if it can never be loaded. */
export async function loadModel(
  url: string,
  wanted: () => boolean = () => true,
  failed: (why: string) => void = () => undefined,
): Promise<THREE.Group | null> {
  let glb: ArrayBuffer | null = null;
  // The mesh service or the console may be starting or busy: report it immediately, and retry.
  while (wanted() && !(glb = await fetched(url, failed))) {
    await new Promise((resolve) => setTimeout(resolve, ASK_AGAIN_MS));
  }
  if (!wanted() || !glb) return null;
  const scene = await readGlb(glb);
  return wanted() ? scene : null;
}

/** Read a GLB, turned from glTF's y up to the robot's z up. @throws Error if it is invalid. */
export async function readGlb(glb: ArrayBuffer): Promise<THREE.Group> {
  const { scene, asset } = await new GLTFLoader().parseAsync(glb, "");
  // From before 2026-11, for example in a recording: it was never turned.
  if (asset.extras?.robomesh?.up !== "z") scene.rotation.x = Math.PI / 2;
  return scene;
}

/** Fetch a GLB; on a temporary failure report why and return null. */
async function fetched(url: string, failed: (why: string) => void): Promise<ArrayBuffer | null> {
  let answer: Response;
  try {
    answer = await fetch(url);
    if (answer.ok) return await answer.arrayBuffer();
  } catch {
    failed(t("not_connected"));
    return null;
  }
  const refused = await readRefusal(answer);
  if (!NOT_YET.includes(refused.status)) throw refused;
  failed(refused.message);
  return null;
}

/** Return a group with a model in the page's materials; the caller sets its matrix. */
export function withMaterials(model: THREE.Group, colour: string): THREE.Group {
  model.traverse((part) => {
    if (!(part instanceof THREE.Mesh)) return;
    part.castShadow = true;
    part.receiveShadow = true;
    if (!part.geometry.getAttribute("normal")) part.geometry = toCreasedNormals(part.geometry, CREASE_ANGLE);
    const own = part.material instanceof THREE.MeshStandardMaterial ? part.material : null;
    const material = new THREE.MeshStandardMaterial({
      color: own?.color ?? new THREE.Color(colour || "#8a8f94"),
      vertexColors: part.geometry.hasAttribute("color"),
      map: own?.map ?? null,
      roughness: 0.55,
      metalness: 0.1,
      side: THREE.DoubleSide,
    });
    part.material = material;
    part.userData.colour = material.color.clone();
  });
  const group = new THREE.Group();
  group.add(model);
  group.matrixAutoUpdate = false;
  return group;
}

/** Return a fixture's model with edges; without a colour it gets one that contrasts with the floor. */
export function withEdges(model: THREE.Group, colour: string): THREE.Group {
  const group = withMaterials(model, colour);
  const parts: THREE.Mesh[] = [];
  group.traverse((part) => part instanceof THREE.Mesh && parts.push(part));
  for (const part of parts) {
    const { color, map } = part.material as THREE.MeshStandardMaterial;
    const geometry = part.geometry as THREE.BufferGeometry;
    const own = part.userData.colour as THREE.Color;
    if (!colour && !map && !geometry.hasAttribute("color") && color.getHex() === NO_COLOUR) own.set(FIXTURE_COLOUR);
    if (geometry.getAttribute("position").count > MOST_CORNERS) continue;
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(geometry, EDGE_ANGLE), new THREE.LineBasicMaterial());
    part.add(edges);
  }
  return group;
}

/** Set the colour of a fixture's edges. */
export function colourEdges(group: THREE.Group, colour: string): void {
  group.traverse((part) => {
    if (part instanceof THREE.LineSegments) (part.material as THREE.LineBasicMaterial).color.set(colour);
  });
}

/** Paint a model; stale ones are grey and translucent. */
export function paint(group: THREE.Group, { stale, red, kind }: Paint, alarm: string): void {
  const opacity = stale ? STALE_OPACITY : kind === "fixture" ? FIXTURE_OPACITY : 1;
  group.traverse((part) => {
    if (!(part instanceof THREE.Mesh)) return;
    const material = part.material as THREE.MeshStandardMaterial;
    material.color.copy(part.userData.colour as THREE.Color);
    if (kind === "neighbour") material.color.lerp(STALE_COLOUR, MUTED);
    if (stale) material.color.copy(STALE_COLOUR);
    if (red) material.color.set(alarm);
    material.vertexColors = !stale && !red && part.geometry.hasAttribute("color");
    material.transparent = opacity < 1;
    material.opacity = opacity;
    // The inside of a translucent part would only confuse.
    material.side = kind === "fixture" ? THREE.FrontSide : THREE.DoubleSide;
    material.needsUpdate = true;
    part.castShadow = opacity === 1;
  });
}

/** Return a hidden translucent copy; `colourGhost` sets its colour. */
export function ghostOf(group: THREE.Group): THREE.Group {
  const copy = group.clone();
  copy.visible = false;
  copy.matrixAutoUpdate = false;
  const material = new THREE.MeshStandardMaterial({ transparent: true, opacity: 0.4, depthWrite: false });
  copy.traverse((part) => {
    if (!(part instanceof THREE.Mesh)) return;
    part.material = material;
    part.castShadow = false;
  });
  return copy;
}

/** Set a ghost's colour. */
export function colourGhost(copy: THREE.Group, colour: string, opacity: number): void {
  copy.traverse((part) => {
    if (!(part instanceof THREE.Mesh)) return;
    const material = part.material as THREE.MeshStandardMaterial;
    material.color.set(colour);
    material.opacity = opacity;
  });
}
