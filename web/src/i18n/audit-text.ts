// What became of a request, in the page's language.

import type { AuditEntry } from "../gen/robomesh_pb";
import { reasonText } from "./reasons";

/** The reason's sentence; entries of an older gateway have the gateway's alone. */
export const entryText = (entry: AuditEntry): string => reasonText(entry.reason, entry.text);
