// The page of a robot that does not exist, with links to those that do.

import { useEffect, useState } from "preact/hooks";
import { t } from "../i18n/texts";
import { hello, lostAt } from "../mesh/connection";
import { fleetRobots } from "../mesh/known-robots";
import type { RobotName } from "../mesh/robot-name";
import { robotLink } from "../ui/route";

const SEARCH_MS = 4000;

/** Return whether a live connection received nothing of a robot for some seconds; `known`: something was received. */
export function useRobotNotFound(robotKey: string, known: boolean): boolean {
  const [waited, setWaited] = useState(false);
  const there = known || fleetRobots.value.includes(robotKey);
  const connected = lostAt.value === null && hello.value?.connected === true;
  useEffect(() => {
    setWaited(false);
    if (there || !connected) return;
    const timer = setTimeout(() => setWaited(true), SEARCH_MS);
    return () => clearTimeout(timer);
  }, [robotKey, there, connected]);
  return waited && !there;
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
