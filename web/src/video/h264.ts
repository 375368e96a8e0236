// Properties of an H.264 stream that a decoder needs: key frames, and the codec's name.

const SLICE = 1;
const KEY_SLICE = 5;
const PARAMETERS = 7;

function* units(data: Uint8Array): Generator<{ kind: number; at: number }> {
  for (let i = 0; i + 3 < data.length; i++) {
    if (data[i] !== 0 || data[i + 1] !== 0 || data[i + 2] !== 1) continue;
    const kind = (data[i + 3] ?? 0) & 0x1f;
    yield { kind, at: i + 3 };
    if (kind === SLICE || kind === KEY_SLICE) return; // slice data follows
    i += 3;
  }
}

/** Return whether a picture (Annex B) can be decoded without earlier pictures. */
export function isKeyFrame(data: Uint8Array): boolean {
  for (const { kind } of units(data)) if (kind === KEY_SLICE) return true;
  return false;
}

/** Return the codec's name from the sequence parameter set, as "avc1.42c01f"; null without one. */
export function codecName(data: Uint8Array): string | null {
  for (const { kind, at } of units(data)) {
    if (kind !== PARAMETERS || at + 3 >= data.length) continue;
    const hex = [...data.subarray(at + 1, at + 4)].map((byte) => byte.toString(16).padStart(2, "0"));
    return `avc1.${hex.join("")}`;
  }
  return null;
}
