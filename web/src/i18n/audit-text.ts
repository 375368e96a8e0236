// Outcomes of audited requests, in the page's language.

import type { AuditEntry } from "../gen/robomesh_pb";
import { reasonText } from "./reasons";

/** Return the reason's sentence; entries of older gateways have only the gateway's text. */
export const entryText = (entry: AuditEntry): string => reasonText(entry.reason, entry.text);
