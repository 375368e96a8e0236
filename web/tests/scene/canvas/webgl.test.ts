// WebGL that every 3-D picture shares.

import { BufferGeometry, Group, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, Scene } from "three";
import { beforeEach, expect, test, vi } from "vitest";
import {
  countFrame,
  disposeScene,
  drawsInSoftware,
  fitToParent,
  makeRenderer,
  observeSize,
  toneMap,
} from "../../../src/scene/canvas/webgl";
import { fakeRenderer } from "./gl";

const made = vi.hoisted(() => ({ options: {} as object, ratio: 0 }));
vi.mock("three", async (original) => ({
  ...(await original<typeof import("three")>()),
  WebGLRenderer: class {
    constructor(options: object) {
      made.options = options;
    }
    setPixelRatio(ratio: number) {
      made.ratio = ratio;
    }
  },
}));

beforeEach(() => void vi.stubGlobal("devicePixelRatio", 3));

test.each([
  ["ANGLE (Google, Vulkan (SwiftShader Device))", true],
  ["llvmpipe (LLVM 15)", true],
  ["Microsoft Basic Render Driver", true],
  ["NVIDIA GeForce RTX", false],
  ["", false],
])("a browser that draws by %o draws in software: %s", (name, software) => {
  const loseContext = vi.fn();
  const extensions = {
    WEBGL_debug_renderer_info: name && { UNMASKED_RENDERER_WEBGL: 7 },
    WEBGL_lose_context: { loseContext },
  };
  const context = {
    getExtension: (of: keyof typeof extensions) => extensions[of],
    getParameter: (of: number) => of === 7 && name,
  };
  vi.spyOn(HTMLCanvasElement.prototype, "getContext").mockReturnValue(context as never);
  expect(drawsInSoftware()).toBe(software);
  expect(loseContext).toHaveBeenCalledOnce();
});

test("a browser without WebGL says so", () => {
  vi.spyOn(HTMLCanvasElement.prototype, "getContext").mockReturnValue(null);
  expect(drawsInSoftware).toThrow("no WebGL");
});

test.each([
  [true, false, 1],
  [false, true, 2],
])("in software (%s) it spares antialiasing and pixels", (software, antialias, ratio) => {
  const canvas = document.createElement("canvas");
  makeRenderer(software, canvas);
  expect(made).toEqual({ options: { canvas, antialias, alpha: false }, ratio });
  makeRenderer(software);
  expect(made.options).not.toHaveProperty("canvas");
});

test("a picture fills the element around it, and follows its size", () => {
  const canvas = document.createElement("canvas");
  const { made: fake, renderer } = fakeRenderer();
  Object.assign(fake, { domElement: canvas });
  expect(fitToParent(renderer)).toBe(1); // of nothing: one pixel
  const parent = document.createElement("div");
  parent.append(canvas);
  vi.spyOn(parent, "getBoundingClientRect").mockReturnValue({ width: 300.7, height: 100.2 } as DOMRect);
  expect(fitToParent(renderer)).toBe(3);
  expect(fake.setSize.mock.calls).toEqual([
    [1, 1, false],
    [300, 100, false],
  ]);
  const observe = vi.spyOn(ResizeObserver.prototype, "observe");
  observeSize(canvas, () => undefined).disconnect();
  observeSize(document.createElement("canvas"), () => undefined).disconnect();
  expect(observe.mock.calls.map(([of]) => of.tagName)).toEqual(["DIV", "CANVAS"]);
  toneMap(renderer);
  expect(renderer.toneMappingExposure).toBe(1.05);
});

test("the frames of a canvas are counted", () => {
  const canvas = document.createElement("canvas");
  countFrame(canvas);
  countFrame(canvas);
  expect(canvas.dataset.drawn).toBe("2");
});

test("the GPU's memory of every mesh and line is freed", () => {
  const { made: fake, renderer } = fakeRenderer();
  const geometry = () => new BufferGeometry();
  const [one, two] = [new MeshBasicMaterial(), new MeshBasicMaterial()];
  const parts = [new Mesh(geometry(), [one, two]), new Line(geometry(), new LineBasicMaterial())];
  const all = [...parts.map((part) => part.geometry), one, two, parts[1]?.material as LineBasicMaterial];
  const freed = all.map((each) => vi.spyOn(each as BufferGeometry, "dispose"));
  disposeScene(new Scene().add(new Group().add(...parts)), renderer);
  for (const each of freed) expect(each).toHaveBeenCalledOnce();
  expect(fake.dispose).toHaveBeenCalledOnce();
});
