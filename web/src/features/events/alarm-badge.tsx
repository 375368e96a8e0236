// The alarm badge of every page: unacknowledged alarms by priority; grey while there is none.

import { useEffect } from "preact/hooks";
import { e } from "../../i18n/events";
import { anyWatch, counts, followAlarms, silentSites } from "../../mesh/alarms";
import { startSound } from "../../panels/alarm-sound";
import { PriorityMark, priorityWord } from "../../ui/priority-mark";
import "./alarm-badge.css";

export function AlarmBadge() {
  useEffect(() => {
    const ends = [followAlarms(), startSound()];
    return () => {
      for (const end of ends) end();
    };
  }, []);
  const counted = counts.value;
  const silent = silentSites();
  const words = silent.length
    ? e("badge_silent", { sites: silent.join(", ") })
    : !anyWatch.value
      ? e("badge_unknown")
      : counted.length
        ? e("badge", { counts: counted.map(({ priority, count }) => `${count} ${priorityWord(priority)}`).join(", ") })
        : e("badge_none");
  return (
    <a class={`alarm-badge ${counted.length ? "" : "calm"}`} href="#/events" title={words}>
      <span class="unseen">{words}</span>
      {silent.length > 0 && <span class="shape warning" aria-hidden="true" />}
      <span class="badge-counts" aria-hidden="true">
        {counted.map(({ priority, count }) => (
          <PriorityMark key={priority} of={priority}>
            {count}
          </PriorityMark>
        ))}
        {counted.length === 0 && e(silent.length ? "badge_stale" : anyWatch.value ? "badge_calm" : "badge_dash")}
      </span>
    </a>
  );
}
