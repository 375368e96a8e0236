// Distance between a robot, its surroundings and its own links: level and words.

import type { Clearance, Description } from "../../gen/robomesh_pb";
import { DescriptionSchema } from "../../gen/robomesh_pb";
import { fixed } from "../../i18n/format";
import { t } from "../../i18n/texts";
import type { Level } from "./robot-state";
import { useTopic } from "./topics";

/** The floor's name in a pair of near parts, as in the contract. */
const FLOOR = "the floor";

/** Return the height of the floor of a robot's cell in the site's frame [m]; null: no floor. */
export function floorOf({ floor, baseToSite }: Description): number | null {
  // Older gateways publish no floor: it is at the robot's base.
  return floor ? (floor.height ?? null) : (baseToSite[11] ?? 0);
}

/** Return the level of a robot's distance to fixtures and robots; of two robots' limits, the larger counts. */
export function useClearanceLevel(robotKey: string, clearance: Clearance | undefined): Level {
  const [site, robot, link] = clearance?.second.split("/") ?? [];
  const ownKey = `${robotKey}/description`;
  const own = useTopic(DescriptionSchema, ownKey)?.message;
  const other = useTopic(DescriptionSchema, link ? `robomesh/${site}/${robot}/description` : ownKey)?.message;
  const [ownOf, otherOf] = clearance?.second.endsWith(`/${FLOOR}`) ? [own?.floor, undefined] : [own, other];
  const within = (of: "stopDistance" | "warningDistance") =>
    clearance !== undefined && clearance.distance < Math.max(ownOf?.[of] ?? 0, otherOf?.[of] ?? 0);
  if (clearance && (clearance.distance <= 0 || within("stopDistance"))) return "alarm";
  return within("warningDistance") ? "warning" : "normal";
}

/** Return the level of two links of one arm: only contact counts. */
export function ownLevel(clearance: Clearance): Level {
  return clearance.distance <= 0 ? "alarm" : "normal";
}

/** Return "flange – table", "forearm – pt600-2 wrist" for frame ids `<site>/<robot>/<link>`, `<site>/<fixture>`. */
export function pairText({ first, second }: Clearance, robotKey: string): string {
  const [, site = "", robot = ""] = robotKey.split("/");
  const name = (frame: string) => {
    const chunks = frame.split("/").slice(frame.startsWith(`${site}/`) ? 1 : 0);
    if (chunks[0] === FLOOR) return t("floor");
    return (chunks.length > 1 && chunks[0] === robot ? chunks.slice(1) : chunks).join(" ");
  };
  return `${name(first)} – ${name(second)}`;
}

/** Return "12.3 mm", or that the parts touch. */
export function distanceText({ distance }: Clearance): string {
  return distance <= 0 ? t("touching") : `${fixed(distance * 1000, 1)}\u202fmm`;
}
