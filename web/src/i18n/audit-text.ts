// Audited requests as sentences in the page's language: "li: elbow −5.00°", "li: Home – no link".

import type { AuditEntry, Description_Joint } from "../gen/robomesh_pb";
import { AuditEntry_Outcome as Outcome } from "../gen/robomesh_pb";
import { fixed, jointText, jointTitle } from "./format";
import { reasonText } from "./reasons";
import { isolated } from "./text-isolation";
import { filled, message, placeholders, t } from "./texts";

/** Requests with an outcome that says more than their name: an end of control or of a program, a stop that was sent again. */
const OUTCOME_SAYS_ALL = new Set(["EXPIRE", "REVOKE", "PROGRAM_END", "JOG_END", "STOP_AGAIN", "ROTATE"]);

/** Return the reason's sentence; entries of older gateways have only the gateway's text. */
export const entryText = (entry: AuditEntry): string => reasonText(entry.reason, entry.text);

/** Return an entry as one sentence.
 *
 * `joints` give the numbers of a motion their names and units; `tookS`: how long the motion took [s]. */
export function entrySentence(entry: AuditEntry, joints: readonly Description_Joint[] = [], tookS?: number): string {
  const who = isolated(entry.operator || entry.source);
  const why = entryText(entry);
  if (OUTCOME_SAYS_ALL.has(entry.request) && why) return t("entry_of", { who, what: why });
  const sent = asked(entry, joints);
  const what = tookS === undefined ? sent : t("entry_done", { what: sent, seconds: fixed(tookS, 1) });
  if (entry.outcome === Outcome.ACCEPTED) {
    // Of an accepted request the text is a warning of its check; of others it repeats what was asked.
    const warning = entry.reason?.code.startsWith("check.") ? why : "";
    return t("entry_of", { who, what: warning ? t("entry_warned", { what, why: warning }) : what });
  }
  return t("entry_of", { who, what: why ? t("entry_refused", { what, why }) : what });
}

/** Return what was asked, in words that need no value if the entry lacks one. */
function asked({ request, values }: AuditEntry, joints: readonly Description_Joint[]): string {
  const known: Record<string, string> = { ...values };
  const target = targetText(request, values.joint_positions, joints);
  if (target) known.target = target;
  const sentence = message(`audit.${request}`);
  if (!sentence) return request;
  const complete = placeholders(sentence).every((name) => known[name]);
  return complete ? filled(sentence, known) : (message(`audit_without.${request}`) ?? request);
}

/** Return the joints of a motion with their targets, or of a step with its signed change. */
function targetText(request: string, positions: string | undefined, joints: readonly Description_Joint[]): string {
  const values = positions?.split(" ").map(Number) ?? [];
  if (values.length === 0 || values.length !== joints.length) return "";
  const steps = request === "MOVE_RELATIVE";
  const parts = joints.flatMap((joint, i) => {
    const value = values[i] ?? 0;
    if (steps && value === 0) return [];
    return [`${jointTitle(joint)} ${steps && value > 0 ? "+" : ""}${jointText(joint, value)}`];
  });
  return parts.join(", ");
}
