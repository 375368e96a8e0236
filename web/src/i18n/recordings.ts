// Texts of Recordings, in English and Chinese, with `{name}` placeholders.

import { inLanguage, viewText } from "./texts";

const TEXTS = {
  recordings: ["Recordings", "录制"],
  count: ["{count} recordings", "{count} 个录制"],
  count_one: ["1 recording", "1 个录制"],
  shown_of: ["{shown} of {count} recordings", "{count} 个录制中的 {shown} 个"],
  search: ["Search robot, name, cause", "搜索机器人、名称、原因"],
  search_short: ["Search", "搜索"],
  robot: ["Robot", "机器人"],
  every_robot: ["All robots", "所有机器人"],
  time: ["Time", "时间"],
  tag: ["Tag", "标签"],
  every_tag: ["All tags", "所有标签"],
  tags_hint: ["Tags, separated by commas", "标签，用逗号分隔"],
  note: ["Note", "备注"],
  name: ["Name", "名称"],
  edit: ["Edit", "编辑"],
  edit_of: ["Edit {name}", "编辑 {name}"],
  save: ["Save", "保存"],
  not_changed: ["Nothing changed: {text}", "未更改：{text}"],
  delete: ["Delete…", "删除…"],
  delete_of: ["Delete {name}", "删除 {name}"],
  delete_words: [
    "The file of {name} is deleted for good. Your name and the reason stay in Events.",
    "{name} 的文件将被永久删除。您的姓名和原因会保留在事件中。",
  ],
  delete_now: ["Delete for good", "永久删除"],
  stop_recording: ["Stop", "停止"],
  stop_of: ["Stop recording {name}", "停止录制 {name}"],
  choose_of: ["Choose {name} for a download", "选择 {name} 以下载"],
  choose_hint: ["Choose several to download them together.", "可选择多个一起下载。"],
  chosen: ["{count} chosen, {size}", "已选 {count} 个，{size}"],
  chosen_one: ["1 chosen, {size}", "已选 1 个，{size}"],
  choose_all: ["Choose all {count} shown", "选择显示的全部 {count} 个"],
  choose_none: ["Choose none", "取消选择"],
  zip: ["Download ZIP", "下载 ZIP"],
  zip_hint: [
    "One ZIP with the files as they were recorded, and their names, notes and tags.",
    "一个 ZIP，含原始录制文件及其名称、备注和标签。",
  ],
  zip_too_many: ["{count} chosen: at most {most} in one download.", "已选 {count} 个：一次最多下载 {most} 个。"],
  any_time: ["Any time", "任意时间"],
  today: ["Last 24 hours", "最近 24 小时"],
  week: ["Last 7 days", "最近 7 天"],
  none: ["Nothing is recorded yet. Start a recording on a robot's page.", "尚无录制。请在机器人页面上开始录制。"],
  no_match: ["No recording matches.", "没有匹配的录制。"],
  no_recorder: [
    "The recorder of {site} does not answer: its recordings cannot be listed now. Trying again.",
    "{site} 的录制服务无应答，暂时无法列出其录制，正在重试。",
  ],
  list_refused: ["The recordings of {site} cannot be listed: {text}", "无法列出 {site} 的录制：{text}"],
  free: ["{size} free", "剩余 {size}"],
  free_low: ["only {size} free", "仅剩 {size}"],
  free_none: ["{size} free: nothing can be recorded", "剩余 {size}：无法录制"],
  flight_full: ["Flight recorder keeps nothing: disk full", "循环录制未保存任何内容：磁盘已满"],
  nothing_written: ["Nothing was written.", "未写入任何内容。"],
  flight_on: ["Flight recorder on", "循环录制：开"],
  flight_off: ["Flight recorder off", "循环录制：关"],
  flight_on_hint: [
    "It always keeps the last minutes, and saves them when something goes wrong.",
    "始终保留最近几分钟，出现问题时自动保存。",
  ],
  flight_off_hint: [
    "Nothing is kept of what nobody records. The site file turns it on.",
    "未录制的内容不会保留。可在站点文件中开启。",
  ],
  save_last: ["Save the last minutes", "保存最近几分钟"],
  save_of: ["Save the last minutes of {robot}", "保存 {robot} 的最近几分钟"],
  saving: ["Saving the last minutes of {robot}…", "正在保存 {robot} 的最近几分钟…"],
  saved: ["The last minutes of {robot} are kept, as {name}.", "已保存 {robot} 的最近几分钟：{name}。"],
  not_saved: ["Not saved: {text}", "未保存：{text}"],

  recording_now: ["recording now", "正在录制"],
  recovered: ["recovered", "已恢复"],
  recovered_hint: ["Its writer was killed; the file was made whole afterwards.", "写入进程曾被终止，文件随后已修复。"],
  part: ["part {part}", "第 {part} 部分"],
  merged: ["merged", "已合并"],
  by_trace: ["by the controller's trace", "由控制器跟踪启动"],
  by_flight: ["by the flight recorder", "由循环录制保存"],
  by_request: ["on request", "按请求"],
  cause: ["Saved because: {text}", "保存原因：{text}"],
  messages: ["{count} messages", "{count} 条消息"],
  lost_none: ["nothing lost", "无丢失"],
  lost: ["lost: {topics}", "丢失：{topics}"],
  lost_of: ["{count} of {topic}", "{topic} {count} 条"],
  no_thumbnail: ["No picture of it", "无图像"],
  play: ["Play", "播放"],
  play_of: ["Play {name}", "播放 {name}"],
  download_mcap_hint: [
    "Downloads the file: everything that was recorded. Foxglove, Lichtblick and Rerun open it.",
    "下载完整录制文件，可用 Foxglove、Lichtblick、Rerun 打开。",
  ],
  download_csv_hint: ["Downloads joints and tool as a table.", "下载关节与工具数据表。"],
  download_of: ["Download {name} as {kind}", "下载 {name}（{kind}）"],
  compare: ["Compare", "比较"],
  compare_hint: ["Choose two to play them beside each other.", "选择两个录制进行对比播放。"],
  compare_with: ["Compare with {name}", "与 {name} 比较"],
  compare_second: ["Choose another recording to compare with {name}.", "请选择另一个录制与 {name} 比较。"],
  cancel: ["Cancel", "取消"],

  back: ["All recordings", "全部录制"],
  opening: ["Opening the recording…", "正在打开录制…"],
  no_player: [
    "No player answers at {site}, so nothing can be played now. The file can be downloaded all the same.",
    "{site} 没有播放服务应答，暂时无法播放，但仍可下载文件。",
  ],
  not_opened: ["It cannot be played: {text}", "无法播放：{text}"],
  player_gone: ["The player does not answer any more. What is shown is not moving.", "播放服务已无应答，画面已停止。"],
  closed: ["The replay has ended: {text}", "回放已结束：{text}"],
  open_again: ["Open again", "重新打开"],
  info_refused: ["What it holds is not known: {text}", "无法得知其内容：{text}"],

  replay: ["replay", "回放"],
  replay_of: ["replay of {robot}, {time}", "{robot} 的回放，{time}"],
  replay_words: ["Nothing here is live, and nothing here can move.", "此处无实时数据，也不会引起任何运动。"],
  replays: ["Replays", "回放"],
  replays_words: ["Recordings that are being played back. None of them is live.", "正在播放的录制，均非实时。"],
  to_recording: ["Open its recording", "打开其录制"],
  paused: ["paused", "已暂停"],
  playing: ["playing", "播放中"],

  no_picture_then: ["No video was recorded of this moment.", "此时刻没有录制视频。"],
  no_joints_then: ["No joints were recorded of this moment.", "此时刻没有录制关节数据。"],
  not_decoded: [
    "This browser decodes recorded video over https or on localhost only.",
    "此浏览器仅在 https 或 localhost 下才能解码录制的视频。",
  ],
  recorded_view: ["{view}, recorded", "{view}（录制）"],
  video: ["Video", "视频"],
  video_second: ["Video of {name}", "{name} 的视频"],

  joints: ["Joints", "关节"],
  tool_and_margins: ["Tool and distances", "工具与距离"],
  controller: ["Controller", "控制器"],

  transport: ["Transport", "播放控制"],
  pause: ["Pause", "暂停"],
  step_back: ["One step back ({step} s)", "后退一步（{step} 秒）"],
  step_on: ["One step on ({step} s)", "前进一步（{step} 秒）"],
  to_start: ["To the start", "回到开头"],
  speed: ["Speed", "速度"],
  loop: ["Loop", "循环"],
  moment: ["Moment", "时刻"],
  keys: [
    "Keys: space plays and pauses, ← → one step, Shift ← → ten, Home and End, + − speed, L loop.",
    "键盘：空格播放/暂停，← → 单步，Shift ← → 十步，Home/End 首尾，+ − 速度，L 循环。",
  ],
  position_of: ["{position} of {duration}", "{position} / {duration}"],

  plots: ["Plots", "曲线"],
  values: ["Values…", "选择数值…"],
  values_done: ["Done", "完成"],
  values_filter: ["Filter values", "筛选数值"],
  values_none: ["This recording holds no numbers.", "此录制中没有数值。"],
  values_choose: ["Choose values to plot.", "请选择要绘制的数值。"],
  values_many: ["At most {count} at once.", "最多同时显示 {count} 个。"],
  plots_waiting: ["Reading the values…", "正在读取数值…"],
  plots_refused: ["The values cannot be read: {text}", "无法读取数值：{text}"],
  plot_hint: ["Click: go there. Drag: zoom.", "点击跳转，拖动缩放。"],
  zoom_out: ["Whole time", "全部时间"],
  save_picture: ["Picture", "图片"],
  save_picture_hint: ["Downloads the plots as they are shown, as PNG.", "将当前曲线下载为 PNG 图片。"],

  events: ["Events", "事件"],
  no_events: ["No event was recorded.", "没有录制到事件。"],
  run_step: ["1 step", "1 个步骤"],
  run_steps: ["{count} steps", "{count} 个步骤"],
  events_cut: ["The first {count} are shown.", "仅显示前 {count} 条。"],
  events_refused: ["The events cannot be read: {text}", "无法读取事件：{text}"],
  asked: ["{who} asked {what}", "{who} 请求 {what}"],
  asked_refused: ["{who} asked {what}, refused", "{who} 请求 {what}，被拒绝"],
  asked_failed: ["{who} asked {what}, which failed", "{who} 请求 {what}，失败"],
  go_to_event: ["Go to {time}: {text}", "转到 {time}：{text}"],

  contents: ["Contents", "内容"],
  topic: ["Topic", "主题"],
  topic_messages: ["Messages", "消息"],
  topic_lost: ["Lost", "丢失"],
  attached: ["Inside the file: {names}", "文件内附：{names}"],
  export: ["Export", "导出"],
  export_mp4: ["MP4 of “{view}”", "“{view}” 的 MP4"],
  export_mp4_live: [
    "Saves this view as it plays from now on, at the speed chosen above, until you end the download.",
    "从现在起按上方速度保存此视图的播放画面，直到结束下载。",
  ],
  export_line: [
    "MP4 drawn afresh, of the whole recording at any size, by the command line:",
    "用命令行重新绘制整个录制的 MP4（尺寸任选）：",
  ],
  copy: ["Copy", "复制"],
  copied: ["Copied", "已复制"],

  second: ["Second", "第二个"],
  compared: ["Compared with {name}, which begins {shift} s {sense}", "与 {name} 比较，其起点{sense} {shift} 秒"],
  later: ["later", "晚"],
  earlier: ["earlier", "早"],
  compared_same: ["Compared with {name}, both from their starts", "与 {name} 比较，均从起点开始"],
  ghost_of: ["The blue ghost is {name}.", "蓝色虚影为 {name}。"],
  dashed: ["Solid: {first}. Dashed: {second}.", "实线：{first}。虚线：{second}。"],
  align_starts: ["Align at starts", "按起点对齐"],
  align_event: ["Align at event", "按事件对齐"],
  align_choose: ["Event of the first", "第一个的事件"],
  align_choose_second: ["Event of the second", "第二个的事件"],
  compare_end: ["End comparison", "结束比较"],

  record: ["Record…", "录制…"],
  record_name: ["Name of the recording", "录制名称"],
  record_name_hint: ["Name (optional)", "名称（可选）"],
  record_start: ["Record", "开始录制"],
  record_stop: ["Stop recording", "停止录制"],
  record_views: ["Video of", "视频"],
  record_views_site: ["as the site says", "按站点设置"],
  record_views_none: ["none", "无"],
  record_starting: ["Starting…", "正在开始…"],
  record_stopping: ["Closing the file…", "正在关闭文件…"],
  record_refused: ["Not done: {text}", "未完成：{text}"],
  record_no_answer: ["The recorder does not answer.", "录制服务无应答。"],
  record_gone: ["No recorder is there: nothing is recorded.", "没有录制服务：未在录制。"],
  record_stale: ["The recorder has not been heard of for {age}.", "已 {age} 未收到录制服务的消息。"],
  record_last: ["Last: ", "上次："],
} as const;

export type RecordingsText = keyof typeof TEXTS;

/** Return a text of Recordings in the page's language. */
export function r(name: RecordingsText, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}

const RECORDED = "recorded-";

/** Return the name under which a replay publishes a recorded view. */
export function recordedView(view: string): string {
  return RECORDED + view;
}

/** Return a replay's view in words. */
export function viewName(view: string): string {
  return view.startsWith(RECORDED)
    ? r("recorded_view", { view: viewText(view.slice(RECORDED.length)) })
    : viewText(view);
}
