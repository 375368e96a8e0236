// Video on a canvas by WebCodecs: decoded on arrival, newest frame drawn.

import { fromBinary } from "@bufbuild/protobuf";
import { CompressedVideoSchema } from "../gen/foxglove/CompressedVideo_pb";
import { VideoFramesSchema } from "../gen/robomesh_pb";
import type { Sample } from "../mesh/console/connection";
import { reasonOf, watch } from "../mesh/console/connection";
import type { Picture } from "../mesh/control/display-freshness";
import { codecName, isKeyFrame } from "./h264";

/** Return whether this browser decodes video here (only over https, or on localhost). */
export const decodesVideo = "VideoDecoder" in window;

export interface VideoListener {
  /** Called for each drawn picture; `step`: how much the video is reduced for this browser's connection. */
  drawn: (picture: Picture, step: number) => void;
  failed: (text: string) => void;
}

/** Play a video key on a canvas until the returned function is called. */
export function playVideo(key: string, canvas: HTMLCanvasElement, listener: VideoListener): () => void {
  const context = canvas.getContext("2d", { alpha: false, desynchronized: true });
  let decoder: VideoDecoder | null = null;
  let codec = "";
  let waiting: VideoFrame | null = null;
  let drawing = 0;
  let clock = 0; // decode order; source times may repeat
  let step = 0;
  const pictures = new Map<number, Picture>();

  const draw = () => {
    drawing = 0;
    const frame = waiting;
    waiting = null;
    if (!frame) return;
    if (canvas.width !== frame.displayWidth) canvas.width = frame.displayWidth;
    if (canvas.height !== frame.displayHeight) canvas.height = frame.displayHeight;
    context?.drawImage(frame, 0, 0);
    listener.drawn(pictures.get(frame.timestamp) ?? null, step);
    for (const time of pictures.keys()) if (time <= frame.timestamp) pictures.delete(time);
    frame.close();
  };
  const begin = (name: string) => {
    if (decoder && decoder.state !== "closed") decoder.close();
    codec = name;
    decoder = new VideoDecoder({
      output: (frame) => {
        waiting?.close();
        waiting = frame;
        drawing ||= requestAnimationFrame(draw);
      },
      error: (error) => {
        codec = ""; // restart at the next key frame
        listener.failed(error.message);
      },
    });
    decoder.configure({ codec: name, optimizeForLatency: true });
  };
  const decode = (data: Uint8Array, picture: Picture) => {
    const key = isKeyFrame(data);
    const name = key ? codecName(data) : null;
    if (name && name !== codec) begin(name);
    if (!codec || decoder?.state !== "configured") return;
    pictures.set(++clock, picture);
    decoder.decode(new EncodedVideoChunk({ type: key ? "key" : "delta", timestamp: clock, data }));
  };
  const take = (sample: Sample) => {
    try {
      if (sample.step !== step) {
        step = sample.step;
        codec = ""; // a new stream begins with a key frame
      }
      if (sample.live) {
        const { sequence, sourceTime, newAt } = sample;
        decode(fromBinary(CompressedVideoSchema, sample.payload).data, { sequence, sourceTime, newAt });
        return;
      }
      for (const frame of fromBinary(VideoFramesSchema, sample.payload).frames) {
        decode(fromBinary(CompressedVideoSchema, frame.data).data, null);
      }
    } catch (error) {
      codec = "";
      listener.failed(reasonOf(error));
    }
  };
  const stop = watch(key, take);
  return () => {
    stop();
    cancelAnimationFrame(drawing);
    waiting?.close();
    if (decoder && decoder.state !== "closed") decoder.close();
  };
}
