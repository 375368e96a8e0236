// The mark of everything that is played back, in magenta and in words.

import { timeText } from "../../i18n/format";
import { recordingsText as r } from "../../i18n/texts";
import { Tag } from "./tag";

/** The recorded robot, and the time of the recording. */
export function ReplayTag({ robot, start }: { robot: string; start: number }) {
  return (
    <Tag kind="replay">
      <span class="replay-shape" aria-hidden="true" />
      <span>{r("replay_of", { robot, time: timeText(start) })}</span>
    </Tag>
  );
}
