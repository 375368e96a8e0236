// A message that arrived as if it had a known age.

import type { Sample } from "../src/mesh/console/connection";
import type { Latest } from "../src/mesh/state/topics";

/** Return a message of an age [s]; null: its age is not known. */
export function latest<M>(message: M, ageS: number | null = 0, arrived = 0): Latest<M> {
  const newAt = ageS === null ? null : performance.now() - 1000 * ageS;
  return { key: "", message, sample: { newAt, arrived } as Sample };
}
