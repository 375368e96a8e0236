// Audited requests as sentences in the page's language: "li: elbow −5.00°", "li: Home – no link".

import type { AuditEntry, Description_Joint } from "../gen/robomesh_pb";
import { AuditEntry_Outcome as Outcome } from "../gen/robomesh_pb";
import { isolated } from "./foreign-text";
import { fixed, jointText, jointTitle } from "./format";
import { reasonText } from "./reasons";
import { inLanguage, t } from "./texts";

/** What was asked, by the request's name; `{...}`: the entry's values. Its outcome may be a refusal. */
const ASKED: Record<string, readonly [english: string, chinese: string]> = {
  HOME: ["Home", "回零"],
  HOLD: ["Hold", "保持"],
  RESUME: ["Resume", "继续"],
  RESET: ["reset of stop {stop_id}", "复位停止 {stop_id}"],
  TRACE_ON: ["trace on", "开始记录"],
  TRACE_OFF: ["trace off", "停止记录"],
  SPEED: ["speed {speed_percent}\u202f%", "速度 {speed_percent}\u202f%"],
  MOVE_ABSOLUTE: ["move to {target}", "移动到 {target}"],
  MOVE_RELATIVE: ["{target}", "{target}"],
  RUN_PROGRAM: ["program {program_name}", "程序 {program_name}"],
  JOG: ["jog {jog_frame} {jog_axis}", "点动 {jog_frame} {jog_axis}"],
  JOG_KEEP_ALIVE: ["keep-alive of a jog", "点动保活信号"],
  ACQUIRE: ["take control", "取得控制权"],
  RELEASE: ["release control", "释放控制权"],
  OFFER: ["offer control to {to}", "提出将控制权移交给 {to}"],
  ACCEPT: ["accept control", "接受控制权"],
  TAKE: ["take over control: {reason}", "接管控制权：{reason}"],
  ASK: ["ask for control", "请求控制权"],
  STOP: ["stop request", "请求停止"],
};
const WITHOUT: Record<string, readonly [english: string, chinese: string]> = {
  RESET: ["Reset", "复位"],
  MOVE_ABSOLUTE: ["move to a target", "移动到目标"],
  MOVE_RELATIVE: ["a step", "移动一步"],
  RUN_PROGRAM: ["a program", "程序"],
  OFFER: ["withdraw the offer of control", "撤回移交"],
  TAKE: ["take over control", "接管控制权"],
};
/** Requests whose outcome says more than their name: an end of control or of a program, a stop that was sent again. */
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

function asked({ request, values }: AuditEntry, joints: readonly Description_Joint[]): string {
  const known: Record<string, string> = { ...values };
  const target = targetText(request, values.joint_positions, joints);
  if (target) known.target = target;
  const pair = ASKED[request];
  if (!pair) return request;
  const complete = [...pair[0].matchAll(/\{(\w+)\}/g)].every(([, name]) => known[name ?? ""]);
  return inLanguage(complete ? pair : (WITHOUT[request] ?? pair), known);
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
