// Why this account cannot take control, and what it can do about it.

import { useState } from "preact/hooks";
import { accountText as a } from "../../i18n/texts";
import { isMonitor, mayAct, me, unlock } from "../../mesh/console/account";
import { Button } from "../../ui/inputs/button";
import { PasswordField } from "../../ui/inputs/password-field";
import { submit } from "../../ui/inputs/submit";
import { useOutcome } from "../../ui/panel/outcome";
import "../account-form.css";

/** Return whether the signed-in account may not request control now. */
export function mayNotCommand(): boolean {
  return isMonitor.value || !mayAct.value;
}

export function NoControl() {
  const [password, setPassword] = useState("");
  const { notice, isBusy, perform } = useOutcome();
  if (isMonitor.value)
    return <p class="no-control pad-8-16">{a("monitor_only", { account: me.value?.account ?? "" })}</p>;
  const send = async () => {
    if (isBusy) return;
    await perform("", async () => void (await unlock(password)));
    setPassword("");
  };
  return (
    <form class="no-control pad-8-16" aria-label={a("unlock")} onSubmit={submit(() => void send())}>
      <p>{a("unlock_says")}</p>
      <input type="text" name="username" autocomplete="username" value={me.value?.account} readOnly hidden />
      <PasswordField label={a("password")} kind="current-password" value={password} set={setPassword} />
      <p class="sign-in-problem" role="alert">
        {notice?.text}
      </p>
      <Button primary text={a(isBusy ? "unlocking" : "unlock")} type="submit" disabled={isBusy} />
    </form>
  );
}
