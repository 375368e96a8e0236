// Recordings: the list and the player.

import "../../ui/marks/replay.css";
import type { RecordingName } from "../../ui/page/route";
import { RecordingList } from "./list/recording-list";
import { Player } from "./player/player";

export function RecordingsPage({ shown }: { shown: readonly RecordingName[] }) {
  const [first, second] = shown;
  if (!first) return <RecordingList />;
  const key = shown.map(({ site, file }) => `${site}/${file}`).join(" ");
  return <Player key={key} first={first} second={second ?? null} />;
}
