// Every word of the page, in English and Chinese. `{name}` is filled in.

import { signal } from "@preact/signals";

const TEXTS = {
  fleet: ["Fleet", "机群"],
  all_robots: ["All robots", "所有机器人"],
  filter: ["Filter robots", "筛选机器人"],
  no_robots: ["No robot is on the mesh yet. Tiles appear here as soon as a gateway joins.", "网络上还没有机器人。网关接入后将显示在这里。"],
  no_match: ["No robot matches “{text}”.", "没有与“{text}”匹配的机器人。"],
  robots_count: ["{count} robots", "{count} 台机器人"],
  robot_count: ["1 robot", "1 台机器人"],
  services: ["Services", "服务"],
  no_services: ["no service seen", "未发现服务"],
  site: ["Site", "站点"],
  no_picture: ["No picture", "无图像"],

  connecting: ["Connecting to the console…", "正在连接控制台…"],
  reconnecting: ["No connection to the console since {time}. Nothing on this page is live; trying again.", "自 {time} 起与控制台断开，页面数据均非实时，正在重连。"],
  router_lost: ["The console has lost the mesh's router. Nothing on this page is live; trying again.", "控制台与网络路由器断开，页面数据均非实时，正在重连。"],
  insecure: ["Insecure: this console is open to the network, without sign-in or encryption.", "不安全：此控制台对网络开放，无登录、无加密。"],
  language: ["中文", "English"],
  language_hint: ["Switch to Chinese", "切换为英文"],
  theme_light: ["Light", "浅色"],
  theme_dark: ["Dark", "深色"],
  theme_hint: ["Colours: {theme}", "配色：{theme}"],

  stop: ["Stop request", "停止请求"],
  stop_hint: ["Asks {robot} to stop. Works without control. Not an emergency stop.", "请求 {robot} 停止。无需控制权。这不是急停。"],
  stop_all: ["Stop request: all", "停止请求：全部"],
  stop_all_hint: ["Asks every robot on this page to stop. Works without control. Not an emergency stop.", "请求本页所有机器人停止。无需控制权。这不是急停。"],
  stop_space: ["Space", "空格键"],
  stop_done: ["Stop sent to {robot} (stop {id}).", "已向 {robot} 发送停止（编号 {id}）。"],
  stop_latched: ["Stop latched for {robot}, but it did not reach the controller: {text}", "{robot} 已锁定停止，但未送达控制器：{text}"],
  stop_failed: ["Stop request to {robot} failed: {text}", "{robot} 的停止请求失败：{text}"],
  stop_sending: ["Asking {robot} to stop…", "正在请求 {robot} 停止…"],
  dismiss: ["Dismiss", "关闭"],

  state_no_link: ["No link", "无连接"],
  state_silent: ["Silent", "无数据"],
  state_stopped: ["Stopped", "已停止"],
  state_stopping: ["Stopping", "正在停止"],
  state_stop_unsent: ["Stop not sent", "停止未送达"],
  state_fault: ["Fault", "故障"],
  state_idle: ["Idle", "空闲"],
  state_moving: ["Moving", "运动中"],
  state_homing: ["Homing", "回零中"],
  state_holding: ["Holding", "保持"],
  state_unknown: ["Unknown", "未知"],
  state_stale: ["Stale", "数据过期"],
  state_gone: ["Gone", "离线"],
  mode_local: ["local mode", "本地模式"],
  mode_remote: ["remote", "远程"],
  mode_unknown: ["mode unknown", "模式未知"],
  homed: ["homed", "已回零"],
  not_homed: ["not homed", "未回零"],
  homed_unknown: ["homed: unknown", "回零：未知"],
  read_only: ["read-only", "只读"],
  simulated: ["simulated", "仿真"],
  activity: ["activity", "动作"],

  fresh: ["live", "实时"],
  roll: ["roll", "滚转"],
  pitch: ["pitch", "俯仰"],
  yaw: ["yaw", "偏航"],
  stale_for: ["stale {age}", "过期 {age}"],
  stale_unknown: ["stale, age unknown", "过期，时间未知"],
  no_link_since: ["no link since {time}", "自 {time} 起无连接"],
  no_data: ["no data yet", "尚无数据"],
  waiting_description: ["Waiting for the robot's description…", "等待机器人描述…"],
  loading_model: ["Loading the model…", "正在加载模型…"],
  model_failed: ["The model of {link} could not be loaded: {text}", "{link} 的模型无法加载：{text}"],

  view: ["View", "视图"],
  view_free: ["Free", "自由"],
  view_top: ["Top", "俯视"],
  view_front: ["Front", "前视"],
  view_left: ["Left", "左视"],
  show_trail: ["Trail", "轨迹"],
  show_frames: ["Frames", "坐标系"],
  scene: ["3-D view", "三维视图"],
  scene_hint: ["Drag to turn, scroll to zoom, right drag to move; arrow keys turn.", "拖动旋转，滚轮缩放，右键平移；方向键旋转。"],
  no_webgl: ["This browser has no WebGL: the 3-D view cannot be drawn. The video works.", "此浏览器不支持 WebGL，无法显示三维视图，可使用视频。"],
  camera: ["Video", "视频"],
  enlarge: ["Enlarge", "放大"],
  camera_waiting: ["Waiting for pictures of view “{view}”. Is the renderer running?", "等待视图“{view}”的图像，渲染服务是否运行？"],
  camera_still: ["Still pictures: this browser decodes no video here.", "静态图像：此浏览器无法解码视频。"],
  camera_failed: ["The video cannot be decoded here: {text}", "无法解码视频：{text}"],

  joints: ["Joints", "关节"],
  joint: ["Joint", "关节"],
  target: ["Target", "目标"],
  position: ["Position", "位置"],
  joint_target: ["Target of {joint}", "{joint} 目标"],
  joint_hint: ["Drag a blue handle: the move is sent when you let go.", "拖动蓝色手柄，松手后发送移动。"],
  joint_keys: ["Keys: arrows set, Shift finer, Page up and down coarser, Enter sends, Escape cancels.", "键盘：方向键设定，Shift 微调，翻页键粗调，回车发送，Esc 取消。"],
  joint_hint_take: ["Take control to move the joints.", "取得控制权后可移动关节。"],
  enter_sends: ["Enter sends {value}", "回车发送 {value}"],

  control: ["Control", "控制"],
  operator: ["Your name", "操作员姓名"],
  operator_hint: ["letters, digits, . _ -", "字母、数字、. _ -"],
  operator_needed: ["Enter your name first: it is shown to everybody while you are in control.", "请先输入姓名：控制期间所有人可见。"],
  operator_wrong: ["“{name}” cannot be used: letters, digits, “_”, “.” and “-”, beginning with a letter or digit.", "“{name}”不可用：仅限字母、数字、“_”“.”“-”，且以字母或数字开头。"],
  take: ["Take control", "取得控制"],
  release: ["Release", "释放控制"],
  in_control: ["You are in control", "您正在控制"],
  nobody: ["Nobody is in control", "无人控制"],
  somebody: ["{name} is in control", "{name} 正在控制"],
  holder_unknown: ["Who is in control is not known", "控制者未知"],
  since: ["since {time}", "自 {time}"],
  taking: ["Asking for control…", "正在请求控制…"],
  taken: ["You are in control. Motion stops when you leave this page.", "您已取得控制权。离开本页时运动将停止。"],
  not_taken: ["Control not given: {text}", "未取得控制：{text}"],
  released: ["Control released.", "已释放控制。"],
  released_hidden: ["Control released because this page was hidden.", "页面被隐藏，已释放控制。"],
  control_lost: ["Control lost: {text}", "失去控制：{text}"],
  lease_ended: ["the lease was not renewed in time", "租约未及时续期"],
  take_first: ["Take control to command this robot.", "取得控制权后可发送命令。"],
  read_only_text: ["Read-only: no proven stop for this controller, so nothing is ever sent to it.", "只读：此控制器没有经验证的停止命令，不会发送任何命令。"],
  home: ["Home", "回零"],
  hold: ["Hold", "保持"],
  resume: ["Resume", "继续"],
  trace_on: ["Trace on", "开始记录"],
  trace_off: ["Trace off", "停止记录"],
  speed: ["Speed", "速度"],
  speed_unset: ["not set here", "此处未设定"],
  speed_hint: ["Sent when you let go", "松手后发送"],
  reset: ["Reset stop {id}", "复位停止 {id}"],
  stopped_by: ["Stopped by {by} at {time}", "{by} 于 {time} 停止"],
  stop_unsent_by: ["Stop asked for by {by} at {time}: NOT SENT", "{by} 于 {time} 请求停止：未送达"],
  stopped_unsent: ["The stop did not reach the controller.", "停止未送达控制器。"],
  reset_needs: ["No motion until it is reset.", "复位前拒绝一切运动。"],
  reset_take: ["Whoever is in control can reset it: take control first.", "仅控制者可复位：请先取得控制权。"],
  sent: ["Sent: {what}", "已发送：{what}"],
  sending: ["Sending {what}…", "正在发送 {what}…"],
  not_sent: ["Not sent: {text}", "未发送：{text}"],
  what_move: ["move to target", "移动到目标"],
  what_speed: ["speed {value} %", "速度 {value} %"],

  tool: ["Tool", "工具"],
  margins: ["To limit of {joint}", "距 {joint} 限位"],
  margin: ["To nearest limit", "距最近限位"],
  beyond: ["beyond", "超限"],
  manipulability: ["Manipulability", "可操作度"],
  tool_speed: ["Speed", "速度"],

  events: ["Events", "事件"],
  requests: ["Requests", "请求"],
  no_events: ["Nothing has happened yet.", "暂无事件。"],
  severity_debug: ["debug", "调试"],
  severity_info: ["info", "信息"],
  severity_warning: ["warning", "警告"],
  severity_error: ["error", "错误"],
  severity_critical: ["critical", "严重"],
  outcome_accepted: ["accepted", "已接受"],
  outcome_refused: ["refused", "已拒绝"],
  outcome_failed: ["failed", "失败"],
  repeated: ["{count} more like it", "另有 {count} 条相同"],

  history: ["Last 60 s", "最近 60 秒"],
  pause: ["Pause", "暂停"],
  live: ["Live", "实时"],
  plot_empty: ["The plot begins with the first live state.", "收到第一个实时状态后开始绘图。"],
  seconds_ago: ["seconds ago", "秒前"],
  nominal: ["Nominal", "标称值"],

  timed_out: ["no answer in {seconds} s; it may still have been done", "{seconds} 秒内无应答，命令可能已执行"],
  not_connected: ["this page has no connection to the console", "页面未连接控制台"],
} as const;

export type TextName = keyof typeof TEXTS;
export type Language = "en" | "zh";

const KEPT = "robomesh.language";

function initialLanguage(): Language {
  const kept = localStorage.getItem(KEPT);
  if (kept === "en" || kept === "zh") return kept;
  return navigator.language.toLowerCase().startsWith("zh") ? "zh" : "en";
}

export const language = signal<Language>(initialLanguage());

export function switchLanguage(): void {
  language.value = language.value === "en" ? "zh" : "en";
  localStorage.setItem(KEPT, language.value);
  document.documentElement.lang = language.value === "zh" ? "zh-Hans" : "en";
}

/** A text in the page's language. */
export function t(name: TextName, values: Record<string, string | number> = {}): string {
  const text = TEXTS[name][language.value === "zh" ? 1 : 0];
  return text.replace(/\{(\w+)\}/g, (whole, key: string) => String(values[key] ?? whole));
}

/** A text by a name made at run time, or what stands in for it. */
export function textOr(name: string, otherwise: string): string {
  return name in TEXTS ? t(name as TextName) : otherwise;
}
