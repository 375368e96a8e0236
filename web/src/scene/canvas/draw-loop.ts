// Drawing on demand: an idle page requests no animation frame, because each makes the browser prepare a whole frame.

import type { WebGLRenderer } from "three";

const POLL_MS = 8; // half a frame of the display

/** Draws after `wake` at the display's rate, but no frame before the GPU has finished the last. */
export class DrawLoop {
  private readonly gl: WebGL2RenderingContext;
  private sync: WebGLSync | null = null;
  private startedAt = 0;
  private request = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private wanted = false;
  private drawing = false;
  private pausedUntil = 0;
  private ended = false;

  /**
   * @param draw Draws at a time of the page's clock [ms]; returns whether it drew anything.
   * @param drawn Receives each frame's duration and the time when its end was noticed [ms]. */
  constructor(
    renderer: WebGLRenderer,
    private readonly draw: (at: number) => boolean,
    private readonly drawn: (tookMs: number, at: number) => void = () => undefined,
  ) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
  }

  /** Draw as soon as possible. */
  readonly wake = (): void => {
    this.wanted = true;
    if (this.drawing || this.ended || this.request || this.timer !== undefined) return;
    this.request = requestAnimationFrame(this.frame);
  };

  /** Draw nothing until a time of the page's clock [ms]. */
  pauseUntil(time: number): void {
    this.pausedUntil = Math.max(this.pausedUntil, time);
  }

  /** End a pause. */
  hurry(): void {
    this.pausedUntil = 0;
    if (this.sync) return; // its end follows soon
    clearTimeout(this.timer);
    this.timer = undefined;
    this.wake();
  }

  private readonly frame = (): void => {
    this.request = 0;
    const at = performance.now();
    if (at < this.pausedUntil) {
      this.wait(this.pausedUntil - at);
      return;
    }
    this.wanted = false;
    this.drawing = true;
    const drew = this.draw(at);
    this.drawing = false;
    if (drew) {
      this.startedAt = at;
      this.sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      this.gl.flush();
      this.wait(POLL_MS);
    } else if (this.wanted) this.wake();
  };

  private wait(ms: number): void {
    this.timer = setTimeout(this.resume, ms);
  }

  private readonly resume = (): void => {
    this.timer = undefined;
    const { gl, sync } = this;
    if (sync) {
      // A lost context draws nothing.
      if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) {
        this.wait(POLL_MS);
        return;
      }
      gl.deleteSync(sync);
      this.sync = null;
      const at = performance.now();
      this.drawn(at - this.startedAt, at);
    }
    if (this.wanted) this.wake();
  };

  dispose(): void {
    this.ended = true;
    cancelAnimationFrame(this.request);
    clearTimeout(this.timer);
  }
}
