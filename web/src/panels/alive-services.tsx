// Live services of a robot or a site, by presence.

import { t } from "../i18n/texts";
import { presence } from "../mesh/console/connection";
import { OPERATOR } from "../mesh/state/known-robots";

/** `of`: `robomesh/<site>/<robot>`. */
export function AliveServices({ of: key }: { of: string }) {
  const names = new Map<string, number>();
  for (const token of presence.value) {
    if (!token.startsWith(`${key}/alive/`)) continue;
    const service = token.split("/")[4] ?? "";
    if (service === OPERATOR) continue;
    names.set(service, (names.get(service) ?? 0) + 1);
  }
  const shown = [...names].sort(([a], [b]) => a.localeCompare(b));
  return (
    <span class="services flex wrap small dim gap-0-12">
      {shown.length
        ? shown.map(([name, count]) => (
            <span key={name}>
              {name}
              {count > 1 && ` ×${count}`}
            </span>
          ))
        : t("no_services")}
    </span>
  );
}
