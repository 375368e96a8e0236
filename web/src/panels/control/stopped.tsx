// What keeps the robot from moving until it is reset: a latched stop, or the controller's own stop or fault.

import type { ControllerState } from "../../gen/robomesh_pb";
import { ControllerState_Activity as Activity } from "../../gen/robomesh_pb";
import { stampFull } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import { isSaid } from "../../i18n/stop-words";
import { t } from "../../i18n/texts";
import { reachable } from "../../mesh/console/connection";
import type { CommandValues } from "../../mesh/control/command";
import { Command } from "../../mesh/control/command";
import { moves, stopText } from "../../mesh/state/robot-state";
import { Button } from "../../ui/inputs/button";

export function Stopped(props: {
  state: ControllerState;
  mine: boolean;
  disobeyed: boolean;
  send: (name: Command, what: string, values: CommandValues) => void;
}) {
  const { state, mine } = props;
  const { stop } = state;
  const moving = props.disobeyed || moves(state);
  const what = stop ? t("reset", { id: String(stop.id) }) : t("reset_own");
  const needs = moving ? t("reset_moving") : t(stop ? "reset_needs" : "own_reset_needs");
  return (
    <div class="stopped row spread gap-16">
      {/* A long text scrolls. */}
      <div role="group" aria-label={t("state_stopped")} tabIndex={0}>
        <strong>
          <span class="shape alarm" aria-hidden="true" />
          <span title={stampFull(stop?.since)}>
            {stop ? stopText(state, props.disobeyed) : t(state.activity === Activity.FAULT ? "own_fault" : "own_stop")}
          </span>
        </strong>
        <p class="small">
          {stop && !stop.sent && `${t("stopped_unsent")} `}
          {isSaid(stop?.reason) && `${t("stop_reason", { reason: reasonText(stop.why, stop.reason) })} `}
          {!stop && state.fault && `${state.fault}. `}
          {needs}
        </p>
      </div>
      <Button
        text={what}
        disabled={!mine || moving || !reachable.value}
        title={moving ? t("reset_moving") : mine ? "" : t("reset_take")}
        onClick={() => props.send(Command.RESET, what, { stopId: stop?.id ?? 0n })}
      />
    </div>
  );
}
