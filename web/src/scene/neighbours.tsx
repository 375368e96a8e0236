// Other robots of the cell in a robot's 3-D view.

import { fromBinary } from "@bufbuild/protobuf";
import { useEffect, useRef } from "preact/hooks";
import { FrameTransformsSchema } from "../gen/foxglove/FrameTransforms_pb";
import type { Description } from "../gen/robomesh_pb";
import { DescriptionSchema } from "../gen/robomesh_pb";
import { watch } from "../mesh/console/connection";
import { isStale } from "../mesh/state/staleness";
import { useTopics } from "../mesh/state/topics";
import { useFramesAge } from "./frames-age";
import type { Arm } from "./parts/arm";
import type { RobotScene } from "./robot-scene";

/** The other robots of a cell. */
export function Neighbours(props: { robotKey: string; cell: string; scene: RobotScene }) {
  const [root, site] = props.robotKey.split("/");
  const descriptions = useTopics(DescriptionSchema, `${root}/${site}/*/description`);
  const mates = [...descriptions.values()]
    .filter(({ message }) => message.cell === props.cell && !message.replay)
    .map(({ key, message }) => ({ key: key.replace(/\/description$/, ""), message }))
    .filter(({ key }) => key !== props.robotKey);
  return (
    <>
      {mates.map(({ key, message }) => (
        <Neighbour key={key} robotKey={key} description={message} scene={props.scene} />
      ))}
    </>
  );
}

/** One other robot: dimmed; grey when stale. */
function Neighbour(props: { robotKey: string; description: Description; scene: RobotScene }) {
  const { robotKey, description, scene } = props;
  const age = useFramesAge(robotKey, "frames");
  const stale = age !== undefined && isStale("frames", age, description);
  const arm = useRef<Arm | null>(null);
  useEffect(() => {
    const made = scene.addNeighbour(robotKey.split("/").slice(1).join("/"), description);
    arm.current = made;
    const stop = watch(`${robotKey}/frames`, (sample) =>
      made.placeFrames(fromBinary(FrameTransformsSchema, sample.payload), sample.sourceTime, sample.arrived),
    );
    return () => {
      stop();
      scene.removeNeighbour(made);
    };
  }, [robotKey, description, scene]);
  useEffect(() => arm.current?.setStale(stale), [stale, description, scene]);
  return null;
}
