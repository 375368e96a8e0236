// Facts about the link to the controller, attached legacy clients, and the end of the audit log.

import type { ControllerState } from "../../../gen/robomesh_pb";
import { ControllerState_Known as Known, Capabilities_Stops as Stops } from "../../../gen/robomesh_pb";
import { count, fixed } from "../../../i18n/format";
import type { TextName } from "../../../i18n/texts";
import { t } from "../../../i18n/texts";
import { Command } from "../../../mesh/control/command";
import { ageOf, isStale } from "../../../mesh/state/staleness";
import type { Latest } from "../../../mesh/state/topics";
import { recoveryNames } from "../../../panels/control/recover";
import { Unit } from "../../../ui/marks/unit";

const HASH_SHOWN = 4; // bytes of the log's last hash: enough to compare by eye

type Fact = [name: TextName, value: string, unit?: string];

const STOPS: Partial<Record<Stops, TextName>> = {
  [Stops.ANY]: "can_stop_any",
  [Stops.OURS]: "can_stop_ours",
  [Stops.NOT_NOW]: "can_stop_not_now",
};
const WITHOUT_GATEWAY: Partial<Record<Known, TextName>> = {
  [Known.YES]: "dies_with_link",
  [Known.NO]: "lives_without_link",
};
const COMMANDS: [Command, TextName][] = [
  [Command.MOVE_ABSOLUTE, "can_move"],
  [Command.JOG, "can_jog"],
  [Command.HOLD, "can_hold"],
  [Command.SPEED, "can_speed"],
  [Command.HOME, "can_home"],
];

/** Return what the driver can do with its controller, in words; empty: an older gateway does not report it. */
function capabilitiesText(state: ControllerState): string {
  const { capabilities } = state;
  if (!capabilities) return "";
  const { commands, stops, absolute, diesWithLink } = capabilities;
  const moves = commands.includes(Command.MOVE_ABSOLUTE);
  const words: TextName[] = [moves ? "can_read" : "can_only_read"];
  words.push(...COMMANDS.filter(([command]) => commands.includes(command)).map(([, name]) => name));
  const stop = STOPS[stops];
  if (stop) words.push(stop);
  if (absolute) words.push("can_absolute");
  if (moves) {
    words.push(WITHOUT_GATEWAY[diesWithLink] ?? "without_gateway_unknown");
  }
  const recoveries = recoveryNames(state);
  const recovers = recoveries.length ? [t("can_recover", { names: recoveries.join(" / ") })] : [];
  return [...words.map((name) => t(name)), ...recovers].join(" · ");
}

/** Known facts only: legacy controllers report few. */
export function LinkFacts({ controller }: { controller: Latest<ControllerState> | undefined }) {
  const state = controller?.message;
  if (!state) return <p class="footnote dim">{t("no_data")}</p>;
  const { health, counters, legacyClients, auditHead } = state;
  const facts: Fact[] = [];
  const milliseconds = (name: TextName, seconds: number | undefined) => {
    if (seconds !== undefined) facts.push([name, fixed(seconds * 1000, 1), "ms"]);
  };
  if (state.software) facts.push(["software", state.software]);
  if (state.rateHz !== undefined) facts.push(["link_rate", fixed(state.rateHz, 1), "/s"]);
  milliseconds("link_jitter", health?.jitterS);
  milliseconds("link_round_trip", health?.networkRoundTripS);
  milliseconds("link_answer", health?.answerS);
  milliseconds("link_stamps", health?.stampUncertaintyS);
  if (counters) {
    facts.push(["link_units", count(counters.unitsReceived)], ["link_lost", count(counters.unitsLost)]);
    facts.push(["link_malformed", count(counters.unitsMalformed)], ["link_unknown", count(counters.recordsUnknown)]);
    facts.push(["link_refusals", count(counters.refusals)], ["link_connections", count(counters.connections)]);
    if (counters.unitsSkipped) facts.push(["link_skipped", count(counters.unitsSkipped)]);
  }
  if (legacyClients) {
    facts.push(
      ["legacy_attached", count(legacyClients.attached)],
      ["legacy_refused", count(legacyClients.unitsRefused)],
    );
    facts.push(["legacy_turned_away", count(legacyClients.turnedAway)], ["legacy_closed", count(legacyClients.closed)]);
  }
  if (auditHead) {
    const hash = [...auditHead.hash.slice(0, HASH_SHOWN)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    facts.push(["audit_entries", count(auditHead.number)], ["audit_head", `${hash}…`]);
  }
  const stale = isStale("controller", ageOf(controller));
  const capabilities = capabilitiesText(state);
  return (
    <dl
      class={`facts-list grid grow short scroll small pad-0-16-8 ${stale ? "outdated" : ""}`}
      tabIndex={0}
      aria-label={t("link")}
    >
      {capabilities && (
        <div class="whole-row flex gap-8">
          <dt class="dim nowrap">{t("can")}</dt>
          <dd>{capabilities}</dd>
        </div>
      )}
      {facts.map(([name, value, unit]) => (
        <div key={name} class="flex spread gap-8">
          <dt class="dim nowrap">{t(name)}</dt>
          <dd>
            {value}
            {unit && <Unit of={unit} />}
          </dd>
        </div>
      ))}
    </dl>
  );
}
