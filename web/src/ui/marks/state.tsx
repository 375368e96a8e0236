// A state as a word with a shape and a colour, and the age of stale values.

import { staleText } from "../../i18n/format";
import { t } from "../../i18n/texts";
import type { StateWord } from "../../mesh/state/robot-state";
import { stateText } from "../../mesh/state/robot-state";

/** A state with the shape and colour of its level; of several, their number. */
export function State({ state, count, told }: { state: StateWord; count?: number; told?: boolean }) {
  return (
    <span class={`state ${state.level}`} {...(told && { role: "status", "aria-label": t("state") })}>
      <span class={`shape ${state.level}`} aria-hidden="true" />
      {count === undefined ? stateText(state) : `${count} ${t(state.word)}`}
    </span>
  );
}

/** Nothing while fresh, the age in words when stale. */
export function Age({ stale, age }: { stale: boolean; age: number | null }) {
  return stale ? <span class="age">{staleText(age)}</span> : null;
}
