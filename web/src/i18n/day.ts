// Texts of the history of a day.

import { type NameIn, texts } from "./texts";

export type DayTextName = NameIn<"day">;

/** Return a text of the history of a day in the page's language. */
export const d = texts("day");

/** Format a duration [ms]: "3 h 12 min", "4 min 10 s", "9 s". */
export function lastedText(ms: number): string {
  const seconds = Math.round(Math.max(0, ms) / 1000);
  const minutes = Math.floor(seconds / 60);
  if (minutes >= 60) return d("hours", { hours: Math.floor(minutes / 60), minutes: minutes % 60 });
  return minutes ? d("minutes", { minutes, seconds: seconds % 60 }) : d("seconds", { seconds });
}
