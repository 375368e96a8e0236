// Format of times and distances on the program page.

import { fixed } from "../../../i18n/format";

/** Format 12.4 s, or 3:05.0 from a hundred seconds on. */
export function seconds(value: number): string {
  if (value < 100) return `${fixed(value, 1)}\u202fs`;
  const rest = (value % 60).toFixed(1).padStart(4, "0");
  return `${Math.floor(value / 60)}:${rest}\u202fmin`;
}

export function distanceText(metres: number): string {
  return `${fixed(metres * 1000, 1)}\u202fmm`;
}
