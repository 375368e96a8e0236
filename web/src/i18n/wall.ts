// Texts of the wall.

import { texts } from "./texts";

/** Return a text of the wall in the page's language. */
export const w = texts("wall");
