// The operator in control of the robot, and that operator's commands.

import { useState } from "preact/hooks";
import type { ControllerState, Description, Lease } from "../../gen/robomesh_pb";
import { ControllerState_Activity as Activity, ControllerState_Known as Known } from "../../gen/robomesh_pb";
import { t } from "../../i18n/texts";
import { isMonitor } from "../../mesh/console/account";
import { reachable } from "../../mesh/console/connection";
import type { CommandValues } from "../../mesh/control/command";
import { Command, command } from "../../mesh/control/command";
import { controlNotice, holds } from "../../mesh/control/control";
import { whyFrozen } from "../../mesh/control/display-freshness";
import type { Motion } from "../../mesh/control/notice-expiry";
import { useNoticeExpiry } from "../../mesh/control/notice-expiry";
import {
  isOnlyWatched,
  stoppedByItself,
  whyNoCommand,
  whyNoMotion,
  whyNoNewMotion,
} from "../../mesh/state/robot-state";
import type { Latest } from "../../mesh/state/topics";
import { now } from "../../mesh/state/topics";
import { Button } from "../../ui/inputs/button";
import { NoticeLine } from "../../ui/panel/notice-line";
import { Panel } from "../../ui/panel/panel";
import { mayNotCommand } from "./no-control";
import { RecoverButton, RecoverForm } from "./recover";
import { Speed } from "./speed";
import { Stopped } from "./stopped";
import { Holder, WhoControls } from "./who-controls";

export function ControlPanel(props: {
  robotKey: string;
  controller: Latest<ControllerState> | undefined;
  /** The operator in control; empty: none; null: not known. */
  holder: string | null;
  lease: Lease | undefined;
  description: Description | undefined;
  motion: Motion;
  disobeyed: boolean;
}) {
  const { robotKey, holder } = props;
  const state = props.controller?.message;
  const mine = holds(robotKey);
  const [recovering, setRecovering] = useState(false);
  const frozen = whyFrozen(robotKey, now.value);
  const why = reachable.value ? whyNoNewMotion(state) || frozen : t("no_connection");
  const canSend = mine && reachable.value && !state?.stop && !state?.readOnly;
  const lacks = (name: Command) => whyNoCommand(state, name);
  const send = (name: Command, what: string, values?: CommandValues, positions?: number[]) =>
    void command(robotKey, name, what, values, undefined, positions);
  const home = () =>
    send(
      Command.HOME,
      t("home"),
      {},
      props.description?.joints.map((joint) => joint.home),
    );
  useNoticeExpiry(controlNotice.value, (notice) => (controlNotice.value = notice), props.motion);
  if (isOnlyWatched(state)) {
    return (
      <Panel name="control" title={t("control")}>
        <p class="no-control pad-8-16">{why}</p>
      </Panel>
    );
  }
  const holding = state?.activity === Activity.HOLDING;
  const tracing = state?.trace === Known.YES;
  return (
    <Panel
      name={`control ${mine ? "mine" : ""}`}
      title={t("control")}
      end={<Holder robotKey={robotKey} holder={holder} lease={props.lease} />}
    >
      <WhoControls robotKey={robotKey} holder={holder} lease={props.lease} readOnly={state?.readOnly ?? false} />
      {isMonitor.value || (
        <div class="command-row flex gap-8 pad-0-16-8">
          <Button
            text={t("home")}
            data-moves
            disabled={!mine || !!why || !!lacks(Command.HOME)}
            title={mine ? lacks(Command.HOME) || why : ""}
            onClick={home}
          />
          {holding ? (
            <Button
              primary
              text={t("resume")}
              data-moves
              disabled={!mine || !reachable.value || whyNoMotion(state) !== "" || frozen !== ""}
              onClick={() => send(Command.RESUME, t("resume"))}
            />
          ) : (
            <Button
              text={t("hold")}
              data-moves
              disabled={!canSend || !!lacks(Command.HOLD)}
              title={lacks(Command.HOLD)}
              onClick={() => send(Command.HOLD, t("hold"))}
            />
          )}
          <Button
            text={t(tracing ? "trace_off" : "trace_on")}
            disabled={!mine || !reachable.value || state?.readOnly || !!lacks(Command.TRACE_ON)}
            title={lacks(Command.TRACE_ON)}
            aria-pressed={tracing}
            onClick={() => (tracing ? send(Command.TRACE_OFF, t("trace_off")) : send(Command.TRACE_ON, t("trace_on")))}
          />
          <RecoverButton state={state} mine={mine} open={() => setRecovering(true)} />
        </div>
      )}
      {recovering && mine && <RecoverForm robotKey={robotKey} state={state} close={() => setRecovering(false)} />}
      <div class="slot">
        {state && (state.stop || stoppedByItself(state)) ? (
          <Stopped state={state} mine={mine} disobeyed={props.disobeyed} send={send} />
        ) : (
          isMonitor.value || (
            <Speed
              percent={state?.speedPercent}
              enabled={canSend && !state?.program && !lacks(Command.SPEED)}
              send={(value) => command(robotKey, Command.SPEED, t("what_speed", { value }), { speedPercent: value })}
            />
          )
        )}
      </div>
      <NoticeLine
        notice={controlNotice.value}
        idle={
          state?.readOnly || !reachable.value
            ? why
            : !mine
              ? mayNotCommand()
                ? ""
                : t("take_first")
              : state?.stop
                ? ""
                : why || t("taken")
        }
      />
    </Panel>
  );
}
