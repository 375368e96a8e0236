// A GPU that draws nothing, and says when it has finished.

import type { WebGLRenderer } from "three";
import { vi } from "vitest";

/** Return a renderer; `finished` and `lost` are what its context says. */
export function fakeRenderer() {
  const gpu = { finished: true, lost: false };
  const gl = {
    SIGNALED: 1,
    fenceSync: () => ({}),
    flush: vi.fn(),
    deleteSync: vi.fn(),
    getSyncParameter: () => (gpu.finished ? 1 : 0),
    isContextLost: () => gpu.lost,
  };
  const made = {
    getContext: () => gl,
    shadowMap: { enabled: false },
    render: vi.fn(),
    compile: vi.fn(),
    setSize: vi.fn(),
    setPixelRatio: vi.fn(),
    dispose: vi.fn(),
  };
  return { gpu, gl, made, renderer: made as unknown as WebGLRenderer };
}
