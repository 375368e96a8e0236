// Every tile's arm, drawn by one WebGL context: a few tiles a frame, the longest waiting first, within a budget.

import { effect } from "@preact/signals";
import * as THREE from "three";
import type { Description } from "../../gen/robomesh_pb";
import { floorOf } from "../../mesh/state/clearance";
import { DrawLoop } from "../../scene/canvas/draw-loop";
import { countFrame, drawsInSoftware, makeRenderer } from "../../scene/canvas/webgl";
import { palette } from "../../scene/parts/surroundings";
import { theme } from "../../ui/page/theme";
import { type TileArm, tileArmOf } from "./tile-arm";

const FIELD_OF_VIEW = 28; // degrees, upright
const CAMERA_DIRECTION = new THREE.Vector3(1.1, -1.7, 0.8).normalize();
const MOST_AT_ONCE = 6;
const COLUMNS = 3;
const FEW = 6; // up to so many tiles are drawn at the display's rate
const FEW_INTERVAL_MS = 15;
const MANY_INTERVAL_MS = 90;
const SLOW_BATCH_MS = 12; // a slower batch becomes smaller, and is followed by as long a pause
const SCROLLED_MS = 150;
const PAUSE_FACTOR = 3; // pause after a batch, in the times that it held up the page

/** One tile's picture. */
export class TilePicture {
  drawnAt = 0;
  dirty = true;
  stale = false;
  private from: readonly number[] = [];
  private to: readonly number[] = [];
  private arrived = 0;
  private span = 0;

  constructor(
    readonly canvas: HTMLCanvasElement,
    readonly rig: TileArm,
    private readonly smooth: boolean,
    readonly floor: THREE.Matrix4 | null,
    private readonly changed: () => void,
  ) {}

  /** Set the joint positions [rad] or [m] that arrived at a time of the page's clock [ms]. */
  take(positions: readonly number[], arrived: number): void {
    if (this.to.length && positions.every((value, i) => value === this.to[i])) return;
    this.span = Math.min(arrived - this.arrived, 250);
    this.from = this.smooth && this.to.length ? this.to : positions;
    this.to = positions;
    this.arrived = arrived;
    this.dirty = true;
    this.changed();
  }

  setStale(stale: boolean): void {
    if (stale === this.stale) return;
    this.stale = stale;
    this.dirty = true;
    this.changed();
  }

  /** Whether all meshes and a position are known. */
  get ready(): boolean {
    return this.rig.complete && this.to.length > 0;
  }

  /** Return joint positions interpolated between the last two states, delayed by their interval. */
  at(time: number): readonly number[] {
    const share = this.span > 0 ? Math.min(1, (time - this.arrived) / this.span) : 1;
    this.dirty = share < 1 && this.from !== this.to;
    return this.to.map((end, i) => (this.from[i] ?? end) + (end - (this.from[i] ?? end)) * share);
  }
}

/** Return the placement of a disc on the floor of a robot's cell, in its base frame; null: no floor. */
function floorInBase(description: Description): THREE.Matrix4 | null {
  const height = floorOf(description);
  if (height === null) return null;
  const base = new THREE.Matrix4();
  if (description.baseToSite.length === 16) base.fromArray(description.baseToSite).transpose();
  const { x, y } = new THREE.Vector3().setFromMatrixPosition(base);
  return base.invert().multiply(new THREE.Matrix4().makeTranslation(x, y, height));
}

