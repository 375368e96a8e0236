// An arm in the 3-D view: links at their frames, grey when those are stale, and its ghost.

import * as THREE from "three";
import type { FrameTransforms } from "../../gen/foxglove/FrameTransforms_pb";
import type { Description } from "../../gen/robomesh_pb";
import { reasonOf } from "../../mesh/console/connection";
import { FramePlayer } from "./frame-player";
import type { Kind } from "./models";
import { colourGhost, ghostOf, loadModel, paint, withMaterials } from "./models";
import { palette } from "./surroundings";

const SAME_PLACE = 2e-3; // m, or an element of a rotation matrix

/** Called with the reason why a link or fixture cannot be drawn yet, and with "" when it can. */
export type Failed = (name: string, why: string) => void;

export class Arm {
  readonly player = new FramePlayer();
  private readonly links = new Map<string, THREE.Group>();
  private readonly ghosts = new Map<string, THREE.Group>();
  private readonly base = new THREE.Matrix4();
  private red: ReadonlySet<string> = new Set();
  private stale = false;
  private removed = false;

  /** `prefix` is `<site>/<robot>`. */
  constructor(
    private readonly scene: THREE.Scene,
    private readonly prefix: string,
    private readonly kind: Kind,
    private readonly changed: () => void,
  ) {}

  /** Load the links' meshes; `made` receives each ghost before it is needed. */
  async load(description: Description, failed: Failed, made?: (ghost: THREE.Group) => void): Promise<void> {
    if (description.baseToSite.length === 16) this.base.fromArray(description.baseToSite).transpose();
    await Promise.all(
      description.links.map(async ({ name, mesh, meshSha256, color }) => {
        if (!mesh) return;
        const url = meshUrl(this.prefix, mesh, meshSha256);
        const model = await loadOrReport(
          url,
          () => !this.removed,
          (why) => failed(name, why),
        );
        if (model) this.addLink(`${this.prefix}/${name}`, model, color, made);
      }),
    );
  }

  private addLink(frame: string, model: THREE.Group, colour: string, made?: (ghost: THREE.Group) => void): void {
    const group = withMaterials(model, colour);
    group.visible = false; // until its frame arrives
    this.links.set(frame, group);
    this.scene.add(group);
    if (made) {
      const ghost = ghostOf(group);
      this.ghosts.set(frame, ghost);
      this.scene.add(ghost);
      made(ghost);
    }
    this.paint();
    this.player.touch();
  }

  placeFrames(frames: FrameTransforms, sourceTimeMs: number, arrivedMs: number): void {
    if (this.player.add(frames, sourceTimeMs, arrivedMs)) this.changed();
  }

  /** Place the links at a time of the page's clock [ms]; null: unchanged. */
  placeAt(time: number): ReadonlyMap<string, THREE.Matrix4> | null {
    const placements = this.player.at(time);
    for (const [frame, placement] of placements ?? []) {
      const group = this.links.get(frame);
      if (!group) continue;
      group.matrix.copy(placement);
      group.visible = true;
    }
    return placements;
  }

  setStale(stale: boolean): void {
    if (stale === this.stale) return;
    this.stale = stale;
    this.paint();
  }

  /** Paint links red, named `<robot>/<link>`: their visible ghosts, otherwise themselves. */
  setRed(names: ReadonlySet<string>): void {
    this.red = names;
    this.paint();
  }

  private paint(): void {
    const { accent, alarm } = palette();
    for (const [frame, group] of this.links) {
      const red = this.red.has(frame.slice(frame.indexOf("/") + 1));
      const ghost = this.ghosts.get(frame);
      if (ghost) colourGhost(ghost, red ? alarm : accent, red ? 0.75 : 0.4);
      paint(group, { stale: this.stale, red: red && !ghost?.visible, kind: this.kind }, alarm);
    }
    this.changed();
  }

  /** Show the ghost at placements in the base frame by link; null: hide it.
   *
   * @returns Number of visible ghosts: a link that does not move needs none. */
  showGhost(placements: ReadonlyMap<string, THREE.Matrix4> | null): number {
    let turned = false;
    for (const [frame, group] of this.links) {
      const placement = placements?.get(frame.slice(this.prefix.length + 1));
      const copy = this.ghosts.get(frame);
      if (!copy) continue;
      if (placement) copy.matrix.multiplyMatrices(this.base, placement);
      const visible = placement !== undefined && !alike(copy.matrix, group.matrix);
      turned ||= visible !== copy.visible;
      copy.visible = visible;
    }
    if (turned && this.red.size) this.paint();
    this.changed();
    return [...this.ghosts.values()].filter((copy) => copy.visible).length;
  }

  /** Remove the arm from the scene. */
  remove(): void {
    this.removed = true;
    for (const group of this.links.values()) {
      this.scene.remove(group);
      group.traverse((part) => {
        if (!(part instanceof THREE.Mesh)) return;
        part.geometry.dispose();
        (part.material as THREE.Material).dispose();
      });
    }
    this.links.clear();
    this.changed();
  }
}

/** Return the console's address of a mesh of a robot, `<site>/<robot>`. */
export function meshUrl(prefix: string, mesh: string, sha256: string): string {
  return `/mesh/${prefix}/${encodeURIComponent(mesh)}?sha=${sha256}`;
}

/** Load a model; on failure report why and return null. */
export async function loadOrReport(
  url: string,
  wanted: () => boolean,
  failed: (why: string) => void,
): Promise<THREE.Group | null> {
  try {
    const model = await loadModel(url, wanted, failed);
    if (model) failed("");
    return model;
  } catch (error) {
    failed(reasonOf(error));
    return null;
  }
}

function alike(first: THREE.Matrix4, second: THREE.Matrix4): boolean {
  return first.elements.every((value, i) => Math.abs(value - (second.elements[i] ?? 0)) < SAME_PLACE);
}
