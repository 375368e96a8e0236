// Video of a replay: recorded, or rendered now from the recorded joints.

import { useState } from "preact/hooks";
import type { Description } from "../../../gen/robomesh_pb";
import { viewName } from "../../../i18n/recording-format";
import { recordingsText as r, t } from "../../../i18n/texts";
import type { Replay } from "../../../mesh/services/replay";
import type { MomentState } from "../../../mesh/services/replay-moment";
import { useMomentState } from "../../../mesh/services/replay-moment";
import { viewsOf } from "../../../scene/scene-view";
import { Select } from "../../../ui/inputs/select";
import { Panel } from "../../../ui/panel/panel";
import { useLiveVideo } from "../../../video/live-video";
import { standardView } from "../../../video/requested-view";

const PICTURE_HOLDS_S = 2; // a busy renderer delivers fewer frames than requested

export function ReplayVideo(props: {
  replay: Replay | null;
  /** Whether its joints are of the current moment, as rendered views require. */
  arm: MomentState;
  description: Description | undefined;
  /** Names of its recorded views. */
  recorded: readonly string[];
  title: string;
}) {
  const { replay, description, recorded } = props;
  const [view, setView] = useState("");
  const names = description ? [...recorded, ...viewsOf(description).map(({ name }) => name)] : [];
  const shown = names.includes(view) ? view : (names[0] ?? "");
  const live = useLiveVideo(
    replay?.robotKey ?? "robomesh/-/-",
    replay && shown ? standardView(shown) : null,
    `${props.title}: ${viewName(shown)}`,
  );
  const filmed = recorded.includes(shown);
  const picture = useMomentState(replay, filmed ? `video/${shown}` : "", PICTURE_HOLDS_S);
  const state = filmed ? picture : props.arm;
  const waiting = t("camera_waiting", { view: viewName(shown) });
  const word =
    live.problem ||
    (filmed && !live.video ? r("not_decoded") : "") ||
    (state === "absent" ? r(filmed ? "no_picture_then" : "no_joints_then") : live.any ? "" : waiting);
  return (
    <Panel
      name="camera replayed"
      title={props.title}
      end={
        <>
          <span class="tag replay">{r("replay")}</span>
          {names.length > 0 && (
            <Select label={t("view")} value={shown} values={names} text={viewName} choose={setView} />
          )}
        </>
      }
    >
      <div class="picture grow short anchor" data-moment={state}>
        {live.picture}
        {shown && word && <p class="picture-word dim">{word}</p>}
      </div>
      {!live.video && <p class="footnote dim">{live.problem || t("camera_still")}</p>}
    </Panel>
  );
}
