// The fleet: every robot of every site as a tile with picture, state, operator, age and problem.

import { signal, useComputed } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { ageText } from "../../i18n/format";
import { fleetText as f, t } from "../../i18n/texts";
import { lostAt } from "../../mesh/console/connection";
import { alarmsOf } from "../../mesh/services/alarms";
import { fleetRobots } from "../../mesh/state/known-robots";
import { robotSnapshot, useFleetSnapshots } from "../../mesh/state/robot-snapshots";
import type { StateWord } from "../../mesh/state/robot-state";
import { stateWord } from "../../mesh/state/robot-state";
import { isClockOff, isMeshStale, isSilent, reportAge, useMesh } from "../../mesh/state/site-health";
import { ageOf } from "../../mesh/state/staleness";
import { now } from "../../mesh/state/topics";
import { AliveServices } from "../../panels/alive-services";
import { Button } from "../../ui/inputs/button";
import { Select } from "../../ui/inputs/select";
import { TextInput } from "../../ui/inputs/text-input";
import { State } from "../../ui/marks/state";
import { Warning } from "../../ui/marks/warning";
import { RunningReplays } from "./replays";
import { RobotTile } from "./tile";

const STATES = ["any_state", "needs_look", "faulty", "with_alarm"] as const;
const ORDERS = ["by_name", "by_urgency"] as const;
const LEVELS: readonly StateWord["level"][] = ["alarm", "warning", "motion", "normal"];
const CALM: ReadonlySet<StateWord["level"]> = new Set(["motion", "normal"]);
const EMPTY_AFTER_MS = 1500; // live robots have published by then

const text = signal("");
const site = signal("");
const state = signal<(typeof STATES)[number]>("any_state");
const order = signal<(typeof ORDERS)[number]>("by_name");

export function FleetPage() {
  useFleetSnapshots();
  // Once a second: tiles that move more often are unreadable.
  const second = useComputed(() => Math.floor(now.value / 1000));
  const robots = fleetRobots.value;
  void second.value;
  const states = new Map(robots.map((key) => [key, stateWord(robotSnapshot(key).controller.peek())]));
  const shown = chosen(robots, states);
  const bySite = Map.groupBy(shown, (key) => key.split("/")[1] ?? "");
  const size = shown.length <= 3 ? "few" : shown.length <= 12 ? "some" : "many";
  const settled = useSettled();
  return (
    <div class="fleet">
      <div class="fleet-head row wrap gap-16">
        <h1>{t("all_robots")}</h1>
        <span class="dim">{count(robots.length)}</span>
        <Summary states={[...states.values()]} />
        <Filter sites={[...new Set(robots.map((key) => key.split("/")[1] ?? ""))]} />
      </div>
      {shown.length === 0 &&
        (robots.length > 0 ? (
          <NoMatch all={robots.length} />
        ) : settled ? (
          <p class="empty">{t("no_robots")}</p>
        ) : (
          <Skeletons />
        ))}
      {[...bySite].map(([name, keys]) => (
        <section key={name} class="site" aria-label={`${t("site")} ${name}`}>
          <SiteHead site={name} robots={keys.length} />
          <ul class={`tiles grid gap-16 ${size}`}>
            {keys.map((key) => (
              <li key={key}>
                <RobotTile robotKey={key} />
              </li>
            ))}
          </ul>
        </section>
      ))}
      <RunningReplays />
    </div>
  );
}

function count(robots: number): string {
  return robots === 1 ? f("robot_one") : f("robots", { count: robots });
}

function chosen(robots: readonly string[], states: ReadonlyMap<string, StateWord>): string[] {
  const searchText = text.value.trim().toLowerCase();
  const alarmed = (key: string) => alarmsOf.value.get(key)?.length ?? 0;
  const level = (key: string) => states.get(key)?.level ?? "warning";
  const passes = {
    any_state: () => true,
    needs_look: (key: string) => !CALM.has(level(key)) || alarmed(key) > 0,
    faulty: (key: string) => level(key) === "alarm",
    with_alarm: (key: string) => alarmed(key) > 0,
  }[state.value];
  const some = robots.filter(
    (key) => key.toLowerCase().includes(searchText) && (!site.value || key.split("/")[1] === site.value) && passes(key),
  );
  if (order.value === "by_name") return some;
  const worst = (key: string) => Math.max(0, ...(alarmsOf.value.get(key) ?? []).map(({ priority }) => priority));
  return some.sort((a, b) => LEVELS.indexOf(level(a)) - LEVELS.indexOf(level(b)) || worst(b) - worst(a));
}

