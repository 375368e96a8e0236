// Alignment of a second recording with the first: at their starts, or at an event of each.

import { eventText } from "../../../i18n/event-text";
import { momentText } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Warning } from "../../../ui/marks/warning";
import type { RecordingName } from "../../../ui/page/route";
import { recordingsLink } from "../../../ui/page/route";
import type { RecordedEvent } from "../recorded/recorder-requests";

const SHOWN_TEXT = 60;

export function Comparison(props: {
  first: RecordingName;
  name: string;
  problem: string;
  /** The second's time less the first's [s]. */
  shift: number;
  setShift: (shift: number) => void;
  events: readonly RecordedEvent[];
  secondEvents: readonly RecordedEvent[];
  ghosted: boolean;
}) {
  const { name, shift, setShift, events, secondEvents } = props;
  const align = (form: HTMLFormElement) => {
    const at = (field: string, list: readonly RecordedEvent[]) => list[Number(new FormData(form).get(field))]?.at ?? 0;
    setShift(at("second", secondEvents) - at("first", events));
  };
  const words =
    Math.abs(shift) < 0.01
      ? r("compared_same", { name })
      : r("compared", { name, shift: Math.abs(shift).toFixed(2), sense: r(shift > 0 ? "earlier" : "later") });
  return (
    <form
      class="beside row wrap spread gap-8-24"
      onSubmit={(event) => event.preventDefault()}
      onChange={(event) => align(event.currentTarget)}
    >
      <p>
        <strong>{words}</strong> {props.ghosted && <span class="dim">{r("ghost_of", { name })}</span>}
      </p>
      {props.problem && <Warning class="state warning" role="alert" text={props.problem} />}
      <div class="beside-row row wrap narrow gap-8">
        {events.length > 0 && secondEvents.length > 0 && (
          <>
            <span class="dim">{r("align_event")}</span>
            <Events name="first" label={r("align_choose")} events={events} />
            <Events name="second" label={r("align_choose_second")} events={secondEvents} />
          </>
        )}
        <Button text={r("align_starts")} type="reset" disabled={shift === 0} onClick={() => setShift(0)} />
        <a class="action" href={recordingsLink(props.first)}>
          {r("compare_end")}
        </a>
      </div>
    </form>
  );
}

function Events({ name, label, events }: { name: string; label: string; events: readonly RecordedEvent[] }) {
  return (
    <select name={name} aria-label={label}>
      <option value="">{`${label}…`}</option>
      {events.map(({ at, event }, i) => (
        <option key={i} value={String(i)}>
          {`${momentText(at)} ${eventText(event).slice(0, SHOWN_TEXT)}`}
        </option>
      ))}
    </select>
  );
}
