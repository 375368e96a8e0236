// An alarm's priority: a shape, a colour and a word, never the colour alone.

import { Alarm_Priority as Priority } from "../../gen/robomesh_pb";
import type { NameIn } from "../../i18n/texts";
import { eventsText as e } from "../../i18n/texts";
import "./priority-mark.css";

const WORDS: Partial<Record<Priority, [NameIn<"events">, string]>> = {
  [Priority.PRIORITY_UNSPECIFIED]: ["priority_low", "low"],
  [Priority.LOW]: ["priority_low", "low"],
  [Priority.MEDIUM]: ["priority_medium", "medium"],
  [Priority.HIGH]: ["priority_high", "high"],
  [Priority.CRITICAL]: ["priority_critical", "critical"],
};

/** Return the word; of a newer program's priority, its number. */
export function priorityWord(priority: Priority): string {
  const [word] = WORDS[priority] ?? [];
  return word ? e(word) : String(priority);
}

/** `children` replace the word. */
export function PriorityMark({ of: priority, children }: { of: Priority; children?: string | number }) {
  const [, name] = WORDS[priority] ?? [null, "high"];
  return (
    <span class={`priority inline-row nowrap dim ${name}`}>
      <span class="priority-shape" aria-hidden="true" />
      {children ?? priorityWord(priority)}
    </span>
  );
}
