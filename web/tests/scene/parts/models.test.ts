// Models of the 3-D view: their loading and their paint.

import { BoxGeometry, Color, FrontSide, Group, LineSegments, Mesh, MeshStandardMaterial, Texture } from "three";
import { beforeEach, expect, test, vi } from "vitest";
import {
  colourEdges,
  colourGhost,
  ghostOf,
  loadModel,
  paint,
  readGlb,
  withEdges,
  withMaterials,
} from "../../../src/scene/parts/models";
import { glb } from "../glb";

beforeEach(() => void vi.useFakeTimers());

const answers = (...given: (Response | Error)[]) =>
  vi.stubGlobal("fetch", async () => {
    const answer = given.shift();
    if (answer instanceof Response) return answer;
    throw answer;
  });
const refusal = (status: number, text: string) =>
  new Response(text, { status, headers: { "Content-Type": "text/plain" } });

test("a model is asked for again while its service is not there, and every reason is told", async () => {
  answers(new TypeError("network"), refusal(503, "busy"), refusal(504, "no answer"), new Response(glb()));
  const failed = vi.fn();
  const loaded = loadModel("/mesh/x", undefined, failed);
  await vi.advanceTimersByTimeAsync(5900);
  expect(failed.mock.calls.flat()).toEqual(["this page has no connection to the console", "busy", "no answer"]);
  await vi.advanceTimersByTimeAsync(200);
  expect(await loaded).toBeInstanceOf(Group);
});

test("a model that is refused is not asked for again", async () => {
  answers(refusal(404, "no such mesh"));
  await expect(loadModel("/mesh/x")).rejects.toThrow("no such mesh");
});

test.each([
  ["before it is asked for", 0],
  ["while it is asked for", 1],
  ["while it is read", 2],
])("a model that is not wanted any more %s is not returned", async (_, until) => {
  answers(new Response(glb()), new Error("asked again"));
  let looks = 0;
  expect(await loadModel("/mesh/x", () => looks++ < until)).toBeNull();
});

test("a model that says its vertical is z is not turned", async () => {
  expect((await readGlb(glb("z"))).rotation.x).toBe(0);
  expect((await readGlb(glb("y"))).rotation.x).toBeCloseTo(Math.PI / 2);
  await expect(readGlb(new ArrayBuffer(8))).rejects.toThrow();
});

/** A model of one box, and its part. */
function model(colour = "", own?: MeshStandardMaterial, make = withMaterials) {
  const part = new Mesh(new BoxGeometry(), own);
  const group = make(new Group().add(part), colour);
  return { group, part, material: part.material as MeshStandardMaterial };
}
const hex = ({ color }: MeshStandardMaterial) => `#${color.getHexString()}`;

test("a model keeps its own colour, else it has the description's, else grey", () => {
  const own = new MeshStandardMaterial({ color: "#112233", map: new Texture() });
  expect([hex(model("#445566", own).material), model("", own).material.map]).toEqual(["#112233", own.map]);
  expect([hex(model("#445566").material), hex(model("").material)]).toEqual(["#445566", "#8a8f94"]);
});

test("a model without normals gets them", () => {
  const part = new Mesh(new BoxGeometry());
  part.geometry.deleteAttribute("normal");
  withMaterials(new Group().add(part), "");
  expect(part.geometry.getAttribute("normal").count).toBeGreaterThan(0);
});

const OWN = "#112233";
const STALE = "#7d8387";
test.each([
  ["a live arm", { stale: false, red: false, kind: "arm" }, OWN, 1],
  ["a stale arm", { stale: true, red: false, kind: "arm" }, STALE, 0.38],
  ["a red arm", { stale: false, red: true, kind: "arm" }, "#ff0000", 1],
  ["a red arm that is stale", { stale: true, red: true, kind: "arm" }, "#ff0000", 0.38],
  ["a fixture", { stale: false, red: false, kind: "fixture" }, OWN, 0.7],
] as const)("%s is painted as what it is", (_, as, colour, opacity) => {
  const { group, part, material } = model("", new MeshStandardMaterial({ color: OWN }));
  part.geometry.setAttribute("color", part.geometry.getAttribute("position"));
  paint(group, { stale: true, red: true, kind: "arm" }, "#ff0000"); // the paint before does not shine through
  paint(group, as, "#ff0000");
  expect([hex(material), material.opacity, material.transparent, part.castShadow]).toEqual([
    ...[colour, opacity],
    ...[opacity < 1, opacity === 1],
  ]);
  expect(material.vertexColors).toBe(!as.stale && !as.red);
  expect(material.side === FrontSide).toBe(as.kind === "fixture");
});

test("a neighbour is muted: between its own colour and grey", () => {
  const { group, material } = model("", new MeshStandardMaterial({ color: OWN }));
  paint(group, { stale: false, red: false, kind: "neighbour" }, "#ff0000");
  expect(hex(material)).toBe(`#${new Color(OWN).lerp(new Color(STALE), 0.6).getHexString()}`);
});

test("a fixture without any colour contrasts with the floor, and has edges unless it is too large", () => {
  const grey = () => new MeshStandardMaterial({ color: 0xcccccc });
  const painted = ({ group, material }: ReturnType<typeof model>) => {
    paint(group, { stale: false, red: false, kind: "fixture" }, "");
    return hex(material);
  };
  const bare = model("", grey(), withEdges);
  expect(painted(bare)).toBe("#6f7c88");
  expect(painted(model("#cccccc", grey(), withEdges))).toBe("#cccccc");
  expect(painted(model("", new MeshStandardMaterial({ color: OWN }), withEdges))).toBe(OWN);
  const textured = new MeshStandardMaterial({ color: 0xcccccc, map: new Texture() });
  expect(painted(model("", textured, withEdges))).toBe("#cccccc");
  const [edges] = bare.part.children as LineSegments[];
  expect(edges).toBeInstanceOf(LineSegments);
  colourEdges(bare.group, "#00ff00");
  expect(hex(edges?.material as unknown as MeshStandardMaterial)).toBe("#00ff00");
  const large = new Mesh(new BoxGeometry(1, 1, 1, 130, 130, 130), grey());
  withEdges(new Group().add(large), "");
  expect(large.children).toEqual([]);
});

test("a ghost is hidden at first, translucent, casts no shadow, and leaves its arm's paint alone", () => {
  const { group, material } = model("", new MeshStandardMaterial({ color: OWN }));
  const copy = ghostOf(group);
  colourGhost(copy, "#00ff00", 0.75);
  const part = copy.getObjectByProperty("type", "Mesh") as Mesh;
  const ghost = part.material as MeshStandardMaterial;
  expect([copy.visible, hex(ghost), ghost.opacity, ghost.transparent, part.castShadow]).toEqual([
    ...[false, "#00ff00"],
    ...[0.75, true, false],
  ]);
  expect(hex(material)).toBe(OWN);
});
