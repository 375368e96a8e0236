// An operator in control of a robot, and one whose picture of it is old.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { LeaseAnswerSchema } from "../../../src/gen/robomesh_pb";
import type { Request } from "../../console";
import { answer, connect, next } from "../../console";
import { latest } from "../../latest";
import { use } from "../../shown";

export const ROBOT = "robomesh/hall/arm";
/** The gateway's clock at time 0 of the page's [ms]. */
export const GATEWAY_MS = 1e12;

/** Connect the page, and take control for a day. */
export async function takeControl(robotKey = ROBOT): Promise<void> {
  const { setOperator, take } = await import("../../../src/mesh/control/control");
  const stale = [
    { topic: "joints", afterS: 1 },
    { topic: "video/*", afterS: 1 },
  ];
  await connect({ site: "hall", session: "page1", stale } as never);
  setOperator("li");
  const taken = take(robotKey);
  const now = GATEWAY_MS + performance.now();
  const until = timestampFromMs(now + 86_400_000);
  answer(await next(), LeaseAnswerSchema, {
    lease: "l",
    since: timestampFromMs(now),
    now: timestampFromMs(now),
    until,
  });
  await taken;
}

/** Take the page's oldest request to a key with a part; renewals of the lease stay without an answer. */
export async function nextTo(part: string): Promise<Request> {
  for (;;) {
    const request = await next();
    if (request.key.includes(part)) return request;
  }
}

/** Show a state of the robot of an age [s]. */
export async function showState(ageS: number): Promise<void> {
  const { useShownState } = await import("../../../src/mesh/control/display-freshness");
  use(useShownState, ROBOT, latest({}, ageS), undefined);
}
