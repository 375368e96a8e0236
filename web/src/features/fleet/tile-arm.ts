// An arm for tiles: simplified, shared by all robots of a model, posed by joint positions.

import * as THREE from "three";
import type { Description } from "../../gen/robomesh_pb";
import { meshUrl } from "../../scene/parts/arm";
import type { Forward } from "../../scene/parts/forward-kinematics";
import { forwardOf } from "../../scene/parts/forward-kinematics";
import { loadModel } from "../../scene/parts/models";
import { simplifyMeshes } from "./simplify-mesh";

const STALE = new THREE.MeshLambertMaterial({ color: "#7d8387", transparent: true, opacity: 0.45 });
const PLAIN = "#8a8f94";
const BOUNDS_FACTOR = 1.32; // times the arm's size at home

const arms = new Map<string, TileArm>();

export class TileArm {
  readonly group = new THREE.Group();
  /** All of its links are loaded. */
  complete = false;
  /** A sphere around the arm's poses, in its base frame: larger than the arm at home. */
  readonly bounds = new THREE.Sphere(new THREE.Vector3(0, 0, 0.4), 0.8);
  private readonly forward: Forward;
  private readonly links = new Map<string, THREE.Group>();
  private readonly own = new Map<THREE.Mesh, THREE.Material>();
  private stale = false;

  constructor(prefix: string, description: Description, loaded: () => void) {
    const { joints, links, urdf } = description;
    this.forward = forwardOf(
      urdf,
      joints.map((joint) => joint.name),
    );
    void Promise.all(
      links.map(async ({ name, mesh, meshSha256, color }) => {
        if (!mesh) return;
        const model = await loadModel(meshUrl(prefix, mesh, meshSha256));
        const group = new THREE.Group();
        group.matrixAutoUpdate = false;
        if (model) group.add(withTileMaterial(model, color));
        this.links.set(name, group);
        this.group.add(group);
      }),
    ).then(
      () => {
        simplifyMeshes(this.group);
        this.group.traverse(
          (part) => part instanceof THREE.Mesh && this.own.set(part, part.material as THREE.Material),
        );
        this.complete = true;
        this.pose(joints.map((joint) => joint.home));
        new THREE.Box3().setFromObject(this.group).getBoundingSphere(this.bounds);
        this.bounds.center.set(0, 0, this.bounds.center.z * 1.3);
        this.bounds.radius *= BOUNDS_FACTOR;
        loaded();
      },
      () => arms.delete(rigName(description)),
    ); // the next tile that needs it tries again
  }

  /** Place the links at joint positions [rad] or [m]. */
  pose(positions: readonly number[]): void {
    const placements = this.forward(positions);
    for (const [name, group] of this.links) {
      const placement = placements.get(name);
      if (placement) group.matrix.copy(placement);
      group.matrixWorldNeedsUpdate = true;
    }
  }

  /** Draw it grey and translucent, or in its own colours. */
  setStale(stale: boolean): void {
    if (stale === this.stale) return;
    this.stale = stale;
    for (const [part, own] of this.own) part.material = stale ? STALE : own;
  }
}

/** Return the rig of a description, shared by all robots of a model. */
export function tileArmOf(prefix: string, description: Description, loaded: () => void): TileArm {
  const name = rigName(description);
  const rig = arms.get(name) ?? new TileArm(prefix, description, loaded);
  arms.set(name, rig);
  return rig;
}

function rigName({ urdf, links }: Description): string {
  // The robot's own name does not matter.
  return urdf.replace(/<robot name="[^"]*"/, "") + links.map((link) => link.meshSha256 + link.color).join();
}

/** Apply the cheapest lit material: a tile is small. */
function withTileMaterial(model: THREE.Group, colour: string): THREE.Group {
  model.traverse((part) => {
    if (!(part instanceof THREE.Mesh)) return;
    const own = part.material instanceof THREE.MeshStandardMaterial ? part.material : null;
    part.material = new THREE.MeshLambertMaterial({
      color: own?.color ?? new THREE.Color(colour || PLAIN),
      map: own?.map ?? null,
      vertexColors: part.geometry.hasAttribute("color"),
      side: THREE.DoubleSide,
    });
  });
  return model;
}
