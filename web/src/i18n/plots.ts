// Texts of the live plots, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  plots: ["Plots", "曲线"],
  plot: ["Plot {number}", "曲线 {number}"],
  pause: ["Pause", "暂停"],
  paused_at: ["Paused at {time}", "已暂停于 {time}"],
  add: ["Add plot", "添加曲线"],
  remove: ["Remove plot {number}", "移除曲线 {number}"],
  range: ["Time range of plot {number}", "曲线 {number} 的时间范围"],
  fields: ["Fields…", "字段…"],
  fields_of: ["Fields of plot {number}", "曲线 {number} 的字段"],
  whole: ["Whole range", "全部范围"],
  seconds: ["{count} s", "{count} 秒"],
  minutes: ["{count} min", "{count} 分钟"],
  hours: ["{count} h", "{count} 小时"],
  not_sent: ["not sent", "未发送"],
  not_sent_hint: ["No message of this robot has this field.", "此机器人的消息中没有此字段。"],
  no_fields: ["Choose the fields to plot.", "请选择要绘制的字段。"],
  no_plots: ["No plot. Add one to see values over time.", "没有曲线。添加曲线以查看数值随时间的变化。"],
  waiting: ["The plot begins with the first live value.", "收到第一个实时数值后开始绘图。"],
  no_recorder: ["no recorder answers at this site", "此站点没有录制服务应答"],
  not_recorded: ["not recorded", "未录制"],
  past_problem: ["The past cannot be read: {text}", "无法读取过去的数值：{text}"],
  past_reading: ["Reading the past from the recorder…", "正在从录制服务读取过去的数值…"],
  past_whole: ["Values from before this page was open come from the recorder.", "打开本页面之前的数值来自录制服务。"],
  past_none: ["The recorder has nothing of this range.", "录制服务没有此时间范围的数据。"],
  past_lacks: ["{time} of this range are not recorded.", "此范围中有 {time} 未录制。"],
  layout: ["Layout", "布局"],
  layout_open: ["Layout…", "布局…"],
  layout_hint: [
    "Panels, plots, cameras: in the address, so a link opens the same elsewhere.",
    "面板、曲线和相机都在网址中，链接在其他设备上打开的内容相同。",
  ],
  panel_video: ["Video", "视频"],
  panel_plots: ["Plots", "曲线"],
  copy_link: ["Copy link", "复制链接"],
  copied: ["Copied", "已复制"],
  layout_reset: ["Default layout", "默认布局"],
  close: ["Close", "关闭"],
  layout_wrong: [
    "The layout in the address cannot be used: {why}. The default layout is shown.",
    "网址中的布局无法使用：{why}。已显示默认布局。",
  ],
  saved_layouts: ["Layouts saved at {site}", "保存在 {site} 的布局"],
  choose_layout: ["Choose…", "请选择…"],
  no_layouts: ["none yet", "暂无"],
  layout_name: ["Name", "名称"],
  save_layout: ["Save layout", "保存布局"],
  replace_layout: ["Replace layout", "替换布局"],
  rename_layout: ["Rename", "重命名"],
  delete_layout: ["Delete…", "删除…"],
  delete_named: ["Delete “{name}”", "删除“{name}”"],
  keep_layout: ["Keep it", "保留"],
  saved_by: ["“{name}” was saved by {author}, {time}.", "“{name}”由 {author} 于 {time} 保存。"],
  saved: ["Saved: “{name}”.", "已保存：“{name}”。"],
  renamed: ["Renamed: “{old}” is “{name}” now.", "已重命名：“{old}”现为“{name}”。"],
  deleted: ["Deleted: “{name}”.", "已删除：“{name}”。"],
  not_changed: ["Not changed: {why}", "未更改：{why}"],
  sending: ["Asking the site's store…", "正在请求站点的存储服务…"],
  no_store: [
    "The site's store does not answer: layouts are in the address only.",
    "站点的存储服务无应答：布局仅在网址中。",
  ],
  monitor: ["A monitor opens layouts; operators save them.", "监视账户只能打开布局；操作员可以保存。"],
  name_needed: ["To save, enter your name in Control first.", "保存前请先在“控制”中输入姓名。"],
  layout_long: ["it is longer than {most} characters", "超过 {most} 个字符"],
  layout_key: ["“{text}” is not a part of a layout", "“{text}”不是布局的组成部分"],
  layout_plot: [
    "“{text}” is no plot: a time range (10, 60, 300, 600, 1800 or 3600 s), then at most 20 different fields",
    "“{text}”不是曲线：应为时间范围（10、60、300、600、1800 或 3600 秒）及最多 20 个不同字段",
  ],
  layout_plots: ["it has more than {most} plots", "曲线超过 {most} 个"],
  layout_video: [
    "“{text}” is no video: a view, then beside, inset or large",
    "“{text}”不是视频：应为视图及 beside、inset 或 large",
  ],
  layout_camera: [
    "“{text}” is no camera: a view, or a view with eye and target in metres",
    "“{text}”不是相机：应为视图，或视图加视点和目标（米）",
  ],
  layout_hide: ["“{text}” is no panel: video, plots", "“{text}”不是面板：video、plots"],
  zoom_hint: ["Drag over a plot to zoom.", "在曲线上拖动可缩放。"],
} as const;

// The usual parts of fields' names; others are shown as they are.
const PARTS: Partial<Record<string, readonly [string, string]>> = {
  position: ["position", "位置"],
  velocity: ["velocity", "速度"],
  acceleration: ["acceleration", "加速度"],
  effort: ["effort", "力矩"],
  tool: ["tool", "工具"],
  speed: ["speed", "速度"],
  roll: ["roll", "滚转"],
  pitch: ["pitch", "俯仰"],
  yaw: ["yaw", "偏航"],
  margin: ["margin", "限位余量"],
  clearance: ["clearance", "间距"],
  own_clearance: ["own clearance", "自身间距"],
  manipulability: ["manipulability", "可操作度"],
  singularity_margin: ["singularity margin", "奇异余量"],
};

/** Return a part of a field's name in words. */
export function partText(part: string): string {
  return inLanguage(PARTS[part] ?? [part.replaceAll("_", " "), part.replaceAll("_", " ")], {});
}

export type PlotsText = keyof typeof TEXTS;

/** Return a text of the plots in the page's language. */
export function p(name: PlotsText, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}

/** Return a time range in words. */
export function rangeText(seconds: number): string {
  if (seconds < 120) return p("seconds", { count: seconds });
  return seconds < 3600 ? p("minutes", { count: seconds / 60 }) : p("hours", { count: seconds / 3600 });
}