class Pictures {
  private readonly software = drawsInSoftware();
  private readonly renderer = makeRenderer(this.software);
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 16 / 9, 0.05, 40);
  private readonly floor = new THREE.Mesh(new THREE.CircleGeometry(1, 48), new THREE.MeshBasicMaterial());
  private readonly tiles = new Set<TilePicture>();
  private width = 0;
  private height = 0;
  private atOnce = 2;
  private readonly loop: DrawLoop;

  constructor() {
    this.loop = new DrawLoop(this.renderer, this.drawBatch, this.batchDrawn);
    this.camera.up.set(0, 0, 1);
    this.floor.matrixAutoUpdate = false;
    this.renderer.setPixelRatio(1);
    this.renderer.setScissorTest(true);
    const key = new THREE.DirectionalLight("#fff8ee", 2.2);
    key.position.set(1.6, -2.2, 3.4);
    const sky = new THREE.HemisphereLight("#f4f7fa", "#5b5f63", 2);
    sky.position.set(0, 0, 1);
    this.scene.add(key, sky, this.floor);
    this.renderer.domElement.addEventListener("webglcontextrestored", () => this.drawAll());
    // A software renderer shares the processor with scrolling: let scrolling go first.
    const scrolled = () => this.loop.pauseUntil(performance.now() + SCROLLED_MS);
    if (this.software) addEventListener("scroll", scrolled, { capture: true, passive: true });
    effect(() => {
      void theme.value;
      queueMicrotask(() => {
        const colours = palette();
        this.scene.background = new THREE.Color(colours.background);
        this.floor.material.color.set(colours.floor);
        this.drawAll();
      });
    });
  }

  private drawAll(): void {
    for (const tile of this.tiles) tile.dirty = true;
    this.loop.wake();
  }

  add(canvas: HTMLCanvasElement, prefix: string, description: Description): TilePicture {
    const rig = tileArmOf(prefix, description, () => this.drawAll());
    const tile = new TilePicture(canvas, rig, !this.software, floorInBase(description), this.loop.wake);
    this.tiles.add(tile);
    this.loop.wake();
    return tile;
  }

  remove(tile: TilePicture): void {
    this.tiles.delete(tile);
  }

  private readonly drawBatch = (at: number): boolean => {
    const each = this.tiles.size <= FEW ? FEW_INTERVAL_MS : MANY_INTERVAL_MS;
    const dirty = [...this.tiles].filter((tile) => tile.dirty && tile.ready);
    const due = dirty.filter((tile) => at - tile.drawnAt >= each).sort((a, b) => a.drawnAt - b.drawnAt);
    const batch = due.slice(0, this.atOnce);
    if (batch.length) this.draw(batch, at);
    if (dirty.length > batch.length || batch.some((tile) => tile.dirty)) this.loop.wake();
    return batch.length > 0;
  };

  private readonly batchDrawn = (tookMs: number, at: number): void => {
    const slow = tookMs > 2 * SLOW_BATCH_MS; // it includes a frame of the display
    this.atOnce = Math.min(MOST_AT_ONCE, Math.max(1, this.atOnce + (slow ? -1 : 1)));
    if (slow) this.loop.pauseUntil(at + tookMs);
  };

  private draw(tiles: readonly TilePicture[], at: number): void {
    this.fit(tiles);
    const { width, height, renderer } = this;
    tiles.forEach((tile, i) => {
      this.look(tile, tile.canvas.width / tile.canvas.height);
      tile.rig.pose(tile.at(at));
      tile.rig.setStale(tile.stale);
      this.scene.add(tile.rig.group);
      const [x, y] = [(i % COLUMNS) * width, Math.floor(i / COLUMNS) * height];
      renderer.setViewport(x, y, tile.canvas.width, tile.canvas.height);
      renderer.setScissor(x, y, tile.canvas.width, tile.canvas.height);
      renderer.render(this.scene, this.camera);
      this.scene.remove(tile.rig.group);
      tile.drawnAt = at;
    });
    const source = renderer.domElement;
    tiles.forEach(({ canvas }, i) => {
      const [x, y] = [(i % COLUMNS) * width, source.height - Math.floor(i / COLUMNS) * height - canvas.height];
      canvas
        .getContext("2d", { alpha: false })
        ?.drawImage(source, x, y, canvas.width, canvas.height, 0, 0, canvas.width, canvas.height);
      countFrame(canvas);
    });
    this.loop.pauseUntil(at + PAUSE_FACTOR * (performance.now() - at));
  }

  /** Size the canvases to their tiles, and the renderer to hold a batch of the largest. */
  private fit(tiles: readonly TilePicture[]): void {
    const ratio = this.software ? 1 : Math.min(devicePixelRatio, 1.5);
    for (const { canvas } of tiles) {
      const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) =>
        Math.max(1, Math.round(side * ratio)),
      );
      if (canvas.width !== width) canvas.width = width ?? 1;
      if (canvas.height !== height) canvas.height = height ?? 1;
    }
    const width = Math.max(...tiles.map((tile) => tile.canvas.width));
    const height = Math.max(...tiles.map((tile) => tile.canvas.height));
    if (width === this.width && height === this.height) return;
    this.width = width;
    this.height = height;
    this.renderer.setSize(width * COLUMNS, height * Math.ceil(MOST_AT_ONCE / COLUMNS), false);
  }

  private look({ rig: { bounds }, floor }: TilePicture, aspect: number): void {
    const distance = bounds.radius / Math.sin(THREE.MathUtils.degToRad(FIELD_OF_VIEW / 2));
    this.camera.aspect = aspect;
    this.camera.position.copy(bounds.center).addScaledVector(CAMERA_DIRECTION, distance);
    this.camera.lookAt(bounds.center);
    this.camera.updateProjectionMatrix();
    this.floor.visible = floor !== null;
    if (floor) this.floor.matrix.copy(floor).scale(new THREE.Vector3().setScalar(bounds.radius * 0.8));
  }
}

let pictures: Pictures | null | undefined;

/** Return the renderer of all tiles; null: this browser has no WebGL. */
export function tilePictures(): Pictures | null {
  if (pictures === undefined) {
    try {
      pictures = new Pictures();
    } catch {
      pictures = null;
    }
  }
  return pictures;
}
