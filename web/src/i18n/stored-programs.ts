// Texts of stored programs.

import { type NameIn, texts } from "./texts";

export type StoredText = NameIn<"stored_programs">;

/** Return a text of stored programs in the page's language. */
export const s = texts("stored_programs");
