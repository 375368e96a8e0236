// Recorded joint positions within their limits.

import type { JointStates } from "../../../gen/foxglove/JointStates_pb";
import type { Description } from "../../../gen/robomesh_pb";
import { jointText, jointTitle } from "../../../i18n/format";

export function RecordedJoints({
  description,
  joints,
}: {
  description: Description | undefined;
  joints: JointStates | undefined;
}) {
  const positions = new Map(joints?.joints.map((joint) => [joint.name, joint.position]));
  return (
    <dl class="recorded-joints pad-0-16-8">
      {description?.joints.map((joint) => {
        const value = positions.get(joint.name);
        const share = value === undefined ? 0 : (value - joint.lower) / (joint.upper - joint.lower || 1);
        return (
          <div key={joint.name}>
            <dt>{jointTitle(joint)}</dt>
            <dd class="track-bar" aria-hidden="true">
              {value !== undefined && <span style={{ left: `${100 * Math.min(1, Math.max(0, share))}%` }} />}
            </dd>
            <dd class="value" data-joint={joint.name}>
              {jointText(joint, value)}
            </dd>
          </div>
        );
      })}
    </dl>
  );
}
