// The live picture of a robot: video, or stills where the browser decodes none.

import { beforeEach, expect, test, vi } from "vitest";
import { CompressedImageSchema } from "../../src/gen/foxglove/CompressedImage_pb";
import { CompressedVideoSchema } from "../../src/gen/foxglove/CompressedVideo_pb";
import { ViewAnswerSchema, ViewRequestSchema, ViewSchema } from "../../src/gen/robomesh_pb";
import type { LiveVideo } from "../../src/video/live-video";
import type { RequestedView } from "../../src/video/requested-view";
import { answer, connect, newPage, next, publish, read, refuse, requests, watched } from "../console";
import { find, pass, texts } from "../hands";
import { hide, show } from "../shown";
import { keyPicture, stubDecoder } from "./pictures";

const ROBOT = "robomesh/hall/arm";
const FRONT = { of: "front", width: 0, height: 0, fps: 0 };
const LARGE = { of: "front", width: 800, height: 450, fps: 5 };
let live: LiveVideo;
let place: HTMLElement;
let draw: (wanted: RequestedView | null, robot?: string) => Promise<void>;

async function begin(decodes = false): Promise<ReturnType<typeof stubDecoder> | null> {
  newPage();
  Reflect.deleteProperty(window, "VideoDecoder");
  const stub = decodes ? stubDecoder() : null;
  await connect({ stale: [{ topic: "video/*", afterS: 2 }] });
  const { useLiveVideo } = await import("../../src/video/live-video");
  const Picture = ({ wanted, robot }: { wanted: RequestedView | null; robot: string }) => {
    live = useLiveVideo(robot, wanted, "Video of arm");
    return live.picture;
  };
  place = show(null);
  draw = async (wanted, robot = ROBOT) => {
    show(<Picture wanted={wanted} robot={robot} />, place);
    await pass();
  };
  return stub;
}
beforeEach(() => void vi.spyOn(URL, "createObjectURL").mockImplementation(() => "blob:1"));

const still = (view = "free-1", more = {}) =>
  publish(`${ROBOT}/image/${view}`, CompressedImageSchema, { data: Uint8Array.of(1), format: "png" }, more);
async function answerView(id = 1): Promise<void> {
  answer(await next(), ViewAnswerSchema, { topic: `video/free-${id}`, image: `image/free-${id}` });
  await pass();
}
const state = () => [live.any, live.stale, live.age === null ? null : Math.round(live.age)];

test("without a picture there is none, and it is not stale", async () => {
  await begin();
  await draw(null);
  expect([[...watched], live.picture, state()]).toEqual([[], null, [false, false, null]]);
  await draw(FRONT);
  await answerView();
  expect([[...watched], state(), live.video]).toEqual([[`${ROBOT}/image/free-1`], [false, false, null], false]);
});

test("stills are shown, and stale when no more come", async () => {
  await begin();
  await draw(FRONT);
  await answerView();
  still();
  await pass(300);
  expect([find<HTMLImageElement>("img").alt, live.place.current, state()]).toEqual([
    ...["Video of arm", find("img"), [true, false, 0]],
  ]);
  const freed = vi.spyOn(URL, "revokeObjectURL");
  await pass(3000);
  expect(state()).toEqual([true, true, 3]);
  still();
  await pass(300);
  expect([state(), freed.mock.calls]).toEqual([[true, false, 0], [["blob:1"]]]);
  still("free-1", { live: false });
  await pass(300);
  expect(state()).toEqual([true, true, null]);
});

test("the last picture of another view is not shown as this one's", async () => {
  await begin();
  await draw(FRONT);
  await answerView();
  still();
  await pass(300);
  await draw({ ...FRONT, of: "top" });
  await answerView(2);
  expect([[...watched], state(), find("img").style.visibility]).toEqual([
    ...[[`${ROBOT}/image/free-2`], [false, false, null], "hidden"],
  ]);
  still("free-2");
  await pass(300);
  expect([live.any, find("img").style.visibility]).toEqual([true, ""]);
});

test.each([
  [FRONT, { of: "front", width: 640, height: 360, fps: 10 }],
  [LARGE, LARGE],
])("stills are few and small, unless the page wants a size (%o)", async (wanted, asked) => {
  await begin();
  await draw(wanted);
  const request = await next();
  expect(request.key).toBe(`${ROBOT}/views/page1`);
  expect(read(request, ViewRequestSchema)).toMatchObject(asked);
});

test("a refused picture is explained, and the standard one is shown in its place", async () => {
  await begin();
  await draw(LARGE);
  refuse(await next(), "too many views");
  await pass();
  expect([live.problem, [...watched]]).toEqual(["too many views", [`${ROBOT}/image/front`]]);
  still("front");
  await pass();
  expect(live.problem).toBe("");
});

test("a camera of one's own has no standard picture", async () => {
  await begin();
  const { create } = await import("@bufbuild/protobuf");
  await draw({ ...LARGE, of: "own", view: create(ViewSchema, { name: "own", eye: { x: 2 } }) });
  const request = await next();
  expect(read(request, ViewRequestSchema)).toMatchObject({ of: "", view: { eye: { x: 2 } } });
  refuse(request, "no");
  await pass();
  expect([live.problem, [...watched]]).toEqual(["no", []]);
});

test("a view whose pictures stop is requested again, and the same answer changes nothing", async () => {
  await begin();
  await draw(LARGE);
  await answerView();
  await pass(3000);
  still("free-1");
  await pass(3100);
  expect(requests).toEqual([]);
  await pass(3000);
  await answerView();
  expect([...watched]).toEqual([`${ROBOT}/image/free-1`]);
  await pass(3000);
  await answerView(2);
  expect([...watched]).toEqual([`${ROBOT}/image/free-2`]);
});

test.each(["answer", "refusal"])("an %s after the end starts nothing", async (end) => {
  await begin();
  await draw(LARGE);
  const request = await next();
  hide(place);
  if (end === "answer") answer(request, ViewAnswerSchema, { topic: "video/free-1", image: "image/free-1" });
  else refuse(request, "no");
  await pass(4000);
  expect([[...watched], requests]).toEqual([[], []]);
});

test("video is drawn where the browser decodes it, and stills where that fails", async () => {
  const stub = await begin(true);
  await draw(FRONT);
  expect([[...watched], live.video, texts("canvas").length, find("canvas").style.visibility]).toEqual([
    ...[[`${ROBOT}/video/front`], true, 1, "hidden"],
  ]);
  publish(`${ROBOT}/video/front`, CompressedVideoSchema, { data: keyPicture() });
  await pass(300);
  expect([state(), find("canvas").dataset.drawn, find("canvas").style.visibility]).toEqual([
    [true, false, 0],
    "true",
    "",
  ]);
  stub?.decoders[0]?.to.error(new Error("broken"));
  await pass();
  await answerView();
  expect([live.video, [...watched]]).toEqual([false, [`${ROBOT}/image/free-1`]]);
});
