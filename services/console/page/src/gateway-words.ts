// What a gateway says of a request, in Chinese: its refusals, what it did, why control ended. In English they are in
// its own words, and so is what is not known here.

import { inLanguage, language } from "./texts";

// `{text}` is such a text itself. The first that fits is taken.
const SENTENCES: readonly (readonly [english: string, chinese: string])[] = [
  ["control taken", "已取得控制"],
  ["control renewed", "控制权已续期"],
  ["control given back", "已释放控制"],
  ["offer withdrawn", "已撤回移交"],
  ["control offered to {name}", "已向 {name} 提出移交控制权"],
  ["control taken over from {name}", "已从 {name} 接过控制权"],
  ["{holder} is told that {name} asks for control", "已通知 {holder}：{name} 请求控制权"],
  ["{holder}'s motion still runs: wait until it ends, then accept", "{holder} 的运动仍在进行：请待其结束后再接受"],
  ["{name} is in control already", "{name} 已在控制中"],
  ["nobody is in control: take it (ACQUIRE)", "无人控制：可直接取得控制（ACQUIRE）"],
  ["control was not offered to {name}: ask its holder, or ACQUIRE", "未向 {name} 移交控制权：请向控制者请求，或 ACQUIRE"],
  ["TAKE needs a reason: say in `reason` why control is taken away", "接管（TAKE）须在 reason 中说明理由"],
  ["nobody is in control, or the lease has ended: take control first (ACQUIRE)", "无人控制，或控制权已结束：请先取得控制（ACQUIRE）"],
  ["{name} is in control: wait until it is given back, or ask for it", "{name} 正在控制：请等待释放，或请求控制权"],
  ["{name} is in control with another lease (another window or program?): this one is not valid", "{name} 正以另一控制权控制（另一窗口或程序？）：此控制权无效"],
  ["{name} gave control back: {reason}", "{name} 释放了控制权：{reason}"],
  ["{name} gave control back", "{name} 释放了控制权"],
  ["handed over to {name}", "已移交给 {name}"],
  ["taken by {name}: {reason}", "被 {name} 接管：{reason}"],
  ["{name}'s lease was not renewed within {seconds} s", "{name} 的控制权未在 {seconds} 秒内续期"],
  ["{name}'s page or program has gone", "{name} 的页面或程序已离线"],
  ["the robot began to move, and its holder had not commanded it", "机器人开始运动，并非由控制者命令"],
  ["the gateway is being ended", "网关正在关闭"],
  ["no control: {text}, so it would not be known who had it", "不能取得控制：{text}，无法记录控制者"],
  ["control ended while the command was being written down", "写入审计日志期间控制权已结束"],
  ["control ended", "控制权已结束"],
  ["HOLD came before it could be sent", "保持命令先到，未发送"],
  ["given up with RESET", "已以复位放弃"],
  ["it was broken off while it was being written down", "写入审计日志时中断"],
  ["{text}, and what is not written down is not done", "{text}；未写入审计日志的不执行"],
  ["the audit log's disk takes longer than {seconds} s", "审计日志所在磁盘超过 {seconds} 秒无响应"],
  ["{text}, so a restart would forget a stop", "{text}；重新启动后会忘记停止"],
  ["the latch file {name} cannot be {done} ({reason})", "停止锁定文件 {name} 无法写入（{done}：{reason}）"],
  ["the latch file {name} takes longer than {seconds} s to write", "停止锁定文件 {name} 超过 {seconds} 秒未写入"],
  ["RESUME and another motion are two units: resume first, or RESET", "RESUME 与另一运动须分两次发送：请先继续，或复位"],
  ["the program {name} runs: stop it, or wait until it has ended", "程序 {name} 正在运行：请停止它，或等待其结束"],
  ["id {id} is not higher than {last}, the last one under this lease: count up with each command", "编号 {id} 不大于此控制权下的上一编号 {last}：每条命令须递增"],
  ["id {id} was used for {what}: count up with each command", "编号 {id} 已用于 {what}：每条命令须递增"],
  ["it came {seconds} s after its not_after: delayed on the way, or dated by another clock than the gateway's (`now` in each lease answer)", "晚于其 not_after {seconds} 秒到达：途中延迟，或所用时钟与网关不同（见每次控制权应答中的 now）"],
  ["it waited {waited} s in the gateway (for the audit log, or others before it); after {seconds} s nobody may be waiting for it: send it again", "在网关中等待了 {waited} 秒（等待审计日志或前面的请求）；超过 {seconds} 秒可能已无人等待，请重新发送"],
  ["stop {id} is not latched; nothing is", "停止 {id} 未锁定，目前没有锁定的停止"],
  ["RESET names stop {asked}, but stop {id} is latched ({by}: {reason}): see to it, then send RESET with stop_id {again}", "复位指定停止 {asked}，但锁定的是停止 {id}（{by}：{reason}）：请排除原因，再以 stop_id {again} 复位"],
  ["the robot still moves after stop {id}: wait until it stands, then RESET", "停止 {id} 之后机器人仍在运动：请待其静止后再复位"],
  ["stop {id} is latched ({by}: {reason}): see to it, then send RESET with stop_id {again}", "停止 {id} 已锁定（{by}：{reason}）：请排除原因，再以 stop_id {again} 复位"],
  ["read-only: {text}", "只读：{text}"],
  ["this robot is read-only: {text}", "此机器人只读：{text}"],
  ["its stop is not proven: try the stop unit on its controller (docs/safety.md says how), then write stop_proven = true at this robot in the site file", "其停止命令未经验证：请在控制器上试验停止（见 docs/safety.md），再在站点文件中写入 stop_proven = true"],
  ["the site file's codes have no stop for its controller: add the code of \"COMMAND:stop\", or of \"COMMAND\"", "站点文件的 codes 中没有此控制器的停止：请添加 \"COMMAND:stop\" 或 \"COMMAND\" 的代码"],
  ["the link to the controller is down ({text})", "与控制器断开（{text}）"],
  ["the controller is silent, where the robot is now is not known ({text})", "控制器无数据，机器人当前位置未知（{text}）"],
  ["the controller is in local mode: switch it to remote at the controller", "控制器处于本地模式：请在控制器上切换为远程"],
  ["the controller does not tell whether it is in remote or local mode; for one that never does, the site file can say accept_unknown = [\"mode\"]", "控制器未告知是远程还是本地模式；若它从不告知，可在站点文件中写入 accept_unknown = [\"mode\"]"],
  ["the controller is stopped: see to it, then send RESET", "控制器已停止：请排除原因，再复位"],
  ["the controller has a fault ({fault}): mend it, then send RESET", "控制器故障（{fault}）：请排除，再复位"],
  ["a motion is on hold: RESUME it, or give it up with RESET", "有运动处于保持：请继续，或以复位放弃"],
  ["where the robot is now is not known ({text})", "机器人当前位置未知（{text}）"],
  ["joint positions have not come for {seconds} s", "{seconds} 秒未收到关节位置"],
  ["the controller has not told where the joints are", "控制器未告知关节位置"],
  ["nothing is on hold: there is no motion to resume", "没有处于保持的运动可继续"],
  ["the robot is not homed: home it first (HOME)", "机器人未回零：请先回零（HOME）"],
  ["the controller does not tell whether the robot is homed: home it first (HOME); for a controller that never tells, the site file can say accept_unknown = [\"homed\"]", "控制器未告知是否已回零：请先回零（HOME）；若它从不告知，可在站点文件中写入 accept_unknown = [\"homed\"]"],
  ["SPEED needs speed_percent, from 1 to 100", "SPEED 须带 speed_percent，1 至 100"],
  ["speed {value} % is outside 1 to 100 %", "速度 {value} % 超出 1 至 100 %"],
  ["{count} joint positions, but the robot has {joints} joints ({names})", "给出 {count} 个关节位置，而机器人有 {joints} 个关节（{names}）"],
  ["joint {name} at {value} is beyond its limit {limit}", "关节 {name} 的 {value} 超出限位 {limit}"],
  ["joint {name} at {value} is not a finite number", "关节 {name} 的 {value} 不是有限数值"],
  ["{terms} at {value} is beyond its limit {limit}", "{terms} 的 {value} 超出限位 {limit}"],
  ["it cannot be checked, and this robot's site says check = \"require\": {text}", "无法检查，而站点文件要求检查（check = \"require\"）：{text}"],
  ["where the held motion goes is not known: give it up (RESET), move anew", "保持中的运动去向未知：请以复位放弃，再重新运动"],
  ["nobody knows {text}", "未知：{text}"],
  ["where {name} is or goes ({reason})", "{name} 的位置或去向（{reason}）"],
  ["its controller does not tell where the robot is", "其控制器未告知机器人位置"],
  ["the robot moves, or is about to: wait until it stands, or {text}", "机器人正在或即将运动：请待其静止，或{text}"],
  ["stop it", "停止它"],
  ["send it home", "让其回零"],
  ["{text} since the motion was checked", "检查之后{text}"],
  ["{name} has moved, or was told to,", " {name} 已移动，或收到运动命令"],
  ["the robot has moved since its program was checked", "程序检查之后机器人已移动"],
  ["the robot has moved", "机器人已移动"],
  ["the check took longer than {seconds} s: others are being checked", "检查超过 {seconds} 秒：正在检查其他请求"],
  ["the check took longer than {seconds} s", "检查超过 {seconds} 秒"],
  ["on its way {text}", "途中{text}"],
  ["line {line}: {text}", "第 {line} 行：{text}"],
  ["{one} touches {other}", "{one} 与 {other} 接触"],
  ["{one} comes within {distance} mm of {other}, nearer than its {text} distance of {limit} mm", "{one} 距 {other} 仅 {distance} mm，小于{text}距离 {limit} mm"],
  ["stop", "停止"],
  ["warning", "警告"],
  ["HOLD came while it was being checked: not started", "检查期间收到保持命令：未开始"],
  ["it was not checked before its asker gives up: wait longer (not_after), ask again", "未在请求者的等待时间内完成检查：请延长等待（not_after）后重新发送"],
  ["it takes longer than {seconds} s to plan; nobody would wait for it", "规划超过 {seconds} 秒，不再等待"],
  ["and {count} more", "另有 {count} 处"],
  ["program {name} is done", "程序 {name} 已完成"],
  ["program {name} ended at {text}", "程序 {name} 中止于{text}"],
  ["stopped by {by}: {reason}", "{by} 请求停止：{reason}"],
  ["control ended: {text}", "控制权结束：{text}"],
  ["stop request {id} is on the controller's socket", "停止 {id} 已发送给控制器"],
  ["stop request {id} is latched, but not sent: {text}", "停止 {id} 已锁定，但未送达：{text}"],
  ["stop request {id} was sent to the controller when its link came back", "连接恢复后停止 {id} 已发送给控制器"],
  ["{text}; it is sent as soon as the link is back", "{text}；连接恢复后立即发送"],
  ["turned away unread: too many requests waited already", "未读取即拒绝：等待的请求过多"],
  ["too many requests wait for this owner already: ask again, and less often", "等待的请求过多：请稍后再试，并降低频率"],
  ["{text} (the last of many askers)", "{text}（多个请求者中的最后一个）"],
  ["the link was closed", "连接已关闭"],
  ["connecting to {where}", "正在连接 {where}"],
  ["connected to {where}, no unit yet", "已连接 {where}，尚未收到数据"],
  ["connected to {where}", "已连接 {where}"],
  ["cannot connect to {where}: {reason}", "无法连接 {where}：{reason}"],
  ["{where} does not answer", "{where} 无应答"],
  ["{where} sends nothing; connecting again", "{where} 无数据，正在重连"],
  ["{where} sends nothing", "{where} 无数据"],
];
// What stands before them.
const BEFORE: readonly (readonly [english: string, chinese: string])[] = [
  ["Not sent: ", "未发送："],
  ["Not run: ", "未运行："],
  ["not done: ", "未完成："],
];
const MOST_KNOWN = 10_000; // a journal holds half as many

