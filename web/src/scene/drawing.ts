// What draws a robot in 3-D: loaded on demand, because it is larger than the rest of the page.

export { forwardOf } from "./forward-kinematics";
export { framesOf } from "./frames-of-joints";
export { RobotScene } from "./robot-scene";
