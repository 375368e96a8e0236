// A second buffer for software renderers, which would otherwise block the page while they draw.
//
// Without a GPU the browser copies a canvas into the page on the page's own thread, and waits there until the canvas
// is drawn. A frame is therefore drawn into this buffer first, and copied to the canvas when it is complete.

import * as THREE from "three";

/** A method of three's renderer that its types omit. */
interface Undeclared {
  setRenderTargetFramebuffer(target: THREE.WebGLRenderTarget, framebuffer: WebGLFramebuffer | null): void;
}

export class BackBuffer {
  private readonly gl: WebGL2RenderingContext;
  private readonly target = new THREE.WebGLRenderTarget(1, 1);
  private framebuffer: WebGLFramebuffer | null = null;
  private buffers: WebGLRenderbuffer[] = [];

  constructor(private readonly renderer: THREE.WebGLRenderer) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
    // Only so does three draw in the colours of a display, not in linear ones.
    Object.assign(this.target, { isXRRenderTarget: true });
    this.target.texture.colorSpace = THREE.SRGBColorSpace;
  }

  /** Set the size [px]. */
  resize(width: number, height: number): void {
    const { gl, renderer, target } = this;
    target.setSize(width, height);
    this.free();
    this.framebuffer = gl.createFramebuffer();
    renderer.state.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    for (const [place, format] of [
      [gl.COLOR_ATTACHMENT0, gl.RGBA8],
      [gl.DEPTH_STENCIL_ATTACHMENT, gl.DEPTH24_STENCIL8],
    ] as const) {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
      this.buffers.push(buffer);
    }
    renderer.state.bindFramebuffer(gl.FRAMEBUFFER, null);
    (renderer as unknown as Undeclared).setRenderTargetFramebuffer(target, this.framebuffer);
  }

  draw(scene: THREE.Scene, camera: THREE.Camera): void {
    this.renderer.setRenderTarget(this.target);
    this.renderer.render(scene, camera);
    this.renderer.setRenderTarget(null);
  }

  /** Copy the drawn frame to the canvas, which gets this buffer's size. */
  show(): void {
    const { gl, renderer } = this;
    const { width, height } = this.target;
    const { domElement: canvas } = renderer;
    if (canvas.width !== width || canvas.height !== height) renderer.setSize(width, height, false);
    renderer.state.bindFramebuffer(gl.READ_FRAMEBUFFER, this.framebuffer);
    renderer.state.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    renderer.state.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
  }

  private free(): void {
    this.gl.deleteFramebuffer(this.framebuffer);
    for (const buffer of this.buffers) this.gl.deleteRenderbuffer(buffer);
    this.buffers = [];
  }

  dispose(): void {
    this.free();
    this.target.dispose();
  }
}
