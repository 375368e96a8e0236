// Texts of a view's page.

import { texts } from "./texts";

/** Return a text of a view's page in the page's language. */
export const v = texts("view");
