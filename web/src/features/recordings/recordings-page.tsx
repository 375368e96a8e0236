// Recordings: the list and the player.

import "../../ui/replay.css";
import type { RecordingName } from "../../ui/route";
import { List } from "./recording-list";
import { Player } from "./player";

export function Recordings({ shown }: { shown: readonly RecordingName[] }) {
  const [first, second] = shown;
  if (!first) return <List />;
  const key = shown.map(({ site, file }) => `${site}/${file}`).join(" ");
  return <Player key={key} first={first} second={second ?? null} />;
}
