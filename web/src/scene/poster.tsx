// The renderer's last picture of the robot, in the place of the 3-D view until that can draw.

import { useState } from "preact/hooks";
import { whenText } from "../i18n/format";
import { t, viewText } from "../i18n/texts";
import { presence } from "../mesh/console/connection";

// A renderer that has just started has no picture yet.
const RETRY_MS = 1000;

/** `why`: what the 3-D view waits for, in words. */
export function Poster({ robotKey, view, why }: { robotKey: string; view: string; why: string }) {
  const [, site = "", robot = ""] = robotKey.split("/");
  // Without a renderer there is no picture to ask for.
  const rendered = [...presence.value].some((key) => key.startsWith(`robomesh/${site}/-/alive/renderer/`));
  const src = `/image/${encodeURIComponent(site)}/${encodeURIComponent(robot)}/${encodeURIComponent(view)}.jpg`;
  const [shown, setShown] = useState<{ src: string; at: number } | null>(null);
  const [tries, setTries] = useState(0);
  const known = shown?.src === src ? shown : null;
  return (
    <>
      {rendered && (
        <img
          key={`${src} ${tries}`}
          class="poster"
          src={src}
          alt={t("poster_of", { robot, view: viewText(view) })}
          hidden={!known}
          onLoad={() => setShown({ src, at: Date.now() })}
          onError={() => setTimeout(() => setTries((count) => count + 1), RETRY_MS)}
        />
      )}
      <p class={known ? "poster-word" : "scene-word dim"} role="status">
        {known ? t("poster", { time: whenText(known.at), why }) : why}
      </p>
    </>
  );
}
