// Texts of Events.

import { type NameIn, texts } from "./texts";

export type EventsTextName = NameIn<"events">;

/** Return a text of Events in the page's language. */
export const e = texts("events");
