// The wall: views of any robots as video, as large as the screen allows.

import { useEffect, useRef, useState } from "preact/hooks";
import type { Description } from "../../gen/robomesh_pb";
import { ControllerStateSchema, DescriptionSchema, ReplayStateSchema } from "../../gen/robomesh_pb";
import { t, wallText as w } from "../../i18n/texts";
import { addKnownRobots, fleetRobots } from "../../mesh/state/known-robots";
import { useTopics } from "../../mesh/state/topics";
import { Button } from "../../ui/inputs/button";
import type { ViewName } from "../../ui/page/route";
import { robotLink, wallLink } from "../../ui/page/route";
import { columnsFor } from "./grid";
import { WallTile } from "./tile";
import type { RobotViews } from "./view-choice";
import { ViewChoice } from "./view-choice";
import "./wall-page.css";

/** The renderer's view of every robot, which follows the arm. */
const CLOSE = "close";

function viewNames(description: Description | undefined): readonly string[] {
  return [...new Set([CLOSE, "free", ...(description?.views ?? []).map((view) => view.name)])];
}

export function WallPage({ chosen }: { chosen: readonly ViewName[] }) {
  const controllers = useTopics(ControllerStateSchema, "robomesh/*/*/controller");
  const descriptions = useTopics(DescriptionSchema, "robomesh/*/*/description");
  const replays = useTopics(ReplayStateSchema, "robomesh/*/*/replay");
  useEffect(() => addKnownRobots([...controllers.keys(), ...descriptions.keys()]));
  const [choosing, setChoosing] = useState(false);
  // Includes replays, unlike the fleet.
  const described = [...descriptions.keys()].map((key) => key.replace(/\/[^/]+$/, ""));
  const known = new Set([...fleetRobots.value, ...described]);
  const robots: RobotViews[] = [...known].sort().map((key) => {
    const [, site = "", robot = ""] = key.split("/");
    return { site, robot, views: viewNames(descriptions.get(`${key}/description`)?.message) };
  });
  const shown = chosen.length
    ? chosen
    : fleetRobots.value.map((key) => {
        const [, site = "", robot = ""] = key.split("/");
        return { site, robot, view: CLOSE };
      });
  const show = (next: readonly ViewName[]) => location.replace(wallLink(next));
  const grid = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState({ width: 0, height: 0 });
  useEffect(() => {
    if (!grid.current) return;
    const sizing = new ResizeObserver(([entry]) => {
      const box = entry?.contentRect;
      if (box) setSize({ width: box.width, height: box.height });
    });
    sizing.observe(grid.current);
    return () => sizing.disconnect();
  }, []);
  const columns = columnsFor(shown.length, size.width, size.height);
  const full = useFullScreen();
  const onKey = (event: KeyboardEvent) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "f" || event.key === "F") return void full.toggle();
    const tiles = [...(grid.current?.querySelectorAll<HTMLElement>(".wall-tile") ?? [])];
    const at = tiles.indexOf(event.target as HTMLElement);
    const one = shown[at];
    if (event.key === "Enter" && one) return void (location.hash = robotLink(one.site, one.robot));
    const steps: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns };
    const next = tiles[at < 0 ? 0 : at + (steps[event.key] ?? 0)];
    if (event.key in steps && next) {
      event.preventDefault();
      next.focus();
    }
  };
  return (
    // biome-ignore lint/a11y/noStaticElementInteractions: it moves the focus between the tiles inside.
    <div class={`wall stack grow short gap-8 pad-8 ${full.on ? "is-full" : ""}`} onKeyDown={onKey}>
      <div class="wall-head row wrap gap-0-16 pad-0-8">
        <h1>{t("wall")}</h1>
        <span class="dim">{shown.length === 1 ? w("picture") : w("pictures", { count: shown.length })}</span>
        <span class="flex push gap-8">
          <Button
            text={choosing ? w("done") : w("choose")}
            aria-expanded={choosing}
            onClick={() => setChoosing(!choosing)}
          />
          <Button
            text={full.on ? w("leave_full") : t("full_screen")}
            title={w("keys")}
            onClick={() => void full.toggle()}
          />
        </span>
      </div>
      {choosing && <ViewChoice robots={robots} shown={shown} show={show} />}
      {shown.length === 0 && <p class="empty">{w("no_robots")}</p>}
      <div
        ref={grid}
        class="wall-grid grid grow short scroll gap-8"
        style={{ "--columns": columns, "--rows": Math.ceil(shown.length / columns) }}
      >
        {shown.map((one, i) => {
          const key = `robomesh/${one.site}/${one.robot}`;
          return (
            <WallTile
              key={`${key}/${one.view}`}
              shown={one}
              controller={controllers.get(`${key}/controller`)}
              description={descriptions.get(`${key}/description`)?.message}
              replay={replays.get(`${key}/replay`)}
              known={known.has(key)}
              remove={() => show(shown.filter((_, j) => j !== i))}
            />
          );
        })}
      </div>
    </div>
  );
}

/** Show the whole page on the full screen, so that STOP stays visible. */
function useFullScreen(): { on: boolean; toggle: () => Promise<void> } {
  const [on, setOn] = useState(document.fullscreenElement !== null);
  useEffect(() => {
    const changed = () => setOn(document.fullscreenElement !== null);
    document.addEventListener("fullscreenchange", changed);
    return () => document.removeEventListener("fullscreenchange", changed);
  }, []);
  const toggle = () =>
    document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen();
  return { on, toggle };
}
