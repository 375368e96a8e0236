// Texts of Settings.

import { texts } from "./texts";

/** Return a text of Settings in the page's language. */
export const s = texts("settings");
