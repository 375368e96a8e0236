// Texts of sign-in and accounts.

import { textIn, texts } from "./texts";

/** Return a text of sign-in and accounts in the page's language. */
export const a = texts("account");

/** Explain the end of a session by the server's code. */
export function endText(word: string): string {
  return textIn("account", `out_${word}`) ?? a("out_signed_out");
}

export function roleText(role: string): string {
  return textIn("account", `role_${role}`) ?? role;
}
