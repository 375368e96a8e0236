// The most urgent alarm, above the robot's page: an arm that does not obey its stop, or a critical event.

import { useState } from "preact/hooks";
import type { ControllerState, Event } from "../gen/robomesh_pb";
import { Event_Severity as Severity } from "../gen/robomesh_pb";
import { stampFull, stampMs, stampWhen } from "../i18n/format";
import { t } from "../i18n/texts";
import { DISOBEYED, disobeys, msBefore } from "../mesh/state/robot-state";
import { Button } from "../ui/inputs/button";

const SHOWN_MS = 600_000; // unless it is dismissed before

export function RobotAlarm({ state, events }: { state: ControllerState | undefined; events: readonly Event[] }) {
  const [dismissed, setDismissed] = useState(0);
  if (disobeys(state, events)) {
    return (
      <div class="over-page">
        <div class="alarm-band row large bold gap-4 pad-8-16" role="alert">
          <span class="shape alarm" aria-hidden="true" />
          {t("disobeys")}
        </div>
      </div>
    );
  }
  const event = events.find(({ severity }) => severity === Severity.CRITICAL);
  const at = stampMs(event?.timestamp);
  if (!event || at <= dismissed || (state && msBefore(state, event.timestamp) > SHOWN_MS)) return null;
  const time = stampWhen(event.timestamp);
  return (
    <div class="over-page">
      <div class="alarm-band row large bold gap-4 pad-8-16 past" role="alert">
        <span class="shape alarm" aria-hidden="true" />
        <span title={stampFull(event.timestamp)}>
          {event.code === DISOBEYED ? t("disobeyed", { time }) : t("critical_at", { time, text: event.text })}
        </span>
        <Button quiet text={t("dismiss")} onClick={() => setDismissed(at)} />
      </div>
    </div>
  );
}
