// The name of a robot on the mesh: its site's name and its own.

export interface RobotName {
  site: string;
  robot: string;
}

const NAME = /^[a-z0-9][a-z0-9_-]{0,62}$/;

/** Return whether a robot can have this name. The console closes the connection of a page that subscribes to an
 * invalid key. */
export function canBe({ site, robot }: RobotName): boolean {
  return NAME.test(site) && NAME.test(robot);
}

/** Return whether the robot is a replay of a recording, and therefore not live. */
export function isReplay(robot: string): boolean {
  return robot.startsWith("replay-");
}
