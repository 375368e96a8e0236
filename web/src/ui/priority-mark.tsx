// An alarm's priority: a shape, a colour and a word, never the colour alone.

import { Alarm_Priority as Priority } from "../gen/robomesh_pb";
import type { EventsTextName } from "../i18n/events";
import { e } from "../i18n/events";
import "./priority-mark.css";

const WORDS: Record<Priority, [EventsTextName, string]> = {
  [Priority.PRIORITY_UNSPECIFIED]: ["priority_low", "low"],
  [Priority.LOW]: ["priority_low", "low"],
  [Priority.MEDIUM]: ["priority_medium", "medium"],
  [Priority.HIGH]: ["priority_high", "high"],
  [Priority.CRITICAL]: ["priority_critical", "critical"],
};

export function priorityWord(priority: Priority): string {
  return e((WORDS[priority] ?? WORDS[Priority.LOW])[0]);
}

/** `children` replace the word. */
export function PriorityMark({ of: priority, children }: { of: Priority; children?: string | number }) {
  const [word, name] = WORDS[priority] ?? WORDS[Priority.LOW];
  return (
    <span class={`priority ${name}`}>
      <span class="priority-shape" aria-hidden="true" />
      {children ?? e(word)}
    </span>
  );
}