const patterns = SENTENCES.map(([english, chinese]) => ({ pattern: patternOf(english), chinese }));
/** A journal asks for the same ones again and again. */
const known = new Map<string, string | null>();

/** A gateway's text in the page's language; itself where there are no words for it here. */
export function gatewayText(text: string): string {
  return (language.value === "zh" && text && inChinese(text)) || text;
}

/** Of a sentence, whose values may be anything. */
function patternOf(english: string): RegExp {
  const parts = english.split(/\{(\w+)\}/).map((part, i) => (i % 2 ? `(?<${part}>.+?)` : part.replace(/[.*+?^$(){}|[\]\\]/g, "\\$&")));
  return new RegExp(`^${parts.join("")}$`, "s");
}

function inChinese(text: string): string | null {
  const before = known.get(text);
  if (before !== undefined) return before;
  if (known.size > MOST_KNOWN) known.clear();
  const found = listed(text) ?? sentence(text) ?? whole(text);
  known.set(text, found);
  return found;
}

function sentence(text: string): string | null {
  for (const { pattern, chinese } of patterns) {
    const found = pattern.exec(text);
    if (!found) continue;
    const values = { ...found.groups };
    const inner = values["text"] && inChinese(values["text"]);
    if (inner === null) continue;
    if (inner) values["text"] = inner;
    return inLanguage([chinese, chinese], values);
  }
  return null;
}

/** "Not sent: ….", of which the middle is known. */
function whole(text: string): string | null {
  const [english, chinese] = BEFORE.find(([each]) => text.startsWith(each)) ?? ["", ""];
  if (!english && !text.endsWith(".")) return null;
  const end = text.endsWith(".") ? 1 : 0;
  const middle = inChinese(text.slice(english.length, text.length - end));
  return middle && `${chinese}${middle}${end ? "。" : ""}`;
}

function listed(text: string): string | null {
  const each = text.split("; ");
  const words = each.length > 1 ? each.map(inChinese) : [null];
  return words.includes(null) ? null : words.join("；");
}
