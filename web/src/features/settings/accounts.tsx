// The console's accounts, for an administrator: add, change role or password, disable, remove.

import { useEffect, useState } from "preact/hooks";
import { timeText } from "../../i18n/format";
import { settingsText as s } from "../../i18n/texts";
import { me, post } from "../../mesh/console/account";
import { Button } from "../../ui/inputs/button";
import { Select } from "../../ui/inputs/select";
import { submit } from "../../ui/inputs/submit";
import { TextInput } from "../../ui/inputs/text-input";
import { NoticeLine } from "../../ui/panel/notice-line";
import { useOutcome } from "../../ui/panel/outcome";
import { Panel } from "../../ui/panel/panel";

type Role = "monitor" | "operator" | "engineer" | "admin";
const ROLES: readonly Role[] = ["monitor", "operator", "engineer", "admin"];

interface Account {
  name: string;
  role: Role;
  created: string;
  disabled: boolean;
  sessions: number;
}

type Change = (action: string, name: string, values?: { role?: Role; password?: string }) => Promise<boolean>;

export function Accounts() {
  const [accounts, setAccounts] = useState<readonly Account[]>([]);
  const { notice, perform } = useOutcome((text) => s("not_done", { text }));
  useEffect(() => {
    fetch("/account/accounts", { cache: "no-store" })
      .then(async (answer) => answer.ok && setAccounts(((await answer.json()) as { accounts: Account[] }).accounts))
      .catch(() => undefined); // the page shows separately that the console is gone
  }, []);
  const change: Change = (action, name, values = {}) =>
    perform("", async () => {
      setAccounts((await post<{ accounts: Account[] }>("accounts", { action, name, ...values })).accounts);
      return s("done");
    });
  return (
    <Panel name="accounts" title={s("accounts")}>
      <p class="footnote dim">{s("accounts_words")}</p>
      <div class="table-place" tabIndex={0} role="region" aria-label={s("accounts")}>
        <table class="seen-table wide nowrap">
          <thead>
            <tr>
              {(["account", "role", "state", "created"] as const).map((name) => (
                <th key={name} scope="col">
                  {s(name)}
                </th>
              ))}
              <td />
            </tr>
          </thead>
          <tbody>
            {accounts.map((account) => (
              <Row key={account.name} account={account} change={change} />
            ))}
          </tbody>
        </table>
      </div>
      <AddAccount change={change} />
      <NoticeLine notice={notice} />
    </Panel>
  );
}

function Row({ account, change }: { account: Account; change: Change }) {
  const { name, role, disabled } = account;
  const [openForm, setOpen] = useState<"password" | "remove" | null>(null);
  const own = name === me.value?.account; // prevents locking oneself out
  const run = (action: string, values?: { role?: Role; password?: string }) =>
    void change(action, name, values).then((isDone) => isDone && setOpen(null));
  return (
    <tr class={disabled ? "gone" : ""}>
      <th scope="row">{name}</th>
      <td>
        {own ? (
          s(`role_${role}`)
        ) : (
          <Select
            label={s("role_of", { name })}
            value={role}
            values={ROLES}
            text={(each) => s(`role_${each}`)}
            choose={(chosen) => run("role", { role: chosen })}
          />
        )}
      </td>
      <td>
        {disabled ? s("disabled") : account.sessions ? s("sessions_of", { count: account.sessions }) : s("active")}
      </td>
      <td>{timeText(Date.parse(account.created))}</td>
      <td class="account-actions right">
        {own ? null : openForm === "password" ? (
          <Password of={name} set={(password) => run("password", { password })} close={() => setOpen(null)} />
        ) : openForm === "remove" ? (
          <>
            <span>{s("remove_sure", { name })}</span>
            <Button destructive text={s("remove")} onClick={() => run("remove")} />
            <Button quiet text={s("cancel")} onClick={() => setOpen(null)} />
          </>
        ) : (
          <>
            <Button quiet text={s("set_password")} onClick={() => setOpen("password")} />
            <Button
              quiet
              text={s(disabled ? "enable" : "disable")}
              onClick={() => run(disabled ? "enable" : "disable")}
            />
            <Button quiet destructive text={s("remove")} onClick={() => setOpen("remove")} />
          </>
        )}
      </td>
    </tr>
  );
}

function Password(props: { of: string; set: (password: string) => void; close: () => void }) {
  const [password, setPassword] = useState("");
  return (
    <form class="account-form row wrap gap-8" onSubmit={submit(() => props.set(password))}>
      <TextInput
        type="password"
        autocomplete="new-password"
        aria-label={s("set_password_of", { name: props.of })}
        placeholder={s("new_password")}
        value={password}
        set={setPassword}
      />
      <Button text={s("set_password")} type="submit" disabled={!password} />
      <Button quiet text={s("cancel")} type="button" onClick={props.close} />
    </form>
  );
}

function AddAccount({ change }: { change: Change }) {
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const [role, setRole] = useState<Role>("monitor");
  const add = () =>
    void change("add", name.trim(), { role, password }).then((isDone) => isDone && (setName(""), setPassword("")));
  return (
    <form class="account-form row wrap gap-8" aria-label={s("add")} onSubmit={submit(add)}>
      <strong>{s("add")}</strong>
      <TextInput maxLength={40} hint={s("name")} value={name} set={setName} />
      <TextInput type="password" autocomplete="new-password" hint={s("password")} value={password} set={setPassword} />
      <Select label={s("role")} value={role} values={ROLES} text={(each) => s(`role_${each}`)} choose={setRole} />
      <Button text={s("add_do")} type="submit" disabled={!name.trim() || !password} />
    </form>
  );
}
