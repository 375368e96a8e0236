// The states before and after the shown one, for undo and redo.

import { computed, signal } from "@preact/signals";

/** @param most Steps that are kept. */
export function undoHistory<State>(most: number) {
  const past = signal<readonly State[]>([]);
  const future = signal<readonly State[]>([]);
  const step = (from: typeof past, to: typeof past, now: State): State | undefined => {
    const found = from.value.at(-1);
    if (found === undefined) return undefined;
    from.value = from.value.slice(0, -1);
    to.value = [...to.value, now];
    return found;
  };
  return {
    canUndo: computed(() => past.value.length > 0),
    canRedo: computed(() => future.value.length > 0),
    clear: () => void (past.value = future.value = []),
    /** Keep the state before a change; `isPart`: undo takes this change back with the one before. */
    keep: (before: State, isPart: boolean) => {
      if (!isPart) past.value = [...past.value, before].slice(-most);
      future.value = [];
    },
    /** Return the state before `now`; undefined: there is none. */
    undo: (now: State) => step(past, future, now),
    redo: (now: State) => step(future, past, now),
  };
}
