// Video pictures, and a decoder that decodes each into a frame of its number.

import { vi } from "vitest";

const START = [0, 0, 1];
/** A key picture of a codec with a level, and one that needs it. */
export const keyPicture = (level = 0x1f) =>
  Uint8Array.of(0, ...START, 0x67, 0x42, 0xc0, level, ...START, 0x68, 1, ...START, 0x65, 9);
export const deltaPicture = () => Uint8Array.of(...START, 0x41, 9, 9);

/** Stub the browser's video decoder; return what it was given. */
export function stubDecoder() {
  const decoders: Decoder[] = [];
  const drawn: number[] = [];
  const frames = { open: 0, width: 640 };
  class Decoder {
    state = "unconfigured";
    codec = "";
    types: string[] = [];
    constructor(readonly to: { output: (frame: unknown) => void; error: (error: Error) => void }) {
      decoders.push(this);
    }
    configure({ codec }: { codec: string }): void {
      Object.assign(this, { codec, state: "configured" });
    }
    decode({ type, timestamp }: { type: string; timestamp: number }): void {
      this.types.push(type);
      frames.open++;
      const close = () => void frames.open--;
      this.to.output({ timestamp, displayWidth: frames.width, displayHeight: 360, close });
    }
    flush = async () => undefined;
    close = () => void (this.state = "closed");
  }
  vi.stubGlobal("VideoDecoder", Decoder);
  vi.stubGlobal(
    "EncodedVideoChunk",
    class {
      constructor(of: object) {
        Object.assign(this, of);
      }
    },
  );
  const context = { drawImage: ({ timestamp }: { timestamp: number }) => drawn.push(timestamp) };
  vi.spyOn(HTMLCanvasElement.prototype, "getContext").mockReturnValue(context as never);
  return { decoders, drawn, frames };
}
