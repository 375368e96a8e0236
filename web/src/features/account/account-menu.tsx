// The account menu in the bar: name and role, sign-out, new password.

import { useRef, useState } from "preact/hooks";
import { accountText as a, textIn } from "../../i18n/texts";
import { commandSuspended, isMonitor, me, signOut } from "../../mesh/console/account";
import { hello } from "../../mesh/console/connection";
import { ChangePassword } from "../../panels/change-password";
import { Button } from "../../ui/inputs/button";
import { useDismissal } from "../../ui/panel/dismissal";
import "./account-menu.css";

export function AccountMenu() {
  const menu = useRef<HTMLDetailsElement>(null);
  const [changing, setChanging] = useState(false);
  const close = () => {
    setChanging(false);
    menu.current?.removeAttribute("open");
  };
  useDismissal(menu, close);
  const who = me.value;
  if (!who?.account) return null;
  const { account, role } = who;
  const roleName = textIn("account", `role_${role}`) ?? role;
  const operator = hello.value?.operator || who.operator;
  return (
    <details ref={menu} class="account-menu anchor" aria-label={a("account")}>
      <summary title={a("menu", { account, role: roleName })}>
        <span class="account-name">{account}</span> <span class="account-role small dim">{roleName}</span>
      </summary>
      <div class="account-sheet stack gap-8">
        {changing ? (
          <ChangePassword close={close} />
        ) : (
          <>
            <p>
              <strong>{account}</strong> <span class="dim">{roleName}</span>
            </p>
            <p class="dim">
              {isMonitor.value ? a("may_watch") : commandSuspended.value ? a("rests") : a("may_command", { operator })}
            </p>
            <Button text={a("change_password")} onClick={() => setChanging(true)} />
            <Button text={a("sign_out_everywhere")} onClick={() => void signOut(true)} />
            <Button primary text={a("sign_out")} onClick={() => void signOut(false)} />
          </>
        )}
      </div>
    </details>
  );
}
