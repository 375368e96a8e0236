// Simplified meshes: a tile shows an arm a hand's breadth high, and a page has two hundred tiles.

import * as THREE from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";

const MOST_TRIANGLES = 2000;
const FINEST = 1 / 150; // of its size: finer than a tile can show
const CREASE_ANGLE = 0.7; // rad: sharper edges stay sharp

/** Simplify the meshes below a group to at most `MOST_TRIANGLES` together, with normals.
 *
 * Vertices in one cell of a grid merge; degenerate triangles are removed; the grid grows until few are left. */
export function simplifyMeshes(group: THREE.Object3D): void {
  const meshes: THREE.Mesh[] = [];
  group.traverse((part) => part instanceof THREE.Mesh && meshes.push(part));
  const size = new THREE.Box3().setFromObject(group).getSize(new THREE.Vector3()).length();
  const all = meshes.map(({ geometry }) => (geometry.index ? geometry.toNonIndexed() : geometry));
  for (let cell = size * FINEST; ; ) {
    const kept = all.map((geometry) => triangles(geometry, cell));
    const count = kept.reduce((sum, { length }) => sum + length, 0);
    if (count <= MOST_TRIANGLES || cell > size) {
      meshes.forEach((mesh, i) => {
        const [geometry, some] = [all[i], kept[i]];
        if (geometry && some) mesh.geometry = toCreasedNormals(picked(geometry, some), CREASE_ANGLE);
      });
      return;
    }
    cell *= Math.max(1.2, Math.sqrt(count / MOST_TRIANGLES));
  }
}

interface Triangle {
  /** Index of its first vertex. */
  from: number;
  corners: readonly Cluster[];
}
interface Cluster {
  id: number;
  sum: THREE.Vector3;
  count: number;
}

/** Return the triangles of a non-indexed geometry that do not degenerate on a grid, without repeats. */
function triangles(geometry: THREE.BufferGeometry, cell: number): Triangle[] {
  const position = geometry.getAttribute("position");
  const clusters = new Map<string, Cluster>();
  const at = new THREE.Vector3();
  const clusterOf = (corner: number) => {
    at.fromBufferAttribute(position, corner);
    const name = [at.x, at.y, at.z].map((value) => Math.round(value / cell)).join();
    const cluster = clusters.get(name) ?? { id: clusters.size, sum: new THREE.Vector3(), count: 0 };
    clusters.set(name, cluster);
    cluster.sum.add(at);
    cluster.count += 1;
    return cluster;
  };
  const found = new Map<string, Triangle>();
  for (let from = 0; from + 2 < position.count; from += 3) {
    const corners = [0, 1, 2].map((i) => clusterOf(from + i));
    const ids = corners.map(({ id }) => id).sort((a, b) => a - b);
    if (new Set(ids).size === 3) found.set(ids.join(), { from, corners });
  }
  return [...found.values()];
}

/** Return the geometry of some triangles: vertices at their clusters, colours and texture coordinates unchanged. */
function picked(geometry: THREE.BufferGeometry, some: readonly Triangle[]): THREE.BufferGeometry {
  const made = new THREE.BufferGeometry();
  for (const [name, attribute] of Object.entries(geometry.attributes)) {
    if (name === "normal") continue;
    const values = some.flatMap(({ from, corners }) =>
      corners.flatMap(({ sum, count }, i) =>
        name === "position"
          ? sum.toArray().map((value) => value / count)
          : Array.from({ length: attribute.itemSize }, (_, k) => attribute.getComponent(from + i, k)),
      ),
    );
    made.setAttribute(name, new THREE.Float32BufferAttribute(values, attribute.itemSize));
  }
  return made;
}
