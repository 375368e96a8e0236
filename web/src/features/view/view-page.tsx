// One view of a robot without any control, for frames in other pages: picture, name, state, time.

import { useEffect, useState } from "preact/hooks";
import type { CompressedImage } from "../../gen/foxglove/CompressedImage_pb";
import { CompressedImageSchema } from "../../gen/foxglove/CompressedImage_pb";
import { ControllerStateSchema, DescriptionSchema } from "../../gen/robomesh_pb";
import { stampFull, stampTime, whenText } from "../../i18n/format";
import { t, viewPageText as v, viewText } from "../../i18n/texts";
import { hello, lostAt } from "../../mesh/console/connection";
import { refused } from "../../mesh/console/view-stream";
import { isReplay } from "../../mesh/state/robot-name";
import { stateWord } from "../../mesh/state/robot-state";
import { ageOf, isStale } from "../../mesh/state/staleness";
import { useTopic } from "../../mesh/state/topics";
import { Age, State } from "../../ui/marks/state";
import { Tag } from "../../ui/marks/tag";
import type { ViewName } from "../../ui/page/route";

export function ViewPage({ site, robot, view }: ViewName) {
  const key = `robomesh/${site}/${robot}`;
  const controller = useTopic(ControllerStateSchema, `${key}/controller`);
  const description = useTopic(DescriptionSchema, `${key}/description`);
  const picture = useTopic(CompressedImageSchema, `${key}/image/${view}`);
  const address = usePictureAddress(picture?.message);
  const label = `${robot}, ${viewText(view)}`;
  useEffect(() => void (document.title = `${label} · robomesh`), [label]);
  const age = ageOf(picture);
  const problem = problemText() || (address ? "" : v("waiting"));
  const stale = problem !== "" || isStale("video/*", age);
  return (
    <main class={stale ? "frame stale" : "frame"}>
      <h1 class="unseen">{label}</h1>
      <div class="frame-picture">
        {address && <img src={address} alt={label} />}
        {stale && (
          <p class="frame-notice" role="alert">
            <span class="shape warning" aria-hidden="true" />
            <span>
              {problem} {address && <Age stale age={age} />}
            </span>
          </p>
        )}
      </div>
      <p class="frame-line">
        <State state={stateWord(controller)} />
        <strong class="frame-name">
          <span class="frame-site dim">{site}/</span>
          {robot}
        </strong>
        <span class="frame-camera dim">{viewText(view)}</span>
        {isReplay(robot) ? (
          <Tag kind="replay">{t("replay")}</Tag>
        ) : (
          description?.message.simulated && <Tag kind="simulated">{t("simulated")}</Tag>
        )}
        <time class="frame-time" title={stampFull(picture?.message.timestamp)}>
          {stampTime(picture?.message.timestamp)}
        </time>
      </p>
    </main>
  );
}

/** Describe why nothing is live; empty: nothing is known. */
function problemText(): string {
  if (refused.value) return refused.value;
  if (lostAt.value === 0) return t("connecting");
  if (lostAt.value !== null) return v("lost", { time: whenText(lostAt.value) });
  return hello.value?.connected === false ? v("router_lost") : "";
}

/** Return an address of the newest picture, for an `<img>`. */
function usePictureAddress(image: CompressedImage | undefined): string {
  const [address, setAddress] = useState("");
  useEffect(() => {
    if (!image) return;
    const made = URL.createObjectURL(new Blob([image.data as Uint8Array<ArrayBuffer>], { type: "image/jpeg" }));
    setAddress(made);
    return () => URL.revokeObjectURL(made);
  }, [image]);
  return address;
}