function Filter({ sites }: { sites: readonly string[] }) {
  return (
    <div class="fleet-filter flex wrap push gap-8">
      {sites.length > 1 && (
        <Select
          label={f("site")}
          value={site.value}
          values={["", ...sites]}
          text={(name) => name || f("every_site")}
          choose={(name) => (site.value = name)}
        />
      )}
      <Select label={f("state")} value={state.value} values={STATES} text={f} choose={(name) => (state.value = name)} />
      <Select label={f("order")} value={order.value} values={ORDERS} text={f} choose={(name) => (order.value = name)} />
      <TextInput type="search" hint={t("filter")} value={text.value} set={(typed) => (text.value = typed)} />
    </div>
  );
}

function NoMatch({ all }: { all: number }) {
  const clear = () => {
    text.value = site.value = "";
    state.value = "any_state";
  };
  return (
    <div class="empty">
      <p>{f("no_match", { count: all })}</p>
      <Button text={f("clear")} onClick={clear} />
    </div>
  );
}

/** Placeholders until the first robots are known. */
function Skeletons() {
  return (
    <div class="tiles grid gap-16 some skeletons" aria-hidden="true">
      {[0, 1, 2].map((i) => (
        <div key={i} class="tile card">
          <div class="tile-picture" />
          <div class="tile-body" />
        </div>
      ))}
    </div>
  );
}

/** Return whether the connection has lasted long enough for live robots to have published. */
function useSettled(): boolean {
  const [settled, setSettled] = useState(false);
  const connected = lostAt.value === null;
  useEffect(() => {
    if (!connected) return;
    const timer = setTimeout(() => setSettled(true), EMPTY_AFTER_MS);
    return () => clearTimeout(timer);
  }, [connected]);
  return settled;
}

/** Number of robots in each state, most urgent first, readable from across the room. */
function Summary({ states }: { states: readonly StateWord[] }) {
  const groups = Map.groupBy(states, ({ word }) => word);
  const sorted = [...groups.values()].sort(
    ([a], [b]) => LEVELS.indexOf(a?.level ?? "normal") - LEVELS.indexOf(b?.level ?? "normal"),
  );
  return (
    <ul class="summary flex wrap" aria-label={f("state_counts")}>
      {sorted.map(
        ([first, ...others]) =>
          first && (
            <li key={first.word}>
              <State state={first} count={others.length + 1} />
            </li>
          ),
      )}
    </ul>
  );
}

/** A site's name and health by its watch: what is missing, offset or different; otherwise its services. */
function SiteHead({ site: name, robots }: { site: string; robots: number }) {
  const latest = useMesh().get(name);
  const problems = latest && !isMeshStale(latest) ? siteProblems(latest) : [];
  return (
    <div class="site-head flex wrap baseline gap-16">
      <h2>{name}</h2>
      <span class="dim small">{count(robots)}</span>
      {problems.map((words) => (
        <Warning key={words} as="span" class="state warning small" text={words} />
      ))}
      {!latest ? (
        <AliveServices of={`robomesh/${name}/-`} />
      ) : isMeshStale(latest) ? (
        <span class="age">{f("health_stale", { age: ageText(ageOf(latest) ?? 0) })}</span>
      ) : (
        problems.length === 0 && (
          <span class="dim small">
            {f("services_all", { count: latest.message.services.filter(({ site }) => site === name).length })}
          </span>
        )
      )}
    </div>
  );
}

function siteProblems(latest: NonNullable<ReturnType<ReturnType<typeof useMesh>["get"]>>): string[] {
  const { services, site: name } = latest.message;
  const own = services.filter((seen) => seen.site === name);
  const silent = own.filter((seen) => isSilent(seen, latest));
  const off = new Map(own.filter(isClockOff).map((seen) => [seen.host, seen.clockOffsetS ?? 0]));
  const versions = [...new Set(own.map(({ version }) => version).filter(Boolean))].sort();
  const [first] = silent;
  return [
    ...(silent.length > 1
      ? [f("services_silent", { count: silent.length })]
      : first
        ? [f("service_silent", { name: first.service, age: ageText(reportAge(first, latest)) })]
        : []),
    ...[...off].map(([host, seconds]) => f("clock_off", { host, seconds: seconds.toFixed(1) })),
    ...(versions.length > 1 ? [f("versions_differ", { versions: versions.join(", ") })] : []),
  ];
}
