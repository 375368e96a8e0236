// Texts of New robot.

import { type NameIn, texts } from "./texts";

export type DefineText = NameIn<"define">;

/** Return a text of New robot in the page's language. */
export const d = texts("define");
