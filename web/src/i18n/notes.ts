// Texts of notes.

import { texts } from "./texts";

/** Return a text of notes in the page's language. */
export const n = texts("notes");
