// The D-H rows as lines: each joint's axis z, offset d along it, common normal a, and each link's frame.

import * as THREE from "three";
import { alongAxis, type DhRow } from "../../../scene/parts/forward-kinematics";

const AXIS = "#4f9df0";
const LETTERS = "#d5e8ff";
const FRAME_LETTERS = "#e6e9eb";
const OFFSET = "#3fb27f";
const NORMAL = "#f0a33f";
const FAINT = 0.45;
const RADIUS = 0.0032; // of the arm's reach
const AXIS_LENGTH = 0.2;
const FRAME_LENGTH = 0.07;
const LABEL_HEIGHT = 0.032; // of the picture's height
const ON_TOP = { depthTest: false, depthWrite: false, transparent: true, toneMapped: false } as const;

const rod = new THREE.CylinderGeometry(1, 1, 1, 10).translate(0, 0.5, 0);
const tip = new THREE.ConeGeometry(1, 1, 14).translate(0, 0.5, 0);
const UP = new THREE.Vector3(0, 1, 0);

interface Drawn {
  /** Of the links, base first. */
  placements: readonly THREE.Matrix4[];
  /** Frame of the first row. */
  start: THREE.Matrix4;
  rows: readonly DhRow[];
  frames: readonly { name: string; placement: THREE.Matrix4 }[];
  /** Of the whole arm [m]. */
  size: number;
}

/** Lines of all rows, rebuilt at each change: few and small, from shared geometries. */
export class Skeleton {
  readonly group = new THREE.Group();
  private readonly materials = new Map<string, THREE.MeshBasicMaterial>();
  private readonly labels = new Map<string, THREE.SpriteMaterial>();

  /** @param chosen Index of the bright row; null: all. */
  update({ placements, start, rows, frames, size }: Drawn, tool: THREE.Matrix4, chosen: number | null): void {
    this.group.clear();
    rows.forEach((row, index) => {
      const before = index === 0 ? start : placements[index];
      const after = placements[index + 1];
      if (!before || !after) return;
      const bright = chosen === null || chosen === index;
      const from = position(before);
      const axis = new THREE.Vector3().setFromMatrixColumn(before, 2);
      const foot = position(before.clone().multiply(alongAxis(row)));
      const half = (AXIS_LENGTH * size) / 2;
      const end = from.clone().addScaledVector(axis, half + Math.max(0, row.d));
      this.line(from.clone().addScaledVector(axis, -half + Math.min(0, row.d)), end, AXIS, bright, size, 0.6);
      this.arrow(end, axis, AXIS, bright, size);
      this.label(`z${subscript(index)}`, end.clone().addScaledVector(axis, 0.05 * size), LETTERS, bright);
      this.line(from, foot, OFFSET, bright, size, 1.6);
      this.line(foot, position(after), NORMAL, bright, size, 1.6);
      this.frame(after, size, bright);
    });
    const first = placements[0];
    if (first) this.frame(first, size, chosen === null);
    if (!first?.equals(start)) this.frame(start, size, chosen === null || chosen === 0);
    for (const { name, placement } of [...frames, { name: "tool", placement: tool }]) {
      const beside = new THREE.Vector3().setFromMatrixColumn(placement, 0).multiplyScalar(0.14 * size);
      this.frame(placement, size * 1.5, true);
      this.label(name, position(placement).add(beside), FRAME_LETTERS, true);
    }
  }

  /** Scale letters to a constant size at any distance. */
  scaleLetters(scale: number): void {
    for (const sprite of this.group.children) {
      if (sprite instanceof THREE.Sprite) sprite.scale.set(LABEL_HEIGHT * 4 * scale, LABEL_HEIGHT * scale, 1);
    }
  }

  private frame(at: THREE.Matrix4, size: number, bright: boolean): void {
    const from = position(at);
    ["#e0554d", "#4db35b", "#4f7fe0"].forEach((colour, column) => {
      const direction = new THREE.Vector3().setFromMatrixColumn(at, column);
      this.line(from, from.clone().addScaledVector(direction, FRAME_LENGTH * size), colour, bright, size, 0.8);
    });
  }

  private line(
    from: THREE.Vector3,
    to: THREE.Vector3,
    colour: string,
    bright: boolean,
    size: number,
    width: number,
  ): void {
    const along = to.clone().sub(from);
    const length = along.length();
    if (length < 1e-6) return;
    const mesh = new THREE.Mesh(rod, this.material(colour, bright));
    mesh.position.copy(from);
    mesh.quaternion.setFromUnitVectors(UP, along.divideScalar(length));
    mesh.scale.set(RADIUS * size * width, length, RADIUS * size * width);
    mesh.renderOrder = (bright ? 3 : 1) + (width > 1 ? 1 : 0); // lengths over the axis
    this.group.add(mesh);
  }

  private arrow(at: THREE.Vector3, direction: THREE.Vector3, colour: string, bright: boolean, size: number): void {
    const mesh = new THREE.Mesh(tip, this.material(colour, bright));
    mesh.position.copy(at);
    mesh.quaternion.setFromUnitVectors(UP, direction);
    mesh.scale.set(RADIUS * 2.4 * size, RADIUS * 8 * size, RADIUS * 2.4 * size);
    mesh.renderOrder = bright ? 3 : 2;
    this.group.add(mesh);
  }

  private material(colour: string, bright: boolean): THREE.MeshBasicMaterial {
    const key = `${colour} ${bright}`;
    const known = this.materials.get(key);
    if (known) return known;
    const made = new THREE.MeshBasicMaterial({ color: colour, opacity: bright ? 1 : FAINT, ...ON_TOP });
    this.materials.set(key, made);
    return made;
  }

  private label(text: string, at: THREE.Vector3, colour: string, bright: boolean): void {
    const key = `${text} ${colour} ${bright}`;
    let material = this.labels.get(key);
    if (!material) {
      material = new THREE.SpriteMaterial({
        map: lettering(text, colour),
        opacity: bright ? 1 : FAINT,
        sizeAttenuation: false,
        ...ON_TOP,
      });
      this.labels.set(key, material);
    }
    const sprite = new THREE.Sprite(material);
    sprite.position.copy(at);
    sprite.renderOrder = 5;
    sprite.raycast = () => undefined;
    this.group.add(sprite);
  }

  dispose(): void {
    for (const material of this.materials.values()) material.dispose();
    for (const material of this.labels.values()) {
      material.map?.dispose();
      material.dispose();
    }
  }
}

function position(of: THREE.Matrix4): THREE.Vector3 {
  return new THREE.Vector3().setFromMatrixPosition(of);
}

function subscript(number: number): string {
  return [...String(number)].map((digit) => "₀₁₂₃₄₅₆₇₈₉"[Number(digit)]).join("");
}

function lettering(text: string, colour: string): THREE.CanvasTexture {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [256, 64]; // longer names are compressed
  const pen = canvas.getContext("2d");
  if (pen) {
    pen.font = "600 38px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineWidth = 7;
    pen.strokeStyle = "rgb(0 0 0 / 0.55)";
    pen.lineJoin = "round";
    pen.strokeText(text, 128, 32, 250);
    pen.fillStyle = colour;
    pen.fillText(text, 128, 32, 250);
  }
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  return texture;
}
