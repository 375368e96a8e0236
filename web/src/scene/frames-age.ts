// Age of the 3-D view's frames, measured without decoding them.

import { useEffect, useState } from "preact/hooks";
import { watch } from "../mesh/console/connection";
import { now } from "../mesh/state/topics";

/** Return the age [s] of the newest frames; null: not known; undefined: none have arrived yet. */
export function useFramesAge(robotKey: string, topic: string): number | null | undefined {
  const [last] = useState<{ newAt: number | null | undefined }>({ newAt: undefined });
  useEffect(() => watch(`${robotKey}/${topic}`, (sample) => (last.newAt = sample.newAt)), [robotKey, topic]);
  const at = now.value; // triggers drawing
  return last.newAt == null ? last.newAt : Math.max(0, (at - last.newAt) / 1000);
}
