// Texts that several pages share, in English and Chinese, with `{name}` placeholders.

import { signal } from "@preact/signals";
import { isolated } from "./foreign-text";
import { readStored } from "./stored";

const TEXTS = {
  fleet: ["Fleet", "机群"],
  wall: ["Wall", "视频墙"],
  recordings: ["Recordings", "录制"],
  replay: ["replay", "回放"],
  define: ["Define", "定义"],
  program: ["Program", "编程"],
  settings: ["Settings", "设置"],
  pages: ["Pages", "页面"],
  all_robots: ["All robots", "所有机器人"],
  filter: ["Filter robots", "筛选机器人"],
  no_robots: [
    "No robot is on the mesh yet. Tiles appear here as soon as a gateway joins.",
    "网络上还没有机器人。网关接入后将显示在这里。",
  ],
  services: ["Services", "服务"],
  no_robot: ["There is no robot {robot} at {site}.", "站点 {site} 没有机器人 {robot}。"],
  there_are: ["There are:", "现有："],
  none_at_all: ["No robot is on the mesh now.", "网络上目前没有机器人。"],
  no_services: ["no service seen", "未发现服务"],
  site: ["Site", "站点"],
  no_picture: ["No picture", "无图像"],

  connecting: ["Connecting to the console…", "正在连接控制台…"],
  reconnecting: [
    "No connection to the console since {time}. Nothing on this page is live; trying again.",
    "自 {time} 起与控制台断开，页面数据均非实时，正在重连。",
  ],
  page_not_loaded: [
    "This page could not be loaded. The console may have been renewed, or is gone.",
    "此页面无法加载：控制台可能已更新或已离线。",
  ],
  load_again: ["Load again", "重新加载"],
  router_lost: [
    "The console has lost the mesh's router. Nothing on this page is live; trying again.",
    "控制台与网络路由器断开，页面数据均非实时，正在重连。",
  ],
  insecure: [
    "Insecure: this console is open to the network, without sign-in or encryption.",
    "不安全：此控制台对网络开放，无登录、无加密。",
  ],
  language: ["中文", "English"],
  language_hint: ["Switch to Chinese", "切换为英文"],
  theme_light: ["Light", "浅色"],
  theme_dark: ["Dark", "深色"],
  theme_hint: ["Colours: {theme}", "配色：{theme}"],

  stop: ["Stop request", "停止请求"],
  stop_hint: [
    "Asks {robot} to stop. Works without control. Not an emergency stop.",
    "请求 {robot} 停止。无需控制权。这不是急停。",
  ],
  stop_all: ["Stop request: all", "停止请求：全部"],
  stop_all_hint: [
    "Asks all robots of the fleet to stop, at every site, also those that this page does not show. Works without control. Not an emergency stop.",
    "请求全部站点的所有机器人停止，包括本页未显示的。无需控制权。这不是急停。",
  ],
  stop_space: ["Space", "空格键"],
  stop_done: ["Stop sent to {robot} (stop {id}).", "已向 {robot} 发送停止（编号 {id}）。"],
  stop_latched: [
    "Stop latched for {robot}, but it did not reach the controller: {text}",
    "{robot} 已锁定停止，但未送达控制器：{text}",
  ],
  stop_failed: ["Stop request to {robot} failed: {text}", "{robot} 的停止请求失败：{text}"],
  stop_unreachable: ["Stop cannot be sent: use the emergency stop", "停止无法发送：请使用急停"],
  stop_again: ["Send again", "重新发送"],
  no_connection: ["No connection: nothing can be sent.", "无连接：无法发送。"],
  stop_sending: ["Asking {robot} to stop…", "正在请求 {robot} 停止…"],
  dismiss: ["Dismiss", "关闭"],

  state_no_link: ["No link", "无连接"],
  state_silent: ["Silent", "无数据"],
  state_stopped: ["Stopped", "已停止"],
  state_stopping: ["Stopping", "正在停止"],
  state_stop_unsent: ["Stop not sent", "停止未送达"],
  state_stop_sent: ["Stop sent", "停止已发送"],
  state_disobeys: ["Does not stop", "未停止"],
  state_fault: ["Fault", "故障"],
  state_idle: ["Idle", "空闲"],
  state_moving: ["Moving", "运动中"],
  state_homing: ["Homing", "回零中"],
  state_holding: ["Holding", "保持"],
  state_replay_paused: ["Paused", "已暂停"],
  state_replay_ended: ["Ended", "已结束"],
  state_running: ["Running", "运行中"],
  running_waits: ["waits {seconds}\u202fs", "等待 {seconds}\u202fs"],
  running_moves: ["moving", "运动中"],
  running_homes: ["homing", "回零中"],
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
  check_off: ["motions are not checked", "运动不检查"],
  check_warn: ["motions are checked: warned", "运动检查：警告"],
  check_require: ["motions are checked: required", "运动检查：必须通过"],
  check_cannot: ["Motions are not checked now: {text}", "目前无法检查运动：{text}"],
  check_starting: ["the check is still getting ready.", "检查正在准备中。"],
  check_refuses: ["Motions are refused, for none can be checked now: {text}", "目前无法检查运动，一律拒绝：{text}"],
  program_runs: [
    "{name}: step {step} of {steps}, {at}; {operator}; {time}",
    "{name}：第 {step}/{steps} 步，{at}；{operator}；{time}",
  ],
  program_at: ["line {line}: {statement}", "第 {line} 行：{statement}"],
  program_left: ["{gone}, {left} left", "{gone}，剩余 {left}"],
  program_done: ["{name}: done; {operator}", "{name}：已完成；{operator}"],
  program_ended: ["{name}: ended at {at}; {operator}: {text}", "{name}：中止于{at}；{operator}：{text}"],
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
  scene_hint: [
    "Drag to turn, scroll to zoom, right drag to move; arrow keys turn.",
    "拖动旋转，滚轮缩放，右键平移；方向键旋转。",
  ],
  no_webgl: [
    "This browser has no WebGL: the 3-D view cannot be drawn. The video works.",
    "此浏览器不支持 WebGL，无法显示三维视图，可使用视频。",
  ],
  camera: ["Video", "视频"],
  view_close: ["Close-up", "特写"],
  view_far: ["Far", "远程"],
  far_link: ["Slow link", "慢速链路"],
  far_slow: ["10 Hz", "10 Hz"],
  far_all: ["All", "全部"],
  far_hint: [
    "This robot is at another site: joints come ten times a second, video small. “All” takes everything, if the link between the sites lets it through.",
    "该机器人在其他站点：关节每秒更新十次，视频为小图。选“全部”则接收所有数据（若站点间链路允许）。",
  ],
  clock_off: [
    "The clock of {host} is off by {seconds} s: times told by {site} may be wrong.",
    "{host} 的时钟偏差 {seconds} s：{site} 提供的时间可能不准。",
  ],
  view_own: ["As in 3-D", "同三维视图"],
  view_off: ["Off", "关闭"],
  video_beside: ["Beside", "并排"],
  video_inset: ["Inset", "画中画"],
  video_large: ["Large", "大图"],
  video_is_off: ["The video is off.", "视频已关闭。"],
  video_place: ["Where the video stands", "视频位置"],
  reduced: ["reduced: slow here", "已降低：此处较慢"],
  reduced_hint: [
    "This browser, or the line to it, does not take the whole video: it is given a smaller one, and tried with more later.",
    "此浏览器或其链路无法承载完整视频：已改用较小的视频，稍后再尝试恢复。",
  ],
  save_still: ["Save still", "保存图像"],
  record_video: ["Save MP4", "保存 MP4"],
  recording_video: ["End MP4, {time}", "结束 MP4，{time}"],
  record_failed: ["The video was not saved: {text}", "视频未保存：{text}"],
  full_screen: ["Full screen", "全屏"],
  camera_waiting: [
    "Waiting for pictures of view “{view}”. Is the renderer running?",
    "等待视图“{view}”的图像，渲染服务是否运行？",
  ],
  camera_still: [
    "Still pictures, one after another: this browser decodes video only over https or on localhost.",
    "逐帧静态图像：此浏览器仅在 https 或 localhost 下解码视频。",
  ],
  camera_failed: ["The video cannot be decoded here: {text}", "无法解码视频：{text}"],

  joints: ["Joints", "关节"],
  joint: ["Joint", "关节"],
  target_unsent: ["Target {joint}: {value}, not sent yet", "{joint} 目标：{value}，尚未发送"],
  type_target: [
    "Press to type a target: Enter sends it, Escape takes it back.",
    "点按可输入目标值：回车发送，Esc 取消。",
  ],
  joint_type: ["Type a target of {joint}", "输入 {joint} 目标"],
  no_number: ["Not sent: “{text}” is no number.", "未发送：“{text}”不是数字。"],
  position: ["Position", "位置"],
  joint_target: ["Target of {joint}", "{joint} 目标"],
  joint_hint: [
    "Drag a handle and let go, step with − +, or press a value.",
    "拖动手柄后松手，用 − + 逐步移动，或点按数值输入。",
  ],
  joint_keys: [
    "Keys: arrows set, Shift finer, Page up and down coarser, Enter sends, Escape cancels.",
    "键盘：方向键设定，Shift 微调，翻页键粗调，回车发送，Esc 取消。",
  ],
  step: ["Step", "步长"],
  step_plus: ["{joint} +{step}", "{joint} +{step}"],
  step_minus: ["{joint} −{step}", "{joint} −{step}"],
  steps_wait: ["{count} more to go", "还有 {count} 步"],
  steps_many: [
    "Not sent: {count} steps wait already. Wait until the arm has done them.",
    "未发送：已有 {count} 步在等待，请等机械臂完成。",
  ],
  steps_dropped: ["Steps that waited and are not sent: {count}.", "等待中未发送的步数：{count}。"],
  step_not_there: ["{joint} did not arrive where its step leads.", "{joint} 未到达该步的目标。"],
  joint_hint_take: ["Take control to move the joints.", "取得控制权后可移动关节。"],
  enter_sends: ["Not sent yet: Enter sends {value}, Escape takes it back.", "尚未发送：回车发送 {value}，Esc 取消。"],

  control: ["Control", "控制"],
  operator: ["Your name", "操作员姓名"],
  operator_hint: ["letters, digits, . _ -", "字母、数字、. _ -"],
  operator_needed: [
    "Enter your name first: it is shown to everybody while you are in control.",
    "请先输入姓名：控制期间所有人可见。",
  ],
  operator_wrong: [
    "“{name}” cannot be used: letters, digits, “_”, “.” and “-”, beginning with a letter or digit.",
    "“{name}”不可用：仅限字母、数字、“_”“.”“-”，且以字母或数字开头。",
  ],
  take: ["Take control", "取得控制"],
  release: ["Release", "释放控制"],
  ask: ["Ask for control", "请求控制权"],
  ask_from: ["Ask {name} for control", "向 {name} 请求控制权"],
  ask_says: [
    "Everybody sees for half a minute that you ask; {name} can hand control over to you.",
    "半分钟内所有人可见您的请求，{name} 可将控制权移交给您。",
  ],
  asked: ["{name} is told that you ask for control.", "已通知 {name}：您请求控制权。"],
  not_asked: ["Not asked: {text}", "未请求：{text}"],
  asks: ["{name} asks for control", "{name} 请求控制权"],
  you_ask: ["You asked {holder} for control {age} ago; no answer yet", "您于 {age} 前向 {holder} 请求控制权，尚无答复"],
  with_reason: ["{text}: “{reason}”", "{text}：“{reason}”"],
  more_ask: ["and {count} more", "另有 {count} 人"],
  hand_over: ["Hand over to {name}", "移交给 {name}"],
  not_now: ["Not now", "暂不"],
  offers: ["{holder} offers control to {name}.", "{holder} 提出将控制权移交给 {name}。"],
  offers_you: ["{holder} offers you control.", "{holder} 提出将控制权移交给您。"],
  offer_open: [
    "Offered to {name}, no answer yet: you are in control until {name} accepts.",
    "已向 {name} 提出移交，尚无答复：{name} 接受之前仍由您控制。",
  ],
  offered: ["Control offered to {name}.", "已向 {name} 提出移交控制权。"],
  handed_over: ["{name} has accepted control.", "{name} 已接受控制权。"],
  not_offered: ["Not done: {text}", "未完成：{text}"],
  withdraw: ["Withdraw", "撤回"],
  withdrawn: ["Offer withdrawn.", "已撤回移交。"],
  accept: ["Accept", "接受"],
  take_over: ["Take over…", "接管…"],
  take_from: ["Take over from {name}", "从 {name} 接管"],
  take_says: [
    "{name} loses control at once and is told your reason. If a motion runs, it is stopped.",
    "{name} 将立即失去控制权并看到您的理由。若有运动，将被停止。",
  ],
  take_says_moving: [
    "{name}'s motion is running: it will be stopped. {name} loses control at once and is told your reason.",
    "{name} 的运动正在进行，将被停止。{name} 将立即失去控制权并看到您的理由。",
  ],
  reason_required: ["Reason (everybody sees it)", "理由（所有人可见）"],
  reason_optional: ["Reason, if you like (everybody sees it)", "理由（可选，所有人可见）"],
  cancel: ["Cancel", "取消"],
  in_control: ["You are in control", "您正在控制"],
  nobody: ["Nobody is in control", "无人控制"],
  somebody: ["{name} is in control", "{name} 正在控制"],
  elsewhere: ["You ({name}) are in control in another window", "您（{name}）正在另一窗口中控制"],
  holder_unknown: ["Who is in control is not known", "控制者未知"],
  since: ["since {time}", "自 {time}"],
  taking: ["Asking for control…", "正在请求控制…"],
  taken: ["Motion stops when you leave this page.", "离开本页时运动将停止。"],
  just_moved: [
    "Not sent: the page had moved this button half a second before. Press it again.",
    "未发送：按下前半秒内页面布局移动了此按钮。请再按一次。",
  ],
  not_taken: ["Control not given: {text}", "未取得控制：{text}"],
  released: ["Control released.", "已释放控制。"],
  released_hidden: ["Control released because this page was hidden.", "页面被隐藏，已释放控制。"],
  control_lost: ["Control lost: {text}", "失去控制：{text}"],
  lost_no_answer: [
    "the gateway has not answered for {seconds} s. If it runs, it has ended your control and stopped your motion; if it does not, the arm may still be moving.",
    "网关已 {seconds} 秒无应答。若网关在运行，它已收回控制权并停止您的运动；否则机械臂可能仍在运动。",
  ],
  lost_connection: [
    "this page lost its connection to the console. The gateway stops your motion if one runs.",
    "本页与控制台断开。若有运动，网关会将其停止。",
  ],
  lost_slow: [
    "this browser was too slow to renew it in time. Close other tabs and programs here, or use a faster computer, before you take control again.",
    "此浏览器过慢，未能及时续约。请关闭其他标签页和程序，或换用更快的电脑，再取得控制权。",
  ],
  lost_unknown: [
    "the gateway no longer knows of it; it may have been started again.",
    "网关已无此记录，可能已重新启动。",
  ],
  take_first: ["Take control to command this robot.", "取得控制权后可发送命令。"],
  read_only_text: [
    "Read-only: no proven stop for this controller, so nothing is ever sent to it.",
    "只读：此控制器没有经验证的停止命令，不会发送任何命令。",
  ],
  home: ["Home", "回零"],
  hold: ["Hold", "保持"],
  resume: ["Resume", "继续"],
  trace_on: ["Trace on", "开始记录"],
  trace_off: ["Trace off", "停止记录"],
  speed: ["Speed", "速度"],
  speed_unset: ["not known", "未知"],
  speed_unset_hint: ["Nobody has set it since the link came up.", "连接建立后尚未设定。"],
  speed_hint: ["Drag and let go, or arrow keys and Enter.", "拖动后松手，或方向键后回车。"],
  speed_low: ["Low: the arm moves slowly.", "速度低：机械臂运动缓慢。"],
  let_go_sends: ["Not sent yet: let go to send {value}.", "尚未发送：松手发送 {value}。"],
  reset: ["Reset stop {id}", "复位停止 {id}"],
  stopped_by: ["Stopped by {by} at {time}", "{by} 于 {time} 停止"],
  stop_reason: ["Reason: “{reason}”.", "原因：“{reason}”。"],
  stop_unsent_by: ["Stop asked for by {by} at {time}: NOT SENT", "{by} 于 {time} 请求停止：未送达"],
  stop_moving_by: ["Stop sent by {by} at {time}: the arm still moves", "{by} 于 {time} 发送停止：机械臂仍在运动"],
  stop_sent_by: ["Stop sent by {by} at {time}", "{by} 于 {time} 发送停止"],
  nothing_comes: ["Nothing comes from it: its gateway or the line to it is gone.", "没有数据：网关离线或线路中断。"],
  disobeys: [
    "It moves although it was told to stop: use the emergency stop at the robot.",
    "已要求停止，但仍在运动：请使用机器人旁的急停。",
  ],
  disobeyed: ["At {time} it moved on although it was told to stop.", "{time} 已要求停止，但仍继续运动。"],
  critical_at: ["At {time}: {text}", "{time}：{text}"],
  stopped_unsent: ["The stop did not reach the controller.", "停止未送达控制器。"],
  reset_needs: ["No motion until it is reset.", "复位前拒绝一切运动。"],
  reset_moving: ["It can be reset when the arm rests.", "机械臂静止后方可复位。"],
  reset_own: ["Reset", "复位"],
  own_stop: ["The controller has stopped by itself", "控制器自行停止"],
  own_fault: ["The controller has a fault", "控制器故障"],
  own_reset_needs: ["See to it, then reset: no motion until then.", "请先排除原因，再复位；复位前拒绝一切运动。"],
  frozen_old: ["No new motion: {what} is {age} old.", "无法开始运动：{what}是 {age} 前的。"],
  frozen_not_live: ["No new motion: {what} is not live.", "无法开始运动：{what}不是实时的。"],
  frozen_state: ["the robot's state", "机器人状态"],
  frozen_drawing: ["the 3-D picture", "三维画面"],
  frozen_video: ["the video “{view}”, which can be turned off,", "视频“{view}”（可关闭）"],
  close: ["Close", "关闭"],
  seen_view: ["screen: {view}, {age} old", "屏幕：{view}，{age} 前"],
  seen_state: ["screen: state {age} old", "屏幕：状态 {age} 前"],
  seen_age_unknown: ["unknown time", "未知时间"],
  seen_hint: [
    "What the sender's page showed then, as that page reported it",
    "发送者的页面当时显示的内容，由该页面报告",
  ],
  seen_title: ["What the page showed", "页面当时显示的内容"],
  seen_searching: ["Looking for this picture in the recordings…", "正在记录中查找该画面…"],
  seen_no_picture: ["The page showed no picture of known number.", "页面当时没有可识别编号的画面。"],
  seen_own_drawing: [
    "The page drew this picture itself, so no recording has it. A recording's player draws the same moment again.",
    "该画面由页面自行绘制，记录中没有。回放可重新绘制同一时刻。",
  ],
  seen_not_recorded: ["No recording of this site has this picture.", "本站点没有包含该画面的记录。"],
  seen_failed: ["The picture could not be read: {text}", "无法读取该画面：{text}"],
  seen_from: ["From the recording {file}.", "来自记录 {file}。"],
  seen_from_before: [
    "From the recording {file}: the picture before it, because this one was not recorded.",
    "来自记录 {file}：该画面未被记录，显示的是前一幅。",
  ],
  seen_by_page: ["Reported by the page; nothing verifies it.", "由页面报告，未经核实。"],
  seen_number: ["Picture", "画面编号"],
  seen_time: ["Published", "发布时间"],
  seen_picture_age: ["Age of the picture", "画面时延"],
  seen_state_age: ["Age of the state", "状态时延"],
  no_motion_link: ["No motion: there is no link to the controller.", "无法运动：与控制器无连接。"],
  no_motion_local: [
    "No motion: the controller is in local mode. Switch it to remote there.",
    "无法运动：控制器处于本地模式，请在控制器上切换为远程。",
  ],
  no_motion_reason: ["No motion: {text}.", "无法运动：{text}。"],
  no_motion_held: ["On hold: press Resume first.", "已保持：请先继续。"],
  no_motion_program: [
    "A program runs: wait for its end, or hold or stop it.",
    "程序正在运行：请等其结束，或保持、停止。",
  ],
  no_motion_unhomed: ["Not homed: press Home first.", "未回零：请先回零。"],
  reset_take: ["Whoever is in control can reset it: take control first.", "仅控制者可复位：请先取得控制权。"],
  sent: ["Sent: {what}", "已发送：{what}"],
  warning_of_check: ["Warning: {text}", "注意：{text}"],
  motion_done: ["Done: {what}", "已完成：{what}"],
  motion_ended: ["Ended before its target: {what}", "未到目标即结束：{what}"],
  sending: ["Sending {what}…", "正在发送 {what}…"],
  sentence: ["{text}.", "{text}。"],
  list_separator: ["; ", "；"],
  not_sent: ["Not sent: {text}", "未发送：{text}"],
  what_move: ["move to target", "移动到目标"],
  what_speed: ["speed {value} %", "速度 {value} %"],

  tool: ["Tool", "工具"],
  margin: ["Limit", "限位"],
  clearance: ["Clearance", "间距"],
  own_clearance: ["Own links", "自身连杆"],
  singularity: ["To singularity", "距奇异"],
  touching: ["they touch", "接触"],
  floor: ["the floor", "地面"],
  nothing_around: ["nothing around", "周围无物体"],
  not_counted: ["Not counted, as nobody knows where they are now: {robots}", "未计入（当前位置未知）：{robots}"],
  manipulability: ["Manipulability", "可操作度"],
  tool_speed: ["Speed", "速度"],

  events: ["Events", "事件"],
  requests: ["Requests", "请求"],
  link: ["Link", "连接"],
  link_rate: ["Units", "数据单元"],
  link_jitter: ["Jitter", "抖动"],
  link_round_trip: ["Round trip", "往返时间"],
  link_answer: ["Answer to a command", "命令应答"],
  link_units: ["Units received", "已接收"],
  link_lost: ["Lost", "丢失"],
  link_malformed: ["Malformed", "格式错误"],
  link_unknown: ["Unknown records", "未知记录"],
  link_refusals: ["Refused by controller", "控制器拒绝"],
  link_connections: ["Connections", "连接次数"],
  link_skipped: ["Skipped in floods", "过载跳过"],
  flooding: ["flooded: more units come than are taken; the newest are shown", "数据过载：仅显示最新数据"],
  legacy_some: ["old clients: {count}", "旧客户端：{count}"],
  legacy_attached: ["Old clients attached", "旧客户端"],
  legacy_refused: ["Their units refused", "拒绝其数据单元"],
  legacy_turned_away: ["Turned away", "拒绝接入"],
  legacy_closed: ["Closed by gateway", "网关断开"],
  audit_entries: ["Audit entries", "审计条目"],
  audit_head: ["Audit head", "审计链头"],
  event_stop: ["{by} asked for a stop; it was sent to the controller.", "{by} 请求停止，已发送给控制器。"],
  event_stop_unsent: [
    "{by} asked for a stop; it did NOT reach the controller, and is sent as soon as it can be.",
    "{by} 请求停止，未送达控制器，可送达时立即发送。",
  ],
  event_stop_sent: ["The stop was sent when the link came back.", "连接恢复后已发送停止。"],
  event_stop_reset: ["The stop was reset.", "停止已复位。"],
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

const STORAGE_KEY = "robomesh.language";

function initialLanguage(): Language {
  const stored = readStored(STORAGE_KEY);
  if (stored === "en" || stored === "zh") return stored;
  return navigator.language.toLowerCase().startsWith("zh") ? "zh" : "en";
}

export const language = signal<Language>(initialLanguage());

export function switchLanguage(): void {
  language.value = language.value === "en" ? "zh" : "en";
  localStorage.setItem(STORAGE_KEY, language.value);
  document.documentElement.lang = language.value === "zh" ? "zh-Hans" : "en";
}

/** Return a text in the page's language. */
export function t(name: TextName, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}

/** Return one of a pair of texts, English and Chinese, with its placeholders replaced. */
export function inLanguage(pair: readonly [string, string], values: Record<string, string | number>): string {
  return pair[language.value === "zh" ? 1 : 0].replace(/\{(\w+)\}/g, (whole, key: string) => {
    const value = values[key];
    return value === undefined ? whole : isolated(String(value));
  });
}

/** Return a text by a computed name, or a substitute. */
export function textOr(name: string, otherwise: string): string {
  return name in TEXTS ? t(name as TextName) : otherwise;
}

/** Return a view's name in words. */
export function viewText(name: string): string {
  return textOr(`view_${name}`, name);
}
