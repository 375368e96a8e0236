// One picture out of recorded video.

import { codecName, isKeyFrame } from "./h264";

/** Decode pictures from a key frame on, and draw the last one.
 *
 * @throws Error if this browser cannot decode them. */
export async function drawLast(pictures: readonly Uint8Array[], canvas: HTMLCanvasElement): Promise<void> {
  const name = pictures[0] && isKeyFrame(pictures[0]) ? codecName(pictures[0]) : null;
  if (!name) throw new Error("no key frame");
  let last: VideoFrame | null = null;
  let failed: Error | null = null;
  const decoder = new VideoDecoder({
    output: (frame) => {
      last?.close();
      last = frame;
    },
    error: (error) => (failed = error),
  });
  decoder.configure({ codec: name, optimizeForLatency: true });
  for (const [number, data] of pictures.entries()) {
    decoder.decode(new EncodedVideoChunk({ type: isKeyFrame(data) ? "key" : "delta", timestamp: number, data }));
  }
  await decoder.flush();
  decoder.close();
  const frame = last as VideoFrame | null;
  if (failed || !frame) throw failed ?? new Error("no picture");
  canvas.width = frame.displayWidth;
  canvas.height = frame.displayHeight;
  canvas.getContext("2d")?.drawImage(frame, 0, 0);
  frame.close();
}
