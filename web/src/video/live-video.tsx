// A live picture of a robot: video if this browser decodes it, otherwise a sequence of stills.

import { fromBinary } from "@bufbuild/protobuf";
import type { JSX, RefObject } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { CompressedImageSchema } from "../gen/foxglove/CompressedImage_pb";
import { t } from "../i18n/texts";
import { watch } from "../mesh/console/connection";
import type { Picture } from "../mesh/control/display-freshness";
import { useShownView } from "../mesh/control/display-freshness";
import { isStale } from "../mesh/state/staleness";
import { now } from "../mesh/state/topics";
import type { RequestedView } from "./requested-view";
import { isStandardView, receiveView } from "./requested-view";
import { decodesVideo, playVideo } from "./video-canvas";

const QUIET_MS = 4000;
const STILL_FPS = 10;
const REDUCED_STILL = { width: 640, height: 360 };

export interface LiveVideo {
  picture: JSX.Element | null;
  /** Its canvas or image, for saving. */
  place: RefObject<HTMLCanvasElement | null> | RefObject<HTMLImageElement | null>;
  /** Whether there is a picture. */
  any: boolean;
  /** Age of the picture [s]; null: not known. */
  age: number | null;
  stale: boolean;
  /** Reduction for this browser's connection; 0: none. */
  step: number;
  /** Whether it is video. */
  video: boolean;
  /** Why there is no picture or no video; empty: no problem. */
  problem: string;
}

/** Show the live picture of a view; null: none for now. */
export function useLiveVideo(robotKey: string, wanted: RequestedView | null, label: string): LiveVideo {
  const canvas = useRef<HTMLCanvasElement>(null);
  const image = useRef<HTMLImageElement>(null);
  const [video, setVideo] = useState(decodesVideo);
  const [problem, setProblem] = useState("");
  const [still, setStill] = useState<string | null>(null);
  const [any, setAny] = useState(false);
  const [step, setStep] = useState(0);
  // Read while drawing; its changes need no drawing.
  const [drawn] = useState<{ newAt: number | null; at: number }>({ newAt: null, at: 0 });
  const identity = wanted && JSON.stringify(wanted);
  const place = video ? canvas : image;
  const shown = useShownView(robotKey, wanted?.of ?? "", "video/*", () => place.current);

  useEffect(() => {
    drawn.newAt = null;
    shown.picture = undefined;
    setProblem("");
    setStep(0);
    if (!wanted) return;
    drawn.at = performance.now();
    const showPicture = (picture: Picture, reduced: number) => {
      shown.picture = picture;
      drawn.newAt = picture?.newAt ?? null;
      drawn.at = performance.now();
      setAny(true);
      setProblem("");
      setStep(reduced);
    };
    // Stills need many times the bytes of video: limit their size and rate.
    const request = video || !isStandardView(wanted) ? wanted : { ...wanted, ...REDUCED_STILL, fps: STILL_FPS };
    return receiveView(
      robotKey,
      request,
      (keys) => {
        if (video && canvas.current) {
          return playVideo(keys.video, canvas.current, {
            drawn: showPicture,
            failed: (text) => {
              setProblem(t("camera_failed", { text }));
              setVideo(false);
            },
          });
        }
        return watch(keys.image, (sample) => {
          const { data, format } = fromBinary(CompressedImageSchema, sample.payload);
          const blob = new Blob([data as Uint8Array<ArrayBuffer>], { type: `image/${format || "jpeg"}` });
          setStill((old) => (old && URL.revokeObjectURL(old), URL.createObjectURL(blob)));
          showPicture(sample, 0);
        });
      },
      () => performance.now() - drawn.at > QUIET_MS,
      setProblem,
    );
  }, [robotKey, identity, video]);
  // The state of another robot's or view's picture does not apply.
  useEffect(() => () => setAny(false), [robotKey, wanted?.of]);

  const at = now.value; // triggers drawing
  const age = drawn.newAt === null ? null : Math.max(0, (at - drawn.newAt) / 1000);
  // Until a picture of this view comes, the last one of another view is not shown.
  const style = any ? "" : "visibility: hidden";
  const picture = video ? (
    <canvas ref={canvas} data-drawn={any} role="img" aria-label={label} style={style} />
  ) : (
    still && <img ref={image} src={still} alt={label} style={style} />
  );
  return {
    picture: picture || null,
    place,
    any,
    age,
    stale: any && isStale("video/*", age),
    step,
    video,
    problem,
  };
}
