// A binary glTF file of one triangle.

const CORNERS = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]);
const [GLB, JSON_CHUNK, BINARY_CHUNK, FLOAT] = [0x46546c67, 0x4e4f534a, 0x004e4942, 5126];

/** Return the file; `up`: what it says about its vertical axis. */
export function glb(up = "z"): ArrayBuffer {
  const content = {
    asset: { version: "2.0", extras: { robomesh: { up } } },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
    accessors: [{ bufferView: 0, componentType: FLOAT, count: 3, type: "VEC3", min: [0, 0, 0], max: [1, 1, 0] }],
    bufferViews: [{ buffer: 0, byteLength: CORNERS.byteLength }],
    buffers: [{ byteLength: CORNERS.byteLength }],
  };
  const text = new TextEncoder().encode(JSON.stringify(content).padEnd(1024));
  const file = new Uint8Array(12 + 8 + text.length + 8 + CORNERS.byteLength);
  const words = new Uint32Array(file.buffer);
  words.set([GLB, 2, file.length, text.length, JSON_CHUNK]);
  words.set([CORNERS.byteLength, BINARY_CHUNK], (20 + text.length) / 4);
  file.set(text, 20);
  file.set(new Uint8Array(CORNERS.buffer), 28 + text.length);
  return file.buffer;
}

/** Return a console that answers each mesh request with the file, as the page's `fetch`. */
export const meshes = (asked: string[] = []) =>
  (async (url: string) => (asked.push(url), new Response(glb()))) as unknown as typeof fetch;
