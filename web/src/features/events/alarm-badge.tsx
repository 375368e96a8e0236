// The alarm badge of every page: the most urgent unacknowledged alarms, in words; grey without alarms.

import { useEffect } from "preact/hooks";
import { eventsText as e } from "../../i18n/texts";
import { anyWatch, counts, followAlarms, silentSites } from "../../mesh/services/alarms";
import { startSound } from "../../panels/alarm-sound";
import { PriorityMark, priorityWord } from "../../ui/marks/priority-mark";
import "./alarm-badge.css";

/** Return "3 high". */
const numbered = ({ priority, count }: (typeof counts.value)[number]) => `${count} ${priorityWord(priority)}`;

export function AlarmBadge() {
  useEffect(() => {
    const ends = [followAlarms(), startSound()];
    return () => {
      for (const end of ends) end();
    };
  }, []);
  const counted = counts.value;
  const [worst] = counted;
  const others = counted.slice(1).reduce((sum, { count }) => sum + count, 0);
  const silent = silentSites();
  const words = silent.length
    ? e("badge_silent", { sites: silent.join(", ") })
    : !anyWatch.value
      ? e("badge_unknown")
      : counted.length
        ? e("badge", { counts: counted.map(numbered).join(", ") })
        : e("badge_none");
  return (
    <a
      class={`alarm-badge inline-row nowrap anchor tall-32 ${counted.length ? "" : "calm"}`}
      href="#/events"
      title={words}
    >
      <span class="unseen">{words}</span>
      {silent.length > 0 && <span class="shape warning" aria-hidden="true" />}
      <span class="inline-row gap-8" aria-hidden="true">
        {worst ? (
          <>
            <PriorityMark of={worst.priority}>{numbered(worst)}</PriorityMark>
            {others > 0 && <span class="dim">+{others}</span>}
          </>
        ) : (
          e(silent.length ? "badge_stale" : anyWatch.value ? "badge_calm" : "badge_dash")
        )}
      </span>
    </a>
  );
}
