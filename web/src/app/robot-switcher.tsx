// The robot in the bar: a press lists every robot with its state, and typing filters the list.

import { useEffect, useId, useLayoutEffect, useRef, useState } from "preact/hooks";
import { t } from "../i18n/texts";
import { heldLease } from "../mesh/control/control";
import { fleetRobots } from "../mesh/state/known-robots";
import type { RobotName } from "../mesh/state/robot-name";
import { robotSnapshot, useFleetSnapshots } from "../mesh/state/robot-snapshots";
import { stateWord } from "../mesh/state/robot-state";
import { ageOf } from "../mesh/state/staleness";
import { now } from "../mesh/state/topics";
import { State } from "../ui/marks/state";
import { programLink, robotLink } from "../ui/page/route";
import { useDismissal } from "../ui/panel/dismissal";
import "./robot-switcher.css";

const SETTLED_MS = 2000;
// The types and the linter know no field that is a combobox without a <datalist>.
const COMBOBOX = { role: "combobox", list: undefined, "aria-expanded": true } as const;

/** `program`: lead to the robots' programs. */
export function RobotSwitcher({ robot, program }: { robot: RobotName | null; program: boolean }) {
  const place = useRef<HTMLDivElement>(null);
  const [open, setOpen] = useState(false);
  useDismissal(place, () => setOpen(false));
  return (
    <div class="narrow anchor" ref={place}>
      <button
        class="switcher-button row wide nowrap tall-40 gap-8 pad-0-8"
        aria-haspopup="dialog"
        aria-expanded={open}
        onClick={() => setOpen(!open)}
      >
        {robot ? <strong title={robot.robot}>{robot.robot}</strong> : <span>{t("choose_robot")}</span>}
        <svg viewBox="0 0 12 12" width="12" height="12" aria-hidden="true">
          <path d="M2 4l4 4 4-4" />
        </svg>
        {robot && <span class="unseen">{t("other_robot")}</span>}
      </button>
      {open && <Robots robot={robot} link={program ? programLink : robotLink} close={() => setOpen(false)} />}
    </div>
  );
}

function Robots(props: { robot: RobotName | null; link: (site: string, robot: string) => string; close: () => void }) {
  const { robot, link, close } = props;
  useFleetSnapshots();
  const id = useId();
  const input = useRef<HTMLInputElement>(null);
  const list = useRef<HTMLDivElement>(null);
  const [text, setText] = useState("");
  const own = robot && `robomesh/${robot.site}/${robot.robot}`;
  const [chosen, setChosen] = useState(own ?? "");
  // Before the next key: a space on the button would close the list.
  useLayoutEffect(() => input.current?.focus(), []);
  const words = text.trim().toLowerCase().split(/\s+/);
  const found = fleetRobots.value.filter((key) => words.every((word) => key.slice(9).toLowerCase().includes(word)));
  const active = found.includes(chosen) ? chosen : (found[0] ?? "");
  useEffect(() => {
    list.current?.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" });
  }, [active]);
  const hrefOf = (key: string) => {
    const [, site = "", name = ""] = key.split("/");
    return link(site, name);
  };
  const onKey = (event: KeyboardEvent) => {
    const at = found.indexOf(active);
    const to: Record<string, number> = {
      ArrowDown: Math.min(at + 1, found.length - 1),
      ArrowUp: Math.max(at - 1, 0),
      PageDown: Math.min(at + 8, found.length - 1),
      PageUp: Math.max(at - 8, 0),
    };
    const next = to[event.key];
    if (next !== undefined) setChosen(found[next] ?? "");
    else if (event.key === "Enter" && active) {
      location.hash = hrefOf(active);
      close();
    } else return;
    event.preventDefault();
  };
  const bySite = Map.groupBy(found, (key) => key.split("/")[1] ?? "");
  return (
    <div class="switcher-sheet stack pad-8" role="dialog" aria-label={t("choose_robot")}>
      <input
        ref={input}
        type="search"
        {...COMBOBOX}
        aria-autocomplete="list"
        aria-controls={id}
        aria-activedescendant={active ? `${id}-${active}` : undefined}
        aria-label={t("filter")}
        placeholder={t("filter")}
        autocomplete="off"
        spellcheck={false}
        value={text}
        onInput={(event) => setText(event.currentTarget.value)}
        onKeyDown={onKey}
      />
      {heldLease.value && <p class="switcher-hint dim">{t("other_robot_releases")}</p>}
      <div class="grow short scroll" ref={list} id={id} role="listbox" aria-label={t("all_robots")}>
        {[...bySite].map(([site, keys]) => (
          <div key={site} role="group" aria-label={site}>
            <div class="switcher-site dim" aria-hidden="true">
              {site}
            </div>
            {keys.map((key) => (
              <a
                key={key}
                id={`${id}-${key}`}
                class="switcher-robot"
                role="option"
                tabIndex={-1}
                aria-selected={key === active}
                aria-current={key === own ? "page" : undefined}
                href={hrefOf(key)}
                onClick={close}
              >
                <span class="switcher-name">{key.split("/")[2]}</span>
                <RobotState robotKey={key} />
              </a>
            ))}
          </div>
        ))}
      </div>
      {found.length === 0 && (
        <p class="switcher-hint" role="status">
          {fleetRobots.value.length ? t("no_robot_matches") : t("none_at_all")}
        </p>
      )}
    </div>
  );
}

/** The state of a robot. Of a stored one, wait for a moment whether a live one follows. */
function RobotState({ robotKey }: { robotKey: string }) {
  const [openedAt] = useState(now.peek());
  const controller = robotSnapshot(robotKey).controller.value;
  const waiting = ageOf(controller) === null && now.value - openedAt < SETTLED_MS;
  return waiting ? null : <State state={stateWord(controller)} />;
}
