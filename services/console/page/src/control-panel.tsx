// Who controls the robot, and the commands of whoever does.

import { useState } from "preact/hooks";
import { Command, command, controlNotice, holds, operator, release, setOperator, take } from "./control";
import type { CommandValues } from "./control";
import { fixed, stampFull } from "./format";
import { stopText } from "./robot-state";
import { ControllerState_Activity as Activity, ControllerState_Known as Known } from "./gen/robomesh_pb";
import type { ControllerState, Lease } from "./gen/robomesh_pb";
import { NoticeLine, Panel } from "./parts";
import { t } from "./texts";
import type { Latest } from "./topics";

export function ControlPanel(props: {
  robotKey: string;
  controller: Latest<ControllerState> | undefined;
  /** Who is in control, empty: nobody, null: not known. */
  holder: string | null;
  lease: Lease | undefined;
}) {
  const { robotKey, holder } = props;
  const state = props.controller?.message;
  const mine = holds(robotKey);
  const stopped = state?.stop;
  const can = mine && !stopped && !state?.readOnly;
  const send = (name: Command, what: string, values?: CommandValues) => void command(robotKey, name, what, values);
  const holding = state?.activity === Activity.HOLDING;
  const tracing = state?.trace === Known.YES;
  return (
    <Panel
      name={`control ${mine ? "mine" : ""}`}
      title={t("control")}
      end={<Holder mine={mine} holder={holder} lease={props.lease} />}
    >
      <div class="take-row">
        <label class="operator">
          <span class="dim">{t("operator")}</span>
          <input
            type="text"
            name="operator"
            autocomplete="username"
            spellcheck={false}
            maxLength={40}
            placeholder={t("operator")}
            title={t("operator_hint")}
            value={operator.value}
            disabled={mine}
            onInput={(event) => setOperator(event.currentTarget.value)}
            onKeyDown={(event) => event.key === "Enter" && void take(robotKey)}
          />
        </label>
        {mine ? (
          <button class="action wide" onClick={() => void release()}>
            {t("release")}
          </button>
        ) : (
          <button class="action primary wide" onClick={() => void take(robotKey)} disabled={state?.readOnly ?? false}>
            {t("take")}
          </button>
        )}
      </div>
      <div class="command-row">
        <button class="action" disabled={!can} onClick={() => send(Command.HOME, t("home"))}>
          {t("home")}
        </button>
        {holding ? (
          <button class="action primary" disabled={!can} onClick={() => send(Command.RESUME, t("resume"))}>
            {t("resume")}
          </button>
        ) : (
          <button class="action" disabled={!can} onClick={() => send(Command.HOLD, t("hold"))}>
            {t("hold")}
          </button>
        )}
        <button
          class="action"
          disabled={!mine || state?.readOnly}
          aria-pressed={tracing}
          onClick={() =>
            tracing ? send(Command.TRACE_OFF, t("trace_off")) : send(Command.TRACE_ON, t("trace_on"))
          }
        >
          {t(tracing ? "trace_off" : "trace_on")}
        </button>
      </div>
      {stopped ? (
        <div class="stopped">
          <div>
            <strong>
              <span class="shape alarm" aria-hidden="true" />
              <span title={stampFull(stopped.since)}>
                {stopText(stopped)}
              </span>
            </strong>
            <p>
              {!stopped.sent && `${t("stopped_unsent")} `}
              {stopped.reason && stopped.reason !== "console" && `${stopped.reason}. `}
              {t("reset_needs")}
            </p>
          </div>
          <button
            class="action"
            disabled={!mine}
            title={mine ? "" : t("reset_take")}
            onClick={() => send(Command.RESET, t("reset", { id: String(stopped.id) }), { stopId: stopped.id })}
          >
            {t("reset", { id: String(stopped.id) })}
          </button>
        </div>
      ) : (
        <Speed
          enabled={can}
          send={(value) => command(robotKey, Command.SPEED, t("what_speed", { value }), { speedPercent: value })}
        />
      )}
      <NoticeLine notice={controlNotice.value} idle={state?.readOnly ? t("read_only_text") : mine ? "" : t("take_first")} />
    </Panel>
  );
}

function Holder({ mine, holder, lease }: { mine: boolean; holder: string | null; lease: Lease | undefined }) {
  if (mine) {
    return (
      <span class="holder mine">
        <span class="shape mine" aria-hidden="true" />
        {t("in_control")}
      </span>
    );
  }
  if (holder === null) return <span class="holder dim">{t("holder_unknown")}</span>;
  return (
    <span class="holder" title={holder ? stampFull(lease?.since) : ""}>
      {holder ? t("somebody", { name: holder }) : t("nobody")}
    </span>
  );
}

/** The speed to ask for; a range sends on release, by pointer or by Enter. The controller does not tell its own. */
function Speed({ enabled, send }: { enabled: boolean; send: (percent: number) => Promise<boolean> }) {
  const [sent, setSent] = useState<number | null>(null);
  const [unsent, setUnsent] = useState<number | null>(null);
  const percent = unsent ?? sent;
  const release = () => {
    setUnsent(null);
    if (unsent !== null && enabled) void send(unsent).then((accepted) => accepted && setSent(unsent));
  };
  return (
    <label class={`speed ${percent === null ? "unset" : ""}`}>
      <span class="dim">{t("speed")}</span>
      <input
        type="range"
        min={1}
        max={100}
        step={1}
        value={percent ?? 100}
        disabled={!enabled}
        title={t("speed_hint")}
        aria-valuetext={percent === null ? t("speed_unset") : `${percent} %`}
        onInput={(event) => setUnsent(Number(event.currentTarget.value))}
        onPointerUp={release}
        onPointerCancel={() => setUnsent(null)}
        onBlur={() => setUnsent(null)}
        onKeyDown={(event) => event.key === "Enter" && release()}
      />
      <span class="value">{percent === null ? t("speed_unset") : `${fixed(percent, 0)}\u202f%`}</span>
    </label>
  );
}
