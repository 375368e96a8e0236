// WebGL set-up that every 3-D picture of the page shares: renderer, size, disposal.

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

/** Return the size of the element around a canvas [CSS px]. */
export function parentSize(canvas: HTMLCanvasElement): { width: number; height: number } {
  const box = (canvas.parentElement ?? canvas).getBoundingClientRect();
  return { width: Math.max(1, Math.floor(box.width)), height: Math.max(1, Math.floor(box.height)) };
}

/** Size a renderer to the element around its canvas; return the aspect ratio. */
export function fitToParent(renderer: THREE.WebGLRenderer): number {
  const { width, height } = parentSize(renderer.domElement);
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

/** Free the GPU memory of a scene's parts, and its renderer. */
export function disposeScene(scene: THREE.Scene, renderer: THREE.WebGLRenderer): void {
  scene.traverse((part) => {
    if (!(part instanceof THREE.Mesh || part instanceof THREE.Line)) return;
    part.geometry.dispose();
    for (const material of [part.material].flat() as THREE.Material[]) material.dispose();
  });
  renderer.dispose();
}
