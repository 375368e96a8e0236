// Words of a stop request that programs write: its sender and its reason.

import type { TextName } from "./texts";
import { t } from "./texts";

// Pages and programs that give no reason, and senders without a name.
const NO_REASON = new Set(["", "console", "the page"]);
const NO_NAME = new Set(["", "somebody", "anonymous"]);

/** Return whether a person gave this reason. */
export function isSaid(reason: string | undefined): reason is string {
  return reason !== undefined && !NO_REASON.has(reason);
}

/** Return the sender's name, or words for a sender that gave none, by default within a sentence. */
export function operatorText(name: string, unnamed: TextName = "an_unnamed_operator"): string {
  return NO_NAME.has(name) ? t(unnamed) : name;
}
