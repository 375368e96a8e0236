// Every robot of every site as a tile: picture, state, who controls, how old, what is wrong.

import { computed, signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { CompressedImageSchema } from "./gen/foxglove/CompressedImage_pb";
import { ControllerStateSchema, DescriptionSchema, LeaseSchema } from "./gen/robomesh_pb";
import type { ControllerState, Description, Lease } from "./gen/robomesh_pb";
import { fromBinary } from "@bufbuild/protobuf";
import { staleText, stampFull, stampTime } from "./format";
import { presence, watch } from "./mesh";
import { State, Tag } from "./parts";
import { stateWord, stopText } from "./robot-state";
import type { Level, StateWord } from "./robot-state";
import { robotLink } from "./route";
import { t } from "./texts";
import { ageOf, isStale, useTopics } from "./topics";
import type { Latest } from "./topics";

const filter = signal("");
const seen = signal<ReadonlySet<string>>(new Set());

/** Keys `robomesh/<site>/<robot>` of every robot known: by presence, or by what it published. */
export const fleetRobots = computed<readonly string[]>(() => {
  const keys = new Set(seen.value);
  for (const key of presence.value) {
    const [root, site, robot] = key.split("/");
    if (robot !== "-") keys.add(`${root}/${site}/${robot}`);
  }
  return [...keys].sort();
});

interface TileData {
  site: string;
  robot: string;
  controller: Latest<ControllerState> | undefined;
  lease: Latest<Lease> | undefined;
  description: Latest<Description> | undefined;
}

export function Fleet() {
  const controllers = useTopics(ControllerStateSchema, "robomesh/*/*/controller");
  const leases = useTopics(LeaseSchema, "robomesh/*/*/lease");
  const descriptions = useTopics(DescriptionSchema, "robomesh/*/*/description");
  const published = [...controllers.keys(), ...descriptions.keys()].map((key) => key.replace(/\/[^/]+$/, ""));
  useEffect(() => {
    if (published.some((key) => !seen.value.has(key))) seen.value = new Set([...seen.value, ...published]);
  });
  const wanted = filter.value.trim().toLowerCase();
  const robots = fleetRobots.value.filter((key) => key.toLowerCase().includes(wanted));
  const sites = Map.groupBy(robots, (key) => key.split("/")[1] ?? "");
  const count = fleetRobots.value.length;
  const size = robots.length <= 3 ? "few" : robots.length <= 12 ? "some" : "many";
  return (
    <div class="fleet">
      <div class="fleet-head">
        <h1>{t("all_robots")}</h1>
        <span class="dim">{count === 1 ? t("robot_count") : t("robots_count", { count })}</span>
        <Summary states={fleetRobots.value.map((key) => stateWord(controllers.get(`${key}/controller`)))} />
        <input
          type="search"
          placeholder={t("filter")}
          aria-label={t("filter")}
          value={filter.value}
          onInput={(event) => (filter.value = event.currentTarget.value)}
        />
      </div>
      {robots.length === 0 && (
        <p class="empty">{wanted && count ? t("no_match", { text: filter.value }) : t("no_robots")}</p>
      )}
      {[...sites].map(([site, keys]) => (
        <section key={site} class="site" aria-label={`${t("site")} ${site}`}>
          <div class="site-head">
            <h2>{site}</h2>
            <Services of={`robomesh/${site}/-/`} />
          </div>
          <div class={`tiles ${size}`}>
            {keys.map((key) => (
              <Tile
                key={key}
                site={site}
                robot={key.split("/")[2] ?? ""}
                controller={controllers.get(`${key}/controller`)}
                lease={leases.get(`${key}/lease`)}
                description={descriptions.get(`${key}/description`)}
              />
            ))}
          </div>
        </section>
      ))}
    </div>
  );
}

function Tile({ site, robot, controller, lease, description }: TileData) {
  const state = stateWord(controller);
  const age = ageOf(controller);
  const unitAge = age === null ? null : age + (controller?.message.lastUnitAgeS ?? 0);
  const stale = isStale("controller", unitAge);
  const leaseKnown = lease !== undefined && !isStale("lease", ageOf(lease));
  const holder = lease?.message.holder;
  const problem = problemOf(controller?.message);
  return (
    <a class={`tile ${state.level}`} href={robotLink(site, robot)}>
      <Picture robotKey={`robomesh/${site}/${robot}`} stale={stale} />
      <div class="tile-body">
        <div class="tile-line">
          <strong>{robot}</strong>
          <State state={state} />
        </div>
        <div class="tile-line dim">
          <span>{description?.message.title || "\u00a0"}</span>
          {stale ? <span class="age">{staleText(unitAge)}</span> : null}
        </div>
        <div class="tile-line dim">
          <span title={leaseKnown && holder ? stampFull(lease.message.since) : ""}>
            {!leaseKnown
              ? t("holder_unknown")
              : holder
                ? `${t("somebody", { name: holder })}, ${t("since", { time: stampTime(lease.message.since) })}`
                : t("nobody")}
          </span>
          {description?.message.simulated && <Tag kind="simulated">{t("simulated")}</Tag>}
        </div>
        {/* One line for either, so that a tile never changes its height. */}
        {state.level !== "normal" && problem ? (
          <p class={`tile-problem ${state.level}`} title={problem}>
            {problem}
          </p>
        ) : (
          <Services of={`robomesh/${site}/${robot}/`} />
        )}
      </div>
    </a>
  );
}

const LEVELS: readonly Level[] = ["alarm", "warning", "normal"];

/** How many robots are how, the most urgent first: what a glance from across the room needs. */
function Summary({ states }: { states: readonly StateWord[] }) {
  const groups = Map.groupBy(states, (state) => state.word);
  const sorted = [...groups.values()].sort(
    ([a], [b]) => LEVELS.indexOf(a?.level ?? "normal") - LEVELS.indexOf(b?.level ?? "normal"),
  );
  return (
    <ul class="summary">
      {sorted.map((group) => {
        const [state] = group;
        return (
          state && (
            <li key={state.word} class={`state ${state.level}`}>
              <span class={`shape ${state.level}`} aria-hidden="true" />
              {group.length} {t(state.word)}
            </li>
          )
        );
      })}
    </ul>
  );
}

/** What is wrong, in words. */
function problemOf(controller: ControllerState | undefined): string {
  if (controller?.fault) return controller.fault;
  const stop = controller?.stop;
  if (stop) return stopText(stop);
  return controller?.linkText ?? "";
}

/** Services alive for a robot or a site, by presence. */
export function Services({ of: prefix }: { of: string }) {
  const names = new Map<string, number>();
  for (const key of presence.value) {
    if (!key.startsWith(`${prefix}alive/`)) continue;
    const service = key.split("/")[4] ?? "";
    names.set(service, (names.get(service) ?? 0) + 1);
  }
  const shown = [...names].sort(([a], [b]) => a.localeCompare(b));
  return (
    <span class="services">
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

const PICTURE_EACH_MS = 5000;

/** A still picture while the tile is on the screen; asked for now and then, so that nobody draws for it all day. */
function Picture(props: { robotKey: string; stale: boolean }) {
  const place = useRef<HTMLDivElement>(null);
  const [visible, setVisible] = useState(false);
  const [url, setUrl] = useState<string | null>(null);
  useEffect(() => {
    const observer = new IntersectionObserver(([entry]) => setVisible(entry?.isIntersecting ?? false));
    if (place.current) observer.observe(place.current);
    return () => observer.disconnect();
  }, []);
  useEffect(() => {
    if (!visible) return;
    let stop: (() => void) | undefined;
    const look = () => {
      stop?.();
      stop = watch(`${props.robotKey}/image/close`, (sample) => {
        const { data, format } = fromBinary(CompressedImageSchema, sample.payload);
        const blob = new Blob([data as Uint8Array<ArrayBuffer>], { type: `image/${format || "jpeg"}` });
        setUrl((old) => (old && URL.revokeObjectURL(old), URL.createObjectURL(blob)));
        if (sample.live) queueMicrotask(() => stop?.());
      });
    };
    look();
    const timer = setInterval(look, PICTURE_EACH_MS);
    return () => {
      clearInterval(timer);
      stop?.();
    };
  }, [visible, props.robotKey]);
  return (
    <div ref={place} class={`tile-picture ${props.stale ? "stale" : ""}`}>
      {url ? <img src={url} alt="" /> : <Silhouette label={t("no_picture")} />}
    </div>
  );
}

function Silhouette({ label }: { label: string }) {
  return (
    <svg viewBox="0 0 160 90" class="silhouette" role="img" aria-label={label}>
      <path d="M50 80h38M68 80V56l26-24 24 16" />
      <circle cx="68" cy="54" r="6" />
      <circle cx="94" cy="32" r="5" />
      <circle cx="118" cy="48" r="4" />
    </svg>
  );
}
