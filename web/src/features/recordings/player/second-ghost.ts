// The second recording's arm as a ghost over the first one's, if both have the same joints.

import { fromBinary } from "@bufbuild/protobuf";
import { useEffect } from "preact/hooks";
import { JointStatesSchema } from "../../../gen/foxglove/JointStates_pb";
import type { Description } from "../../../gen/robomesh_pb";
import { DescriptionSchema } from "../../../gen/robomesh_pb";
import { watch } from "../../../mesh/console/connection";
import { useTopic } from "../../../mesh/state/topics";
import { ghostAt } from "../../../scene/overlays";

const names = (description: Description | undefined) => description?.joints.map((joint) => joint.name).join(" ") ?? "";

/** Draw it over `robotKey`'s arm while its joints are `here`, of this moment; return whether it can be drawn. */
export function useSecondGhost(
  robotKey: string,
  description: Description | undefined,
  second: string | null,
  here: boolean,
): boolean {
  const other = useTopic(DescriptionSchema, `${second ?? "robomesh/-/-"}/description`)?.message;
  const order = names(description);
  const alike = second !== null && order !== "" && order === names(other);
  useEffect(() => {
    if (!alike || !second || !here) return;
    const stop = watch(`${second}/joints`, (sample) => {
      const { joints } = fromBinary(JointStatesSchema, sample.payload);
      const positions = new Map(joints.map((joint) => [joint.name, joint.position]));
      const row = order.split(" ").map((name) => positions.get(name));
      if (row.every((each) => each !== undefined)) ghostAt(robotKey, row as number[]);
    });
    return () => {
      stop();
      ghostAt(robotKey, null);
    };
  }, [alike, here, robotKey, second, order]);
  return alike;
}
