// A robot at another site: choice of topics, and a warning about that site's clocks.

import { t } from "../../i18n/texts";
import { isClockOff, useMesh } from "../../mesh/state/site-health";
import { isRemote, selectTopics, TOPIC_SELECTIONS, topicSelection } from "../../scene/topic-selection";
import { Choice } from "../../ui/inputs/choice";
import { Warning } from "../../ui/marks/warning";

export function TopicChoice({ robotKey }: { robotKey: string }) {
  if (!isRemote(robotKey)) return null;
  return (
    <span class="inline-row nowrap small gap-8" title={t("far_hint")}>
      <span class="dim">{t("far_link")}</span>
      <Choice
        label={t("far_link")}
        values={TOPIC_SELECTIONS}
        chosen={topicSelection(robotKey)}
        text={(reach) => t(`far_${reach}`)}
        choose={(reach) => selectTopics(robotKey, reach)}
      />
    </span>
  );
}

/** The clock warning of that site's watch; nothing without a watch. */
export function ClockHint({ site }: { site: string }) {
  const off = useMesh()
    .get(site)
    ?.message.services.find((seen) => seen.site === site && isClockOff(seen));
  if (!off) return null;
  const seconds = Math.abs(off.clockOffsetS ?? 0).toFixed(1);
  return (
    <Warning
      as="span"
      class="trouble warning"
      text={t("clock_off", { host: off.host || off.service, seconds, site })}
    />
  );
}
