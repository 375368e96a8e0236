// Expiry of the certificates of the mesh's processes, as they report it; nothing without certificates.

import { ageText } from "../../i18n/format";
import { settingsText as s } from "../../i18n/texts";
import { useMesh } from "../../mesh/state/site-health";
import { Panel } from "../../ui/panel/panel";
import { Marked } from "./this-console";

/** The name in a process's health message: see robomesh/wire/session.py. */
const SECONDS = "certificate_seconds";
const SOON_S = 10 * 86_400;
const DAY_S = 86_400;

export function Certificates() {
  const certificates = [...useMesh()].flatMap(([site, { message }]) =>
    message.services.flatMap((seen) => {
      const left = seen.values[SECONDS];
      // Every watch reports the certificates of its own site: show each once.
      return left === undefined || seen.site !== site ? [] : [{ key: `${site} ${seen.id}`, site, seen, left }];
    }),
  );
  if (certificates.length === 0) return null;
  return (
    <Panel name="certificates" title={s("certificates")}>
      <p class="footnote dim">{s("certificates_words")}</p>
      <ul class="pad-0-16-12">
        {certificates
          .sort((a, b) => a.left - b.left)
          .map(({ key, site, seen, left }) => (
            <li key={key} class="row wrap tall-32 gap-0-16">
              <span>{site}</span>
              <strong>{seen.service}</strong>
              <span class="dim">{seen.host}</span>
              <Marked wrong={left < SOON_S}>
                {left > 0 ? s("certificate_ends", { age: leftText(left) }) : s("certificate_ended")}
              </Marked>
            </li>
          ))}
      </ul>
    </Panel>
  );
}

function leftText(seconds: number): string {
  return seconds < 2 * DAY_S ? ageText(seconds) : `${Math.floor(seconds / DAY_S)}\u202fd`;
}
