// The page of a robot that does not exist, with links to those that do.

import { useEffect, useRef, useState } from "preact/hooks";
import { t } from "../i18n/texts";
import { hello, lostAt } from "../mesh/console/connection";
import { fleetRobots } from "../mesh/state/known-robots";
import type { RobotName } from "../mesh/state/robot-name";
import { isReplay } from "../mesh/state/robot-name";
import { robotLink } from "../ui/page/route";

/** How long a console may take to know every robot, just after its start. */
const SEARCH_MS = 4000;

/** Whether a robot exists: while it is not known, nothing of it is shown, controls least of all. */
export type Search = "found" | "looking" | "missing";

/** Look for a robot; `known`: something was received of it. */
export function useRobotSearch(robotKey: string, known: boolean): Search {
  const [waited, setWaited] = useState(false);
  const found = useRef("");
  if (known || fleetRobots.value.includes(robotKey)) found.current = robotKey;
  const there = found.current === robotKey;
  const connected = lostAt.value === null && hello.value?.connected === true;
  // A replay announces no presence.
  const complete = hello.value?.presenceKnown === true && !isReplay(robotKey.split("/")[2] ?? "");
  useEffect(() => {
    setWaited(false);
    if (there || !connected) return;
    const timer = setTimeout(() => setWaited(true), SEARCH_MS);
    return () => clearTimeout(timer);
  }, [robotKey, there, connected]);
  if (there) return "found";
  return waited || (connected && complete) ? "missing" : "looking";
}

/** In the place of a robot's page while it is not known whether the robot exists, or that it does not. */
export function NoRobot({ search, ...robot }: RobotName & { search: Search }) {
  if (search === "missing") return <RobotNotFound {...robot} />;
  return (
    <p class="missing looking dim" role="status">
      {t("looking_for", { ...robot })}
    </p>
  );
}

export function RobotNotFound({ site, robot }: RobotName) {
  const robots = fleetRobots.value.map((key) => key.split("/").slice(1) as [string, string]);
  return (
    <div class="missing" role="status">
      <h1>{t("no_robot", { site, robot })}</h1>
      <p>{t(robots.length ? "there_are" : "none_at_all")}</p>
      <ul>
        {robots.map(([at, name]) => (
          <li key={`${at}/${name}`}>
            <a href={robotLink(at, name)}>{`${at} / ${name}`}</a>
          </li>
        ))}
      </ul>
    </div>
  );
}
