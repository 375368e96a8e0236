// This console, how the page reaches it, and the signed-in account.

import type { ToPage_Hello as Hello } from "../../gen/robomesh_pb";
import { DASH } from "../../i18n/format";
import { settingsText as s } from "../../i18n/texts";
import { lostAt } from "../../mesh/console/connection";
import { Panel } from "../../ui/panel/panel";
import { Facts } from "./facts";

const LOOPBACK = /^(localhost|127\.\d+\.\d+\.\d+|\[::1\])$/;

export function ThisConsole({ hello }: { hello: Hello | null }) {
  const connected = lostAt.value === null && hello?.connected === true;
  const secured = location.protocol === "https:";
  const loopback = LOOPBACK.test(location.hostname);
  return (
    <Panel name="this-console" title={s("this_console")}>
      <Facts
        of={[
          [s("site"), hello?.site || DASH],
          [s("version"), hello?.version || DASH],
          [s("address"), location.host],
          [
            s("transport"),
            <Marked key="transport" wrong={!secured && !loopback}>
              {s(secured ? "transport_tls" : loopback ? "transport_loopback" : "transport_open")}
            </Marked>,
          ],
          [
            s("router"),
            <Marked key="router" wrong={!connected}>
              {s(connected ? "router_up" : "router_down")}
            </Marked>,
          ],
          [s("signed_in"), signedIn(hello)],
        ]}
      />
    </Panel>
  );
}

function signedIn(hello: Hello | null): string {
  if (!hello) return DASH;
  if (!hello.account) return s("no_accounts");
  const { account, operator } = hello;
  return `${s("signed_in_as", { account, operator })}: ${s(hello.mayCommand ? "may_command" : "may_watch")}`;
}

export function Marked({ wrong, children }: { wrong: boolean; children: string }) {
  return (
    <span class={wrong ? "state warning" : ""}>
      {wrong && <span class="shape warning" aria-hidden="true" />}
      {children}
    </span>
  );
}
