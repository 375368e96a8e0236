// Attached clients besides the services: monitors, consoles, operators in control.

import { settingsText as s } from "../../i18n/texts";
import { presence } from "../../mesh/console/connection";
import { OPERATOR } from "../../mesh/state/known-robots";
import { robotSnapshot } from "../../mesh/state/robot-snapshots";
import { robotLink } from "../../ui/page/route";
import { Panel } from "../../ui/panel/panel";

const WATCHERS = new Set(["monitor", "console", "foxglove", "ros2"]);

export function AttachedClients() {
  const lines = [...presence.value].sort().flatMap((token) => {
    const [, site = "", robot = "", , service = "", id = ""] = token.split("/");
    if (service !== OPERATOR && !WATCHERS.has(service)) return [];
    return [{ token, site, robot, service, id }];
  });
  return (
    <Panel name="presence" title={s("presence")}>
      <p class="footnote dim">{s("presence_words")}</p>
      {lines.length === 0 ? (
        <p class="footnote">{s("nobody")}</p>
      ) : (
        <ul class="pad-0-16-12">
          {lines.map(({ token, site, robot, service, id }) => (
            <li key={token} class="row wrap tall-32 gap-0-16">
              <span>{site}</span>
              {service === OPERATOR ? (
                <a href={robotLink(site, robot)}>{`${holder(site, robot)} ${s("in_control_of", { robot })}`.trim()}</a>
              ) : (
                <strong>{word(service)}</strong>
              )}
              <span class="dim">{id}</span>
            </li>
          ))}
        </ul>
      )}
    </Panel>
  );
}

function word(service: string): string {
  return service === "monitor" || service === "console" ? s(service) : service;
}

function holder(site: string, robot: string): string {
  return robotSnapshot(`robomesh/${site}/${robot}`).lease.value?.message.holder ?? "";
}
