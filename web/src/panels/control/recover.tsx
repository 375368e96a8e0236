// Recovery of a controller after its own stop or fault: what the site file allows, with a reason and a look.

import { useState } from "preact/hooks";
import type { ControllerState } from "../../gen/robomesh_pb";
import { Recover_Recovery as Recovery } from "../../gen/robomesh_pb";
import { t } from "../../i18n/texts";
import { reachable } from "../../mesh/console/connection";
import { Command, command } from "../../mesh/control/command";
import { moves } from "../../mesh/state/robot-state";
import { ReasonForm } from "../../ui/inputs/reason-form";

const NAMES = {
  [Recovery.UNLOCK_PROTECTIVE_STOP]: "recover_unlock",
  [Recovery.CLOSE_SAFETY_POPUP]: "recover_popup",
  [Recovery.RESTART_SAFETY]: "recover_safety",
  [Recovery.POWER_ON]: "recover_power",
  [Recovery.BRAKE_RELEASE]: "recover_brakes",
  [Recovery.SERVO_ON]: "recover_servo",
  [Recovery.RESET_ALARM]: "recover_alarm",
  [Recovery.CONFIRM_TOOL]: "recover_tool",
} as const;

type Named = keyof typeof NAMES;

const named = (recovery: Recovery): recovery is Named => recovery in NAMES;

/** Return the recoveries that the robot's site file allows. */
const allowed = (state: ControllerState | undefined): Named[] => (state?.capabilities?.recoveries ?? []).filter(named);

/** Return the names of what can be sent to bring the controller back. */
export const recoveryNames = (state: ControllerState): string[] =>
  allowed(state)
    .filter((recovery) => recovery !== Recovery.CONFIRM_TOOL)
    .map((recovery) => t(NAMES[recovery]));

/** The button, if the site file allows a recovery. */
export function RecoverButton(props: { state: ControllerState | undefined; mine: boolean; open: () => void }) {
  const { state, mine } = props;
  if (allowed(state).length === 0) return null;
  const moving = moves(state);
  return (
    <button
      class="action recover"
      disabled={!mine || !reachable.value || moving}
      title={mine && moving ? t("recover_moving") : ""}
      onClick={props.open}
    >
      {t("recover")}
    </button>
  );
}

/** The form: an action, a look and a reason. Nothing is chosen before. */
export function RecoverForm(props: { robotKey: string; state: ControllerState | undefined; close: () => void }) {
  const [chosen, setChosen] = useState<Named | null>(null);
  const [looked, setLooked] = useState(false);
  const send = (reason: string) => {
    if (chosen === null) return;
    const recover = { recovery: chosen, reason, looked };
    void command(props.robotKey, Command.RECOVER, t(NAMES[chosen]), { recover });
  };
  return (
    <ReasonForm
      required
      incomplete={chosen === null || !looked}
      title={t("recover_title")}
      text={t("recover_says")}
      does={t("recover_send")}
      close={props.close}
      done={send}
    >
      <fieldset class="recoveries">
        <legend class="dim small">{t("recover_which")}</legend>
        {allowed(props.state).map((each) => (
          <label key={each}>
            <input type="radio" name="recovery" checked={chosen === each} onChange={() => setChosen(each)} />
            {t(NAMES[each])}
          </label>
        ))}
      </fieldset>
      <label class="looked">
        <input type="checkbox" checked={looked} onChange={(event) => setLooked(event.currentTarget.checked)} />
        {t("recover_looked")}
      </label>
    </ReasonForm>
  );
}
