// A form that shelves alarms for a time, with a reason.

import { useState } from "preact/hooks";
import { alarmText } from "../../i18n/alarm-text";
import { eventsText as e } from "../../i18n/texts";
import type { Alarm } from "../../mesh/services/alarms";
import { Choice } from "../../ui/inputs/choice";
import { ReasonForm } from "../../ui/inputs/reason-form";

const TIMES = { minutes_15: 900, hour: 3600, hours_8: 28_800, day: 86_400 } as const;
type Time = keyof typeof TIMES;

export function ShelveForm(props: {
  alarms: readonly Alarm[];
  close: () => void;
  done: (reason: string, shelveS: number) => void;
}) {
  const [time, setTime] = useState<Time>("hour");
  const [first, ...others] = props.alarms;
  return (
    <ReasonForm
      required
      title={e("shelve_do")}
      text={
        others.length
          ? e("shelve_count", { count: props.alarms.length })
          : e("shelve_one", { text: (first && alarmText(first)) ?? first?.text ?? "" })
      }
      does={e("shelve_do")}
      close={props.close}
      done={(reason) => props.done(reason, TIMES[time])}
    >
      <Choice label={e("shelve_for")} values={Object.keys(TIMES) as Time[]} chosen={time} text={e} choose={setTime} />
    </ReasonForm>
  );
}
