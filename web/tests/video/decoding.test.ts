// Video on a canvas, and one picture out of a recording.

import { create, toBinary } from "@bufbuild/protobuf";
import { beforeEach, expect, test, vi } from "vitest";
import { CompressedVideoSchema } from "../../src/gen/foxglove/CompressedVideo_pb";
import { VideoFramesSchema } from "../../src/gen/robomesh_pb";
import { codecName, isKeyFrame } from "../../src/video/h264";
import { drawLast } from "../../src/video/still";
import { connect, newPage, publish, say } from "../console";
import { deltaPicture, keyPicture, stubDecoder } from "./pictures";

test.each([
  ["a key picture", keyPicture(), true, "avc1.42c01f"],
  ["a picture that needs it", deltaPicture(), false, null],
  ["parameters that are cut off", keyPicture().subarray(0, 7), false, null],
  ["parameters without a picture", keyPicture().subarray(0, 8), false, "avc1.42c01f"],
  ["nothing", new Uint8Array(), false, null],
  // What stands in a slice's data is no unit.
  ["a slice with a key slice's bytes", Uint8Array.of(...deltaPicture(), 0, 0, 1, 0x65, 0), false, null],
])("of %s it is known whether a decoder can begin with it", (_, data, isKey, codec) => {
  expect([isKeyFrame(data), codecName(data)]).toEqual([isKey, codec]);
});

test("the last picture of a recording is drawn, in its size, and every frame is freed", async () => {
  const { decoders, drawn, frames } = stubDecoder();
  const canvas = document.createElement("canvas");
  await drawLast([keyPicture(), deltaPicture(), deltaPicture()], canvas);
  expect([drawn, frames.open, canvas.width, canvas.height]).toEqual([[2], 0, 640, 360]);
  expect(decoders[0]).toMatchObject({ types: ["key", "delta", "delta"], codec: "avc1.42c01f", state: "closed" });
});

test.each([
  ["no pictures", [], "no key frame"],
  ["no key picture first", [deltaPicture(), keyPicture()], "no key frame"],
])("of %s nothing is drawn", async (_, pictures, why) => {
  stubDecoder();
  await expect(drawLast(pictures, document.createElement("canvas"))).rejects.toThrow(why);
});

test.each([
  [true, "broken"],
  [false, "no picture"],
])("a decoder that fails (%s) says why", async (fails, why) => {
  stubDecoder();
  vi.stubGlobal(
    "VideoDecoder",
    class {
      constructor(readonly to: { error: (error: Error) => void }) {}
      configure = () => undefined;
      decode = () => fails && this.to.error(new Error("broken"));
      flush = async () => undefined;
      close = () => undefined;
    },
  );
  await expect(drawLast([keyPicture()], document.createElement("canvas"))).rejects.toThrow(why);
});

const KEY = "robomesh/hall/arm/video/front";
const drawnPictures = vi.fn();
const failed = vi.fn();
let stub: ReturnType<typeof stubDecoder>;
let stop: () => void;
let canvas: HTMLCanvasElement;

async function play(): Promise<void> {
  newPage();
  stub = stubDecoder();
  drawnPictures.mockReset();
  failed.mockReset();
  await connect();
  const { playVideo } = await import("../../src/video/video-canvas");
  canvas = document.createElement("canvas");
  stop = playVideo(KEY, canvas, { drawn: drawnPictures, failed });
}
beforeEach(play);

const send = (data: Uint8Array, sequence = 1n) => publish(KEY, CompressedVideoSchema, { data }, { sequence });
const pass = () => vi.advanceTimersByTimeAsync(20);
const steps = () => stub.decoders.map(({ codec, types }) => [codec, ...types]);

test("video begins with a key picture, and each drawn picture is named", async () => {
  send(deltaPicture(), 1n);
  await pass();
  expect(stub.decoders).toEqual([]);
  send(keyPicture(), 2n);
  await pass();
  send(deltaPicture(), 3n);
  await pass();
  expect(drawnPictures.mock.calls.map(([picture, step]) => [picture.sequence, step])).toEqual([
    [2n, 0],
    [3n, 0],
  ]);
  expect([steps(), canvas.width, canvas.height]).toEqual([[["avc1.42c01f", "key", "delta"]], 640, 360]);
});

test("of pictures that come together the newest is drawn, and the others are freed", async () => {
  send(keyPicture(), 1n);
  send(deltaPicture(), 2n);
  send(deltaPicture(), 3n);
  await pass();
  expect([stub.drawn.length, drawnPictures.mock.calls[0]?.[0].sequence, stub.frames.open]).toEqual([1, 3n, 0]);
});

test("pictures since the last key picture are shown, and have no known number", async () => {
  const frames = [keyPicture(), deltaPicture()].map((data) => ({
    data: toBinary(CompressedVideoSchema, create(CompressedVideoSchema, { data })),
  }));
  publish(KEY, VideoFramesSchema, { frames }, { live: false });
  await pass();
  expect(drawnPictures.mock.calls).toEqual([[null, 0]]);
});

test("another codec, and another reduction of the video, begin anew with a key picture", async () => {
  send(keyPicture(0x1f));
  send(keyPicture(0x28), 2n);
  expect(steps().map(([codec]) => codec)).toEqual(["avc1.42c01f", "avc1.42c028"]);
  expect(stub.decoders[0]?.state).toBe("closed");
  const payload = (data: Uint8Array) => toBinary(CompressedVideoSchema, create(CompressedVideoSchema, { data }));
  for (const data of [deltaPicture(), keyPicture(0x28)])
    say({ case: "sample", value: { key: KEY, payload: payload(data), live: true, step: 2 } });
  await pass();
  expect(steps().slice(1)).toEqual([
    ["avc1.42c028", "key"],
    ["avc1.42c028", "key"],
  ]);
  expect(drawnPictures.mock.lastCall?.[1]).toBe(2);
});

test("a decoder that fails is named, and the next key picture begins anew", async () => {
  send(keyPicture());
  stub.decoders[0]?.to.error(new Error("broken"));
  send(deltaPicture(), 2n);
  send(keyPicture(), 3n);
  expect([failed.mock.calls, steps()]).toEqual([
    [["broken"]],
    [
      ["avc1.42c01f", "key"],
      ["avc1.42c01f", "key"],
    ],
  ]);
  say({ case: "sample", value: { key: KEY, payload: Uint8Array.of(255), live: true } });
  expect(failed).toHaveBeenCalledTimes(2);
});

test("after its end nothing is decoded, drawn or kept", async () => {
  send(keyPicture());
  stop();
  send(deltaPicture(), 2n);
  await pass();
  expect([stub.drawn, stub.frames.open, stub.decoders[0]?.state]).toEqual([[], 0, "closed"]);
  stop();
});
