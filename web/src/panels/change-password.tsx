// A form for the account's new password.

import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { accountText as a } from "../i18n/texts";
import type { Me } from "../mesh/console/account";
import { me, post } from "../mesh/console/account";
import { reasonOf } from "../mesh/console/connection";
import { RefusedRequest } from "../mesh/console/refusal";
import { Button } from "../ui/inputs/button";
import { PasswordField } from "../ui/inputs/password-field";
import { submit } from "../ui/inputs/submit";
import "./account-form.css";

export function ChangePassword({ close }: { close: () => void }) {
  const [oldPassword, setOldPassword] = useState("");
  const [newPassword, setNewPassword] = useState("");
  const [repeated, setRepeated] = useState("");
  const [outcome, setOutcome] = useState<{ done: boolean; text: string } | null>(null);
  const [busy, setBusy] = useState(false);
  const form = useRef<HTMLFormElement>(null);
  // Pass Escape to the sheet, and focus the first field.
  const focusFirst = () => form.current?.querySelector<HTMLInputElement>("input:not([hidden])")?.focus();
  useLayoutEffect(focusFirst, []);
  // An outcome belongs to the passwords that were sent.
  const entered = (set: (value: string) => void) => (value: string) => {
    setOutcome(null);
    set(value);
  };
  const send = async () => {
    if (busy) return;
    if (newPassword !== repeated) {
      setOutcome({ done: false, text: a("differ") });
      return;
    }
    setOutcome(null);
    setBusy(true);
    try {
      me.value = await post<Me>("password", { password: oldPassword, new: newPassword });
      setOutcome({ done: true, text: a("changed") });
    } catch (error) {
      const text = reasonOf(error);
      setOutcome({ done: false, text: a("not_changed", { text }) });
      if (error instanceof RefusedRequest && error.reason?.code === "account.password_wrong") {
        setOldPassword("");
        focusFirst();
      }
    }
    setBusy(false);
  };
  return (
    <form ref={form} aria-label={a("change_password")} onSubmit={submit(() => void send())}>
      {/* For password managers: the account's name. */}
      <input type="text" name="username" autocomplete="username" value={me.value?.account} readOnly hidden />
      <PasswordField
        label={a("old_password")}
        kind="current-password"
        value={oldPassword}
        set={entered(setOldPassword)}
      />
      <PasswordField
        label={a("new_password")}
        kind="new-password"
        value={newPassword}
        set={entered(setNewPassword)}
        hint={a("new_hint")}
      />
      <PasswordField label={a("new_again")} kind="new-password" value={repeated} set={entered(setRepeated)} />
      <p class={outcome && !outcome.done ? "sign-in-problem" : ""} role="status">
        {outcome?.text ?? "\u00a0"}
      </p>
      <div class="flex to-end gap-8">
        <Button text={a(outcome?.done ? "close" : "cancel")} type="button" onClick={close} />
        {!outcome?.done && <Button primary text={a(busy ? "changing" : "change")} type="submit" disabled={busy} />}
      </div>
    </form>
  );
}
