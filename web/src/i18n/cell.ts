// Texts of the page Cell.

import { type NameIn, texts } from "./texts";

export type CellText = NameIn<"cell">;

/** Return a text of the page Cell in the page's language. */
export const c = texts("cell");
