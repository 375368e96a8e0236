// Surroundings of a robot in the 3-D view: light, floor, grid, in the page's colours.

import * as THREE from "three";

const FLOOR_RADIUS = 1.6;
const GRID_STEP = 0.1;

export interface Palette {
  background: string;
  floor: string;
  grid: string;
  gridStrong: string;
  accent: string;
  dim: string;
  warning: string;
  alarm: string;
}

/** Return the scene's colours from the style sheet. */
export function palette(): Palette {
  const style = getComputedStyle(document.documentElement);
  const read = (name: string) => style.getPropertyValue(name).trim();
  return {
    background: read("--scene"),
    floor: read("--scene-floor"),
    grid: read("--scene-grid"),
    gridStrong: read("--scene-grid-strong"),
    accent: read("--accent"),
    dim: read("--dim"),
    warning: read("--warning"),
    alarm: read("--stop"),
  };
}

/** Name of the light that casts shadows. */
export const KEY_LIGHT = "key light";

/** Return sky, key light with a shadow, and a fill light. */
export function lights(): THREE.Object3D[] {
  const sky = new THREE.HemisphereLight("#f4f7fa", "#5b5f63", 1.5);
  sky.position.set(0, 0, 1);
  const key = new THREE.DirectionalLight("#fff8ee", 2.6);
  key.name = KEY_LIGHT;
  key.position.set(1.6, -2.2, 3.4);
  key.castShadow = true;
  key.shadow.mapSize.set(1024, 1024);
  Object.assign(key.shadow.camera, { left: -1.5, right: 1.5, top: 1.5, bottom: -1.5, near: 0.5, far: 8 });
  key.shadow.camera.updateProjectionMatrix();
  key.shadow.bias = -0.0004;
  key.shadow.normalBias = 0.008;
  key.shadow.radius = 3;
  const fill = new THREE.DirectionalLight("#cfe0f2", 0.9);
  fill.position.set(-2.5, 1.5, 1.8);
  return [sky, key, fill];
}

/** Colour a scene's background and replace its floor; return the new floor, null without one. */
export function surround(scene: THREE.Scene, colours: Palette, hasFloor = true): THREE.Group | null {
  scene.background = new THREE.Color(colours.background);
  const old = scene.getObjectByName("floor");
  if (old) scene.remove(old);
  if (!hasFloor) return null;
  const made = floor(colours);
  made.name = "floor";
  scene.add(made);
  return made;
}

/** Return a round floor with a grid of 100 mm, stronger each 500 mm. */
function floor(colours: Palette): THREE.Group {
  const group = new THREE.Group();
  const disc = new THREE.Mesh(
    new THREE.CircleGeometry(FLOOR_RADIUS, 96),
    new THREE.MeshStandardMaterial({ color: colours.floor, roughness: 1, metalness: 0 }),
  );
  disc.position.z = -0.002;
  disc.receiveShadow = true;
  group.add(
    disc,
    gridLines(colours.grid, (i) => i % 5 !== 0),
    gridLines(colours.gridStrong, (i) => i % 5 === 0),
  );
  return group;
}

function gridLines(colour: string, wanted: (index: number) => boolean): THREE.LineSegments {
  const points: number[] = [];
  const count = Math.floor(FLOOR_RADIUS / GRID_STEP);
  for (let i = -count; i <= count; i++) {
    if (!wanted(i)) continue;
    const at = i * GRID_STEP;
    const reach = Math.sqrt(FLOOR_RADIUS ** 2 - at ** 2);
    points.push(at, -reach, 0, at, reach, 0, -reach, at, 0, reach, at, 0);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour }));
}
