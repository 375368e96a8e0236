// Texts of Recordings.

import { type NameIn, texts, viewText } from "./texts";

export type RecordingsText = NameIn<"recordings">;

/** Return a text of Recordings in the page's language. */
export const r = texts("recordings");

const RECORDED = "recorded-";

/** Return the name under which a replay publishes a recorded view. */
export function recordedView(view: string): string {
  return RECORDED + view;
}

/** Return a replay's view in words. */
export function viewName(view: string): string {
  return view.startsWith(RECORDED)
    ? r("recorded_view", { view: viewText(view.slice(RECORDED.length)) })
    : viewText(view);
}
