// One alarm: priority, state, since when, source, advice, acknowledgement.

import { timestampMs } from "@bufbuild/protobuf/wkt";
import { alarmAdvice, alarmText } from "../../i18n/alarm-text";
import { stampFull, stampTime, stampWhen } from "../../i18n/format";
import type { NameIn } from "../../i18n/texts";
import { eventsText as e } from "../../i18n/texts";
import type { Alarm } from "../../mesh/services/alarms";
import { isUnacknowledged, nameOf, State } from "../../mesh/services/alarms";
import { Button } from "../../ui/inputs/button";
import { PriorityMark } from "../../ui/marks/priority-mark";
import { robotLink } from "../../ui/page/route";

const STATE_WORDS: Partial<Record<State, NameIn<"events">>> = {
  [State.STATE_UNSPECIFIED]: "state_unacknowledged",
  [State.UNACKNOWLEDGED]: "state_unacknowledged",
  [State.ACKNOWLEDGED]: "state_acknowledged",
  [State.RETURNED]: "state_returned",
  [State.SHELVED]: "state_shelved",
};

/** Return an alarm's state; of a newer program's state, its number. */
function stateText(state: State): string {
  const word = STATE_WORDS[state];
  return word ? e(word) : String(state);
}

export function AlarmLine(props: {
  alarm: Alarm;
  selected: boolean;
  select: (on: boolean) => void;
  able: boolean;
  acknowledge: () => void;
  shelve: () => void;
  unshelve: () => void;
}) {
  const { alarm, able } = props;
  const { text, site, robot, state } = alarm;
  const open = isUnacknowledged(alarm);
  const [title, advice] = [alarmText(alarm), alarmAdvice(alarm.code, alarm.advice)];
  const when = alarm.last ?? alarm.since;
  return (
    <li class={`alarm-line grid dim gap-0-12 pad-8-16 ${open ? "open" : ""} ${state === State.RETURNED ? "over" : ""}`}>
      <label class="alarm-select row">
        <input
          type="checkbox"
          checked={props.selected}
          aria-label={e("select", { text: title ?? text })}
          onChange={(event) => props.select(event.currentTarget.checked)}
        />
      </label>
      <PriorityMark of={alarm.priority} />
      <span class="alarm-state">{stateText(state)}</span>
      <time title={stampFull(when)}>{stampTime(when)}</time>
      <span class="alarm-of break">
        {robot === "-" || !robot ? (
          <>
            {site} <span class="dim">{e("whole_site")}</span>
          </>
        ) : (
          <a href={robotLink(site, robot)}>
            {site}/{robot}
          </a>
        )}
      </span>
      <div class="alarm-text">
        {title && <strong>{title}</strong>}
        {!title && <strong lang="en">{text}</strong>}
        {advice && <span>{e("advice", { text: advice })}</span>}
        {title && (
          <span class="dim small">
            {e("in_its_words")} <span lang="en">{text}</span>
          </span>
        )}
        <span class="dim small">
          {more(alarm).join(" · ")} · <code title={e("id_hint")}>{nameOf(alarm)}</code>
        </span>
      </div>
      <span class="alarm-actions flex gap-4">
        {open && (
          <Button
            text={e("acknowledge")}
            disabled={!able}
            aria-label={e("acknowledge_of", { text: title ?? text })}
            onClick={props.acknowledge}
          />
        )}
        {state === State.SHELVED ? (
          <Button
            text={e("unshelve")}
            disabled={!able}
            aria-label={e("unshelve_of", { text: title ?? text })}
            onClick={props.unshelve}
          />
        ) : (
          <Button
            text={e("shelve")}
            disabled={!able}
            aria-label={e("shelve_of", { text: title ?? text })}
            onClick={props.shelve}
          />
        )}
      </span>
    </li>
  );
}

function more(alarm: Alarm): string[] {
  const { count, since, last, returned, by, at, state, shelvedUntil, reason } = alarm;
  const words = [`${alarm.source} · ${alarm.code}`];
  if (since && last && timestampMs(last) > timestampMs(since)) words.push(e("since", { time: stampWhen(since) }));
  if (count > 1) words.push(e("times", { count }));
  if (returned && state === State.RETURNED) words.push(e("over_at", { time: stampWhen(returned) }));
  if (state === State.SHELVED) {
    words.push(e("shelved_by", { by, time: stampWhen(shelvedUntil), reason }));
  } else if (by) words.push(e("by_at", { by, time: stampWhen(at) }));
  return words;
}
