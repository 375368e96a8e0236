// The renderer's picture of the robot: video where the browser decodes it, stills where not.

import { fromBinary } from "@bufbuild/protobuf";
import { useEffect, useRef, useState } from "preact/hooks";
import { CompressedImageSchema } from "./gen/foxglove/CompressedImage_pb";
import type { Description } from "./gen/robomesh_pb";
import { watch } from "./mesh";
import { Age, Choice, Panel, Toggle } from "./parts";
import { viewsOf, viewText } from "./scene-view";
import { t } from "./texts";
import { isStale, now } from "./topics";
import { decodesVideo, playVideo } from "./video";

export function Camera(props: {
  robotKey: string;
  description: Description | undefined;
  /** Whether it has the large place, and the 3-D view the small one. */
  large: boolean;
  setLarge: (large: boolean) => void;
}) {
  const { robotKey, description } = props;
  const [view, setView] = useState("front");
  const names = viewsOf(description).map((each) => each.name);
  const shown = names.includes(view) ? view : (names[0] ?? "free");
  const [video, setVideo] = useState(decodesVideo);
  const [problem, setProblem] = useState("");
  // undefined: no picture yet.
  const [drawn] = useState<{ newAt: number | null | undefined }>({ newAt: undefined });
  const [any, setAny] = useState(false);
  const canvas = useRef<HTMLCanvasElement>(null);
  const [still, setStill] = useState<string | null>(null);

  useEffect(() => {
    drawn.newAt = undefined;
    setAny(false);
    setProblem("");
    const saw = (newAt: number | null) => {
      drawn.newAt = newAt;
      setAny(true);
    };
    if (video && canvas.current) {
      return playVideo(`${robotKey}/video/${shown}`, canvas.current, {
        drawn: saw,
        failed: (text) => {
          setProblem(t("camera_failed", { text }));
          setVideo(false);
        },
      });
    }
    return watch(`${robotKey}/image/${shown}`, (sample) => {
      const { data, format } = fromBinary(CompressedImageSchema, sample.payload);
      const blob = new Blob([data as Uint8Array<ArrayBuffer>], { type: `image/${format || "jpeg"}` });
      setStill((old) => (old && URL.revokeObjectURL(old), URL.createObjectURL(blob)));
      saw(sample.newAt);
    });
  }, [robotKey, shown, video]);

  const at = now.value; // read in any case: it is what draws this panel again
  const age = drawn.newAt == null ? null : Math.max(0, (at - drawn.newAt) / 1000);
  const stale = any && isStale("video/*", age);
  return (
    <Panel
      name="camera"
      title={t("camera")}
      end={
        <>
          <Age stale={stale} age={age} />
          <Choice label={t("view")} values={names} chosen={shown} text={viewText} choose={setView} />
          <Toggle on={props.large} set={props.setLarge}>
            {t("enlarge")}
          </Toggle>
        </>
      }
    >
      <div class={`picture ${stale ? "stale" : ""}`}>
        {video ? <canvas ref={canvas} data-drawn={any} /> : still && <img src={still} alt={viewText(shown)} />}
        {!any && <p class="picture-word dim">{t("camera_waiting", { view: viewText(shown) })}</p>}
      </div>
      {!video && <p class="footnote dim">{problem || t("camera_still")}</p>}
    </Panel>
  );
}
