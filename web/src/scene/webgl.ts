// WebGL set-up that every 3-D picture of the page shares: renderer, size, frame timing, disposal.

import * as THREE from "three";

/** Return whether the browser draws 3-D on the main processor, without a GPU.
 *
 * @throws Error if it has no WebGL. */
export function drawsInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) throw new Error("no WebGL");
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const name = names ? String(context.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** Create a renderer; on a software renderer it spares antialiasing and extra pixels.
 *
 * @throws Error if the browser has no WebGL. */
export function makeRenderer(software: boolean, canvas?: HTMLCanvasElement): THREE.WebGLRenderer {
  const renderer = new THREE.WebGLRenderer({ ...(canvas && { canvas }), antialias: !software, alpha: false });
  renderer.setPixelRatio(software ? 1 : Math.min(devicePixelRatio, 2));
  return renderer;
}

/** Map bright colours softly to the display's range. */
export function toneMap(renderer: THREE.WebGLRenderer): void {
  renderer.toneMapping = THREE.ACESFilmicToneMapping;
  renderer.toneMappingExposure = 1.05;
}

/** Size a renderer to the element around its canvas; return the aspect ratio. */
export function fitToParent(renderer: THREE.WebGLRenderer): number {
  const canvas = renderer.domElement;
  const box = (canvas.parentElement ?? canvas).getBoundingClientRect();
  const width = Math.max(1, Math.floor(box.width));
  const height = Math.max(1, Math.floor(box.height));
  renderer.setSize(width, height, false);
  return width / height;
}

/** Call `resized` when the element around a canvas changes its size. */
export function observeSize(canvas: HTMLCanvasElement, resized: () => void): ResizeObserver {
  const observer = new ResizeObserver(resized);
  observer.observe(canvas.parentElement ?? canvas);
  return observer;
}

/** Count the frames of a canvas, for tests. */
export function countFrame({ dataset }: HTMLCanvasElement): void {
  dataset.drawn = String(Number(dataset.drawn ?? 0) + 1);
}

/** The time that the GPU needs for a frame, by a fence behind its commands. */
export class FrameFence {
  private sync: WebGLSync | null = null;
  private startedAt = 0;
  private readonly gl: WebGL2RenderingContext;

  /** `drawn` receives each frame's duration and the time when its end was noticed [ms]. */
  constructor(
    renderer: THREE.WebGLRenderer,
    private readonly drawn: (tookMs: number, at: number) => void,
  ) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
  }

  /** Set the fence behind a frame that began at a time of the page's clock [ms]. */
  start(startedAt: number): void {
    this.sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
    this.startedAt = startedAt;
  }

  /** Return whether no frame is being drawn. A lost context draws none. */
  isIdle(at: number): boolean {
    const { gl, sync } = this;
    if (!sync) return true;
    if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) return false;
    gl.deleteSync(sync);
    this.sync = null;
    this.drawn(at - this.startedAt, at);
    return true;
  }
}

/** Free the GPU memory of a scene's parts, and its renderer. */
export function disposeScene(scene: THREE.Scene, renderer: THREE.WebGLRenderer): void {
  scene.traverse((part) => {
    if (!(part instanceof THREE.Mesh || part instanceof THREE.Line)) return;
    part.geometry.dispose();
    for (const material of [part.material].flat() as THREE.Material[]) material.dispose();
  });
  renderer.dispose();
}
