// Puts alarms aside for a while, with a reason. It is no modal dialog: STOP stays within reach.

import { useEffect, useRef, useState } from "preact/hooks";
import { Choice } from "../parts";
import { t } from "../texts";
import type { Alarm } from "./alarms";
import { e } from "./texts";

const TIMES = { minutes_15: 900, hour: 3600, hours_8: 28_800, day: 86_400 } as const;
type Time = keyof typeof TIMES;

export function Shelve(props: {
  alarms: readonly Alarm[];
  close: () => void;
  done: (reason: string, shelveS: number) => void;
}) {
  const [reason, setReason] = useState("");
  const [time, setTime] = useState<Time>("hour");
  const input = useRef<HTMLInputElement>(null);
  const opener = useRef(document.activeElement);
  useEffect(() => {
    input.current?.focus();
    return () => opener.current instanceof HTMLElement && opener.current.focus();
  }, []);
  const [first, ...others] = props.alarms;
  return (
    <form
      class="reason shelve"
      aria-label={e("shelve_do")}
      onKeyDown={(event) => event.key === "Escape" && props.close()}
      onSubmit={(event) => {
        event.preventDefault();
        if (!reason.trim()) return;
        props.close();
        props.done(reason.trim(), TIMES[time]);
      }}
    >
      <p>
        {others.length
          ? e("shelve_count", { count: props.alarms.length })
          : e("shelve_one", { text: first?.text ?? "" })}
      </p>
      <Choice
        label={e("shelve_for")}
        values={Object.keys(TIMES) as Time[]}
        chosen={time}
        text={e}
        choose={setTime}
      />
      <label>
        <span class="dim">{e("reason")}</span>
        <input
          ref={input}
          type="text"
          autocomplete="off"
          maxLength={120}
          value={reason}
          onInput={(event) => setReason(event.currentTarget.value)}
        />
      </label>
      <div class="reason-row">
        <button type="button" class="action" onClick={props.close}>
          {t("cancel")}
        </button>
        <button type="submit" class="action primary" disabled={!reason.trim()}>
          {e("shelve_do")}
        </button>
      </div>
    </form>
  );
}
