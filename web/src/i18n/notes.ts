// Texts of notes, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  note: ["Note", "备注"],
  open: ["Note…", "备注…"],
  note_hint: ["Write a note on this robot's time, for everybody.", "为此机器人的时间写备注，供所有人查看。"],
  text: ["Text", "内容"],
  on: ["On", "时间"],
  now: ["Now", "现在"],
  last_10: ["Last 10 s", "最近 10 秒"],
  last_60: ["Last minute", "最近 1 分钟"],
  moment: ["This moment", "此时刻"],
  range: ["From here to the player's position", "从此处到播放位置"],
  from_to: ["{from} to {to}", "{from} 至 {to}"],
  save: ["Save note", "保存备注"],
  saving: ["Saving the note…", "正在保存备注…"],
  not_saved: ["Not saved: {text}", "未保存：{text}"],
  no_store: [
    "The site's store does not answer, so notes cannot be saved or read now.",
    "站点的存储服务无应答，暂时无法保存或读取备注。",
  ],
  name_needed: ["Enter your name: it is kept with the note.", "请输入姓名：将与备注一同保存。"],
  monitor: ["Only operators write notes.", "仅操作员可写备注。"],
  withdraw: ["Withdraw this note", "撤回此备注"],
  withdraw_hint: ["It stays in the record, struck through.", "备注仍保留在记录中，并加删除线。"],
  withdrawn: ["withdrawn", "已撤回"],
  beside: ["Not in the file: from the site's notes.", "不在文件中：来自站点的备注。"],
  older: ["Read older notes", "读取更早的备注"],
  older_busy: ["Reading the notes of {count} robots…", "正在读取 {count} 个机器人的备注…"],
  older_done: ["Notes found: {count}", "找到备注：{count}"],
  older_failed: ["{robot}: {text}", "{robot}：{text}"],
} as const;

/** Return a text in the page's language. */
export function n(name: keyof typeof TEXTS, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}
