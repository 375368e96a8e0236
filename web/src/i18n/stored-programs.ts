// Texts of stored programs, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  save: ["Save", "保存"],
  save_as: ["Save as new", "另存为"],
  save_hint: ["Saves a version at the site, for everybody (Ctrl+S).", "在站点保存一个版本，供所有人使用（Ctrl+S）。"],
  monitor: ["Only operators change stored programs.", "仅操作员可更改已存程序。"],
  saved_state: ["Saved state", "保存状态"],
  programs: ["Programs", "程序库"],
  programs_hint: ["The programs that the site stores for this robot.", "站点为此机器人存储的程序。"],
  back_to_text: ["Back to the text", "返回文本"],
  to_list: ["All programs", "全部程序"],

  no_store: [
    "This site's store does not answer: the draft is kept in this browser only.",
    "本站点的程序存储服务无应答：草稿仅保存在此浏览器中。",
  ],
  never_saved: ["Never saved: kept in this browser only.", "从未保存：仅保存在此浏览器中。"],
  unsaved: ["Unsaved changes since version {version}.", "自版本 {version} 以来有未保存的更改。"],
  is_saved: ["Version {version}, saved by {author}, {time}.", "版本 {version}，{author} 保存于 {time}。"],
  newer: ["{author} saved version {version}, {time}.", "{author} 于 {time} 保存了版本 {version}。"],
  newer_unsaved: [
    "{author} saved version {version}; you have unsaved changes.",
    "{author} 保存了版本 {version}；您有未保存的更改。",
  ],
  gone: ["{author} deleted this program: {reason}.", "{author} 已删除此程序：{reason}。"],
  compare: ["Compare", "比较"],
  saving: ["Saving…", "正在保存…"],
  saved: ["Saved: version {version}.", "已保存：版本 {version}。"],
  unchanged: ["Nothing to save: version {version} has this text.", "无需保存：版本 {version} 即为此文本。"],

  none: ["No program is stored yet. Save the text, or import files.", "尚未存储程序。请保存文本，或导入文件。"],
  show_deleted: ["Deleted too", "含已删除"],
  import: ["Import files…", "导入文件…"],
  imported: ["{name}: version {version} imported.", "{name}：已导入为版本 {version}。"],
  not_imported: ["{name} is not imported: {text}", "未导入 {name}：{text}"],
  too_large: ["more than 64 KiB", "超过 64 KiB"],
  no_text: ["it is no text", "不是文本文件"],
  row: ["version {version} · {author} · {time}", "版本 {version} · {author} · {time}"],
  deleted: ["deleted", "已删除"],
  open: ["Open", "打开"],
  open_named: ["Open {name}", "打开 {name}"],
  versions: ["Versions", "版本"],
  versions_of: ["Versions of {name}", "{name} 的版本"],
  loses: [
    "“{name}” has unsaved changes. Open this instead? Undo brings them back.",
    "“{name}”有未保存的更改。仍要打开吗？可用撤销恢复。",
  ],
  open_anyway: ["Open instead", "仍要打开"],
  opened: [
    "{name}, version {version}, opened. Undo brings the old text back.",
    "已打开 {name} 版本 {version}。可撤销。",
  ],

  change_1: ["saved", "保存"],
  change_2: ["put aside", "另存旁支"],
  change_3: ["renamed “{name}”", "重命名为“{name}”"],
  change_4: ["restored version {based_on}", "恢复版本 {based_on}"],
  change_5: ["deleted: {reason}", "删除：{reason}"],
  change_6: ["ran without being saved", "未保存即运行"],
  current: ["current", "当前"],
  this_draft: ["your text", "您的文本"],
  version: ["version {version}", "版本 {version}"],
  compare_with: ["Compare with", "比较对象"],
  view: ["Display", "显示方式"],
  unified: ["unified", "合并"],
  side_by_side: ["side by side", "并排"],
  whole: ["text", "全文"],
  equal: ["The texts are equal.", "文本相同。"],
  equal_lines: ["{count} equal lines", "{count} 行相同"],
  difference: ["Difference", "差异"],
  removed_lines: ["{count} removed", "删除 {count} 行"],
  added_lines: ["{count} added", "新增 {count} 行"],
  open_version: ["Open in the editor", "在编辑器中打开"],
  restore: ["Restore version {version}", "恢复版本 {version}"],
  restored: ["Version {from} is restored as version {version}.", "版本 {from} 已恢复为版本 {version}。"],
  rename: ["Rename", "重命名"],
  new_name: ["New name", "新名称"],
  renamed: ["Renamed.", "已重命名。"],
  delete: ["Delete", "删除"],
  delete_title: ["Delete {name}", "删除 {name}"],
  delete_words: [
    "Everybody sees that you deleted it, and why. All versions are kept and can be restored.",
    "所有人都会看到由您删除及其原因。所有版本都会保留并可恢复。",
  ],
  deleted_now: ["{name} is deleted. It can be restored.", "{name} 已删除，可以恢复。"],
  export: ["Export file", "导出文件"],

  ran: ["“{name}”, as it ran", "“{name}”（运行时的文本）"],
  ran_by: [
    "{author} ran this text without saving it, last at {time}.",
    "{author} 运行了此文本但未保存，最后一次于 {time}。",
  ],
  loading: ["Loading…", "正在加载…"],
  conflict: ["Two people changed “{name}”", "两人同时更改了“{name}”"],
  conflict_words: [
    "{author} saved version {version} after you opened it. Your text is kept as version {mine}. Removed lines are {author}'s, added lines yours.",
    "您打开之后，{author} 保存了版本 {version}。您的文本已保留为版本 {mine}。删除的行属于 {author}，新增的行属于您。",
  ],
  use_mine: ["Make mine current", "以我的为当前版本"],
  use_theirs: ["Continue with theirs", "继续使用对方的"],
} as const;

export type StoredText = keyof typeof TEXTS;

/** Return a text of stored programs in the page's language. */
export function s(name: StoredText, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}
