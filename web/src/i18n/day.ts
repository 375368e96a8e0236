// Texts of the history of a day, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  day: ["Day", "日期"],
  robot: ["Robot", "机器人"],
  choose: ["Choose a robot.", "请选择机器人。"],
  earlier: ["The day before", "前一天"],
  later: ["The day after", "后一天"],
  reading: ["Reading the day…", "正在读取这一天…"],
  nothing: ["Nothing is known of this day.", "这一天没有已知记录。"],
  future: ["This day has not begun.", "这一天尚未开始。"],
  program: ["In a program", "运行程序"],
  stopped: ["Stopped", "已停止"],
  offline: ["Without a link", "无连接"],
  unknown: ["Not known", "未知"],
  unknown_hint: [
    "Whether it moved or waited outside of programs is only in recordings.",
    "程序之外是运动还是等待，只有录制中才有记录。",
  ],
  motions: ["{who}: {count} commands", "{who}：{count} 条命令"],
  run: ["{who} ran program {name}", "{who} 运行程序 {name}"],
  runs: ["{who} ran program {name} {count} times", "{who} 运行程序 {name} {count} 次"],
  run_done: ["done", "已完成"],
  runs_done: ["{count} done", "{count} 次完成"],
  recording: ["Recording {name}, {time}", "录制 {name}，{time}"],
  recording_open: ["Recording {name}, still running", "录制 {name}，仍在进行"],
  over_after: ["over after {time}", "{time} 后恢复"],
  withdrawn: ["withdrawn", "已撤回"],
  incomplete: ["This day is not complete:", "这一天的记录不完整："],
  no_audit: ["The requests are missing: {text}", "缺少请求记录：{text}"],
  cut_audit: [
    "Of the requests only the newest {count} are here, from {time} on.",
    "仅有 {time} 起最新的 {count} 条请求。",
  ],
  no_events: [
    "No event of the gateway is known, so links and alarms are missing.",
    "没有网关的事件，因此缺少连接和报警。",
  ],
  events_from: [
    "Events, so links and alarms, are known from {time} on: services keep their last 100.",
    "事件（因此连接和报警）从 {time} 起已知：各服务保留最近 100 条。",
  ],
  no_notes: ["The older notes are missing: {text}", "缺少更早的备注：{text}"],
  no_recordings: ["The recordings are missing: {text}", "缺少录制：{text}"],
  not_over: ["Until now.", "截至目前。"],
  as_text: ["Text", "文本"],
  as_csv: ["CSV", "CSV"],
  save_hint: ["Saves what is shown as a file.", "将所显示内容保存为文件。"],
  kind_control: ["control", "控制"],
  kind_program: ["program", "程序"],
  kind_stop: ["stop", "停止"],
  kind_alarm: ["alarm", "报警"],
  kind_recording: ["recording", "录制"],
  kind_note: ["note", "备注"],
  hours: ["{hours} h {minutes} min", "{hours} 小时 {minutes} 分"],
  minutes: ["{minutes} min {seconds} s", "{minutes} 分 {seconds} 秒"],
  seconds: ["{seconds} s", "{seconds} 秒"],
} as const;

export type DayTextName = keyof typeof TEXTS;

/** Return a text in the page's language. */
export function d(name: DayTextName, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}

/** Format a duration [ms]: "3 h 12 min", "4 min 10 s", "9 s". */
export function lastedText(ms: number): string {
  const seconds = Math.round(Math.max(0, ms) / 1000);
  const minutes = Math.floor(seconds / 60);
  if (minutes >= 60) return d("hours", { hours: Math.floor(minutes / 60), minutes: minutes % 60 });
  return minutes ? d("minutes", { minutes, seconds: seconds % 60 }) : d("seconds", { seconds });
}
