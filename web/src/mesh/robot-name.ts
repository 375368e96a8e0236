// The name of a robot on the mesh: its site's, and its own at the site.

export interface RobotName {
  site: string;
  robot: string;
}

const NAME = /^[a-z0-9][a-z0-9_-]{0,62}$/;

/** Return whether a robot can have this name; the console closes the connection of a page that watches an impossible key. */
export function canBe({ site, robot }: RobotName): boolean {
  return NAME.test(site) && NAME.test(robot);
}

/** Return whether the robot is a replay of a recording, so that nothing of it is live. */
export function isReplay(robot: string): boolean {
  return robot.startsWith("replay-");
}
