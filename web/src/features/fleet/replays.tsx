// Running replays, separate from the live robots.

import type { ReplayState } from "../../gen/robomesh_pb";
import { ReplayStateSchema } from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { momentText } from "../../i18n/recording-format";
import { recordingsText as r } from "../../i18n/texts";
import { ageOf, isStale } from "../../mesh/state/staleness";
import { useTopics } from "../../mesh/state/topics";
import { ReplayTag } from "../../ui/marks/replay-tag";
import { recordingsLink, robotLink } from "../../ui/page/route";
import "../../ui/marks/replay.css";
import "./replays.css";

export function RunningReplays() {
  const states = useTopics(ReplayStateSchema, "robomesh/*/*/replay");
  const shown = [...states.values()].filter((latest) => !isStale("replay", ageOf(latest)));
  if (shown.length === 0) return null;
  return (
    <section class="site" aria-label={r("replays")}>
      <div class="site-head flex wrap baseline gap-16">
        <h2>{r("replays")}</h2>
        <span class="dim small">{r("replays_words")}</span>
      </div>
      <ul>
        {shown.map(({ key, message }) => (
          <Line key={key} site={key.split("/")[1] ?? ""} state={message} />
        ))}
      </ul>
    </section>
  );
}

function Line({ site, state }: { site: string; state: ReplayState }) {
  return (
    <li class="replay-line row wrap tall-44 pad-0-16">
      <a href={robotLink(site, state.robot)}>
        <ReplayTag robot={state.ofRobot} start={stampMs(state.start)} />
      </a>
      <span class="figure">
        {r("position_of", { position: momentText(state.positionS, 0), duration: momentText(state.durationS, 0) })}
      </span>
      <span class="dim">{state.playing ? `${r("playing")}, ${state.speed}×` : r("paused")}</span>
      <a class="page-link" href={recordingsLink({ site, file: state.file })}>
        {r("to_recording")}
      </a>
    </li>
  );
}
