// Texts of Fleet.

import { texts } from "./texts";

/** Return a text of Fleet in the page's language. */
export const f = texts("fleet");
