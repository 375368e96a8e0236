// Texts of the live plots.

import { message, type NameIn, texts } from "./texts";

/** Return a part of a field's name in words; the catalogues have the usual ones. */
export function partText(part: string): string {
  return message(`plot_part.${part}`) ?? part.replaceAll("_", " ");
}

export type PlotsText = NameIn<"plots">;

/** Return a text of the plots in the page's language. */
export const p = texts("plots");

/** Return a time range in words. */
export function rangeText(seconds: number): string {
  if (seconds < 120) return p("seconds", { count: seconds });
  return seconds < 3600 ? p("minutes", { count: seconds / 60 }) : p("hours", { count: seconds / 3600 });
}
