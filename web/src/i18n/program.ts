// Texts of Program.

import { type NameIn, texts } from "./texts";

export type ProgramText = NameIn<"program">;

/** A text that follows the page's language while it is shown. */
export type Words = () => string;
export const noWords: Words = () => "";

/** Return a text of Program in the page's language. */
export const p = texts("program");
