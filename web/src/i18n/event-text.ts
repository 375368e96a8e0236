// Events in Chinese by code: a sentence with their values, or the alarm that ended; and the reason. In English the
// event's own text is shown.

import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { Event, Note } from "../gen/robomesh_pb";
import { Event_Severity as Severity } from "../gen/robomesh_pb";
import { alarmTitle } from "./alarm-text";
import { isolated } from "./foreign-text";
import { stampWhen, whenText } from "./format";
import { reasonText } from "./reasons";
import { isSaid, operatorText } from "./stop-words";
import { language, t } from "./texts";

// Events that need no action. A code that can also be an alarm is listed for its normal severity.
const CHINESE: Record<string, string> = {
  "mesh.key_ignored": "已忽略不符合网络命名规则的键：{key}。",
  "link.up": "与控制器的连接正常。",
  "link.silent": "已连接控制器，尚未收到数据。",
  "link.flooding_ended": "控制器数据不再过载。",
  "link.channel_back": "控制器的接口 {channel} 已重新连接。",
  "joints.back": "重新收到关节位置。",
  "status.back": "重新收到控制器状态。",
  "controller.tool_changed": "控制器上的工具已更改：{changes}。",
  "controller.payload_changed": "控制器上的负载已更改：{changes}。",
  "controller.frame_changed": "控制器上的用户坐标系已更改：{changes}。",
  "controller.software": "控制器软件：{software}。",
  "recover.confirmed": "{by} 已确认 {changes}{cause}。",
  "controller.remote": "控制器恢复远程模式。",
  "joints.unproven": "请核对关节{cause}。",
  "robot.read_only": "机器人只读{cause}。",
  "motion.foreign": "机器人开始运动，并非由网关命令。",
  "lease.ended": "{holder} 的控制权已结束{cause}。",
  "program.started": "{operator} 开始运行程序 {program}。",
  "program.done": "程序 {program} 已完成。",
  "audit.rotated": "审计日志换用新文件：{file}。",
  "audit.mended": "审计日志恢复写入。",
  "legacy.attached": "旧客户端程序已接入：{client}。",
  "legacy.gone": "旧客户端程序已离开：{client}。",
  "kinematics.singularity": "接近奇异位形（裕度 {margin}）：走直线时关节速度会很快。",
  "kinematics.singularity.over": "已离开奇异位形。",
  "recorder.trace_joined": "控制器的跟踪写入正在进行的录制 {recording}。",
  "recorder.recovered": "录制 {file} 上次未正常关闭，现已完整。",
  "recorder.saved": "最近几分钟的录制现已保存。",
  "renderer.keeps_up": "渲染重新跟上所有观看的画面。",
  "router.rules": "路由器已采用新的规则和密钥。",
  "account.signed_in": "{account} 从 {address} 登录。",
  "account.unlocked": "{account} 在 {address} 再次输入了密码。",
  "account.signed_out": "{account}（{address}）已登出：{reason}。",
  "account.changed": "{account} 更改了账户 {changed}：{action}。",
  "token.added": "令牌 {token} 可打开 {robot} 的视图 {view}。",
  "token.revoked": "令牌 {token} 已吊销。",
  "token.used": "令牌 {token} 从 {address} 使用。",
  "alarm.acknowledged": "{by} 确认了报警 {id}。",
  "alarm.shelved": "{by} 将报警 {id} 搁置 {minutes} 分钟：{reason}",
  "alarm.unshelved": "{by} 取消搁置报警 {id}。",
};

// A note on an earlier time names it.
const AT_ONCE_MS = 2000;

// Values that are words of a program.
const VALUES: Record<string, string> = {
  "reason:signed_out": "本人登出",
  "reason:replaced": "重新登录",
  "reason:too_many": "登录地点过多",
  "reason:expired": "会话已满一周",
  "reason:idle": "一小时内没有打开的页面",
  "reason:removed": "账户已删除",
  "reason:disabled": "账户已停用",
  "reason:password": "密码已更改",
  "reason:ended": "由管理员结束",
  "action:add": "添加",
  "action:role": "更改角色",
  "action:password": "更改密码",
  "action:disable": "停用",
  "action:enable": "启用",
  "action:remove": "删除",
};

// Alarm texts that need a value, because there may be several.
const OF_WHAT = ["joint", "second", "robot", "service", "site"] as const;

/** Return the Chinese text of an event; null: show its own text. Of an event that needs action, only its reason has one. */
function eventInChinese({ code, severity, values, reason }: Event): string | null {
  if (language.value !== "zh") return null;
  const why = reasonText(reason, "");
  if (why && reason?.code === code) return `${why}。`;
  if (severity > Severity.INFO) {
    const title = alarmTitle(code);
    return why && title ? `${title}：${why}。` : null;
  }
  const sentence = CHINESE[code];
  if (sentence) return filled(sentence, { ...values, cause: why && `：${why}` });
  const title = alarmTitle(code.replace(/\.over$/, ""));
  if (!title) return null;
  const of = OF_WHAT.map((name) => values[name]).find(Boolean);
  return `已解除：${title}${of ? `（${of}）` : ""}`;
}

/** Null: an older program sent it without a value that the sentence needs. */
function filled(sentence: string, values: Record<string, string>): string | null {
  let all = true;
  const text = sentence.replace(/\{(\w+)\}/g, (_, name: string) => {
    const value = values[name];
    all &&= value !== undefined;
    return VALUES[`${name}:${value}`] ?? isolated(value ?? "");
  });
  return all ? text : null;
}

/** Return the page's text of the most common events, otherwise the event's own. */
export function eventText(event: Event): string {
  const { code, values } = event;
  const by = values.by ?? "";
  const reason = values.reason;
  switch (code) {
    case "stop.latched": {
      const time = stampWhen(event.timestamp);
      const text = t(values.sent === "True" ? "event_stop" : "event_stop_unsent", { by: operatorText(by), time });
      return isSaid(reason) ? `${text} ${t("stop_reason", { reason })}` : text;
    }
    case "note.written": {
      if (!event.note) break;
      const { author, text } = event.note;
      const time = noteTime(event.note, event.timestamp);
      return t(time ? "event_note_on" : "event_note", { author: isolated(author), text, time });
    }
    case "stop.sent":
      return t("event_stop_sent");
    case "stop.reset":
      return t("event_stop_reset");
  }
  return eventInChinese(event) ?? event.text;
}

/** Return the time that a note is on; empty: the one at which it was written. */
function noteTime({ begin, end }: Note, written: Timestamp | undefined): string {
  const [from, at] = [begin, written].map((stamp) => (stamp ? timestampMs(stamp) : 0)) as [number, number];
  if (!end && Math.abs(at - from) < AT_ONCE_MS) return "";
  const first = whenText(from, at);
  return end ? `${first} – ${whenText(timestampMs(end), from)}` : first;
}
