// Every service of every site, as the sites' watches report them.

import type { MeshState, MeshState_Seen as Seen } from "../../gen/robomesh_pb";
import { ageText } from "../../i18n/format";
import { settingsText as s } from "../../i18n/texts";
import { presence } from "../../mesh/console/connection";
import { isMeshStale, useMesh } from "../../mesh/state/site-health";
import { ageOf } from "../../mesh/state/staleness";
import type { Latest } from "../../mesh/state/topics";
import { AliveServices } from "../../panels/alive-services";
import { Panel } from "../../ui/panel/panel";
import { DelayChart } from "./delay-chart";
import { COLUMNS, ProcessRow } from "./process-row";

const GONE_TOLD_MS = 900_000;

interface Known {
  seen: Seen;
  /** When it was last reported, on this machine's clock [ms]. */
  at: number;
}

/** Reports of each watch since this page was opened: a service that is no longer reported is shown as gone. */
const known = new Map<string, Map<string, Known>>();

const nameOf = ({ site, service, id }: Seen): string => `${site} ${service} ${id}`;

function remember(site: string, { services }: MeshState): readonly Known[] {
  const reported = known.get(site) ?? new Map<string, Known>();
  known.set(site, reported);
  const now = Date.now();
  for (const seen of services) reported.set(nameOf(seen), { seen, at: now });
  for (const [name, { at }] of reported) if (now - at > GONE_TOLD_MS) reported.delete(name);
  return [...reported].sort(([a], [b]) => a.localeCompare(b)).map(([, each]) => each);
}

export function MeshPanel() {
  const meshes = useMesh();
  const present = [...presence.value].map((token) => token.split("/")[1] ?? "");
  const sites = [...new Set([...meshes.keys(), ...present])].sort();
  return (
    <Panel name="mesh" title={s("mesh")}>
      {meshes.size === 0 && <p class="footnote dim">{s("no_mesh")}</p>}
      {sites.map((site) => {
        const latest = meshes.get(site);
        return latest ? <SiteTable key={site} site={site} latest={latest} /> : <PresentSite key={site} site={site} />;
      })}
    </Panel>
  );
}

/** A site without a watch. */
function PresentSite({ site }: { site: string }) {
  return (
    <div class="site-seen">
      <h3>{site}</h3>
      <AliveServices of={`robomesh/${site}/-`} />
    </div>
  );
}

function SiteTable({ site, latest }: { site: string; latest: Latest<MeshState> }) {
  const { services, hops } = latest.message;
  const reported = new Set(services.map(nameOf));
  const stale = isMeshStale(latest);
  return (
    <div class={`site-seen ${stale ? "stale" : ""}`}>
      <div class="site-head flex wrap baseline gap-16">
        <h3>{site}</h3>
        <span class="dim small">{s("seen_by", { site })}</span>
        {stale && <span class="age">{s("report_stale", { age: ageText(ageOf(latest) ?? 0) })}</span>}
      </div>
      <div class="table-place" tabIndex={0} role="region" aria-label={`${s("mesh")}, ${site}`}>
        <table class="seen-table wide nowrap">
          <thead>
            <tr>
              {COLUMNS.map((name) => (
                <th key={name} scope="col">
                  {s(name)}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {remember(site, latest.message).map(({ seen, at }) => (
              <ProcessRow
                key={nameOf(seen)}
                of={site}
                seen={seen}
                latest={latest}
                goneAt={reported.has(nameOf(seen)) ? null : at}
              />
            ))}
          </tbody>
        </table>
      </div>
      {hops.length > 0 && <DelayChart hops={hops} />}
    </div>
  );
}
