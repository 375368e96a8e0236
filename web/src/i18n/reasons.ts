// Why a request is refused, control ended or a motion is not checked: reasons of the mesh in the page's language.

import type { Reason } from "../gen/robomesh_pb";
import { inLanguage, t } from "./texts";

/** Sentences by code, English and Chinese, with the parameters of robomesh/reason_codes.py; {cause}: the causes. */
const SENTENCES: ReadonlyMap<string, readonly [english: string, chinese: string]> = new Map([
  [
    "request.busy",
    [
      "too many requests are waiting for this service: send fewer requests and try again",
      "等待的请求过多：请稍后再试，并降低频率",
    ],
  ],
  ["request.turned_away", ["refused unread: too many requests were waiting", "未读取即拒绝：等待的请求过多"]],
  [
    "request.failed",
    ["{request} failed with an internal error: see the log of its service", "{request} 在其服务处失败：详见其日志"],
  ],
  ["request.invalid", ["{detail}", "{detail}"]],
  ["other", ["{detail}", "{detail}"]],
  ["several", ["{cause}", "{cause}"]],
  [
    "request.wildcard",
    ["{key} has a wildcard: ask one {request} by its whole key", "{key} 含通配符：请以完整键请求一个 {request}"],
  ],
  ["request.no_right", ["{detail}", "{detail}"]],
  [
    "quota.rate",
    [
      "{asker} has used up its quota: {quota} = {most} for each name ([quotas] in the site file): try again in {seconds} s",
      "{asker} 已用完本分钟的配额：每个名称 {quota} = {most}（站点文件的 [quotas]）：请在 {seconds} 秒后再试",
    ],
  ],
  [
    "quota.at_once",
    [
      "{asker} already has {count} requests in progress: quota {quota} = {most} for each name ([quotas] in the site file): try again in {seconds} s",
      "{asker} 已有 {count} 个请求进行中：每个名称 {quota} = {most}（站点文件的 [quotas]）：请在 {seconds} 秒后再试",
    ],
  ],
  [
    "quota.views",
    [
      "no capacity: {asker} already has {count} views: quota views = {most} for each name, together {megapixels} million pixels a second ([quotas] in the site file): close a view and try again after {seconds} s, or request a smaller or slower one",
      "没有余量：{asker} 已有 {count} 个视图：每个名称 quota views = {most}，合计每秒 {megapixels} 百万像素（站点文件的 [quotas]）：请在其中之一关闭 {seconds} 秒后再试，或请求更小或更慢的视图",
    ],
  ],
  ["request.not_json", ["not JSON: {detail}", "不是 JSON：{detail}"]],
  [
    "request.not_json_object",
    ["the request is not a JSON object: send an object with the request's fields", "应为 JSON 对象"],
  ],
  [
    "request.unknown_field",
    ["{request} has no field '{field}'; it takes {fields}", "{request} 没有字段“{field}”；可用：{fields}"],
  ],
  ["request.not_finite", ["{value} is not finite", "{value} 不是有限数值"]],
  [
    "request.key_too_long",
    ["the key has {count} characters: at most {most} are allowed", "键长 {count} 个字符：最多 {most}"],
  ],
  [
    "page.too_many_requests",
    [
      "more than {count} requests are waiting for an answer: try again later",
      "超过 {count} 个请求等待应答：请稍后再试",
    ],
  ],
  ["page.console_no_right", ["the console may not send {request}", "控制台无权请求 {request}"]],
  [
    "page.needs_operator",
    ["{account} is a {role}: {what} needs an operator", "{account} 的角色是 {role}：{what} 需要操作员"],
  ],
  [
    "page.password_again",
    [
      "commands are locked because this page was not used for a while: enter your password again",
      "请先再次输入密码：控制权限已休眠",
    ],
  ],
  ["page.signed_out", ["this page is no longer signed in: sign in again", "此处已无人登录"]],
  [
    "page.own_name_only",
    ["{who} may send requests only as {own}, not as {name}", "{who} 只能以 {own} 的名义请求，不能以 {name}"],
  ],
  ["request.worker_gave_up", ["aborted: {detail}", "已放弃：{detail}"]],
  ["lease.taken", ["control taken", "已取得控制"]],
  ["lease.renewed", ["control renewed", "控制权已续期"]],
  ["lease.released", ["control released", "已释放控制"]],
  ["lease.offered", ["control offered to {name}", "已向 {name} 提出移交控制权"]],
  ["lease.offer_withdrawn", ["offer withdrawn", "已撤回移交"]],
  ["lease.taken_from", ["control taken over from {name}", "已从 {name} 接过控制权"]],
  ["lease.asked", ["{name} asks {holder} for control", "已通知 {holder}：{name} 请求控制权"]],
  [
    "lease.none",
    [
      "no operator is in control, or the lease has ended: take control first (ACQUIRE)",
      "无人控制，或控制权已结束：请先取得控制（ACQUIRE）",
    ],
  ],
  [
    "lease.held",
    ["{holder} is in control: wait until it is released, or ask for it", "{holder} 正在控制：请等待释放，或请求控制权"],
  ],
  [
    "lease.other",
    [
      "{name} is in control with another lease (another window or program?): this lease is not valid",
      "{name} 正以另一控制权控制（另一窗口或程序？）：此控制权无效",
    ],
  ],
  ["lease.free", ["no operator is in control: take control (ACQUIRE)", "无人控制：可直接取得控制（ACQUIRE）"]],
  ["lease.own", ["{name} is in control already", "{name} 已在控制中"]],
  [
    "lease.moving",
    [
      "{holder}'s motion is still running: wait until it ends, then accept",
      "{holder} 的运动仍在进行：请待其结束后再接受",
    ],
  ],
  [
    "lease.not_offered",
    [
      "control was not offered to {name}: ask its holder, or ACQUIRE",
      "未向 {name} 移交控制权：请向控制者请求，或 ACQUIRE",
    ],
  ],
  [
    "lease.no_reason",
    ["TAKE needs a reason: say in `reason` why control is taken away", "接管（TAKE）须在 reason 中说明理由"],
  ],
  [
    "lease.not_written",
    ["control not granted: {cause}, so its holder could not be recorded", "不能取得控制：{cause}，无法记录控制者"],
  ],
  ["lease.ended.released", ["{name} released control", "{name} 释放了控制权"]],
  ["lease.ended.released_why", ["{name} released control: {reason}", "{name} 释放了控制权：{reason}"]],
  ["lease.ended.handed_over", ["handed over to {name}", "已移交给 {name}"]],
  ["lease.ended.taken", ["taken by {name}: {reason}", "被 {name} 接管：{reason}"]],
  [
    "lease.ended.expired",
    ["{name}'s lease was not renewed within {seconds} s", "{name} 的控制权未在 {seconds} 秒内续期"],
  ],
  ["lease.ended.session", ["{name}'s page or program has disconnected", "{name} 的页面或程序已离线"]],
  [
    "lease.ended.foreign_motion",
    ["the robot began to move without a command from its holder", "机器人开始运动，并非由控制者命令"],
  ],
  ["lease.ended.gateway", ["the gateway is shutting down", "网关正在关闭"]],
  ["lease.ended.unknown", ["no reason given", "原因未知"]],
  [
    "lease.ended.client",
    ["{name}'s old client program {client} has disconnected", "{name} 的旧客户端程序 {client} 已断开"],
  ],
  [
    "command.id_old",
    [
      "id {id} is not higher than {last}, the last one under this lease: use a higher id for each command",
      "编号 {id} 不大于此控制权下的上一编号 {last}：每条命令须递增",
    ],
  ],
  [
    "command.id_used",
    ["id {id} was used for {what}: use a higher id for each command", "编号 {id} 已用于 {what}：每条命令须递增"],
  ],
  [
    "command.late",
    [
      "it arrived {seconds} s after its not_after: it was delayed, or not_after is not in the gateway's time (`now` in each lease answer)",
      "晚于其 not_after {seconds} 秒到达：途中延迟，或所用时钟与网关不同（见每次控制权应答中的 now）",
    ],
  ],
  [
    "command.waited",
    [
      "it waited {waited} s in the gateway (for the audit log, or for earlier requests); after {seconds} s its sender may have given up: send it again",
      "在网关中等待了 {waited} 秒（等待审计日志或前面的请求）；超过 {seconds} 秒可能已无人等待，请重新发送",
    ],
  ],
  [
    "command.two_units",
    [
      "RESUME and another motion are two units: resume first, or RESET",
      "RESUME 与另一运动须分两次发送：请先继续，或复位",
    ],
  ],
  [
    "command.program_runs",
    ["program {name} is running: stop it, or wait until it has ended", "程序 {name} 正在运行：请停止它，或等待其结束"],
  ],
  ["command.held", ["HOLD arrived before it could be sent", "保持命令先到，未发送"]],
  ["command.control_ended", ["control ended", "控制权已结束"]],
  [
    "command.control_ended_meanwhile",
    ["control ended while the command was being written to the audit log", "写入审计日志期间控制权已结束"],
  ],
  ["command.broken_off", ["it was cancelled while it was being written to the audit log", "写入审计日志时中断"]],
  [
    "command.not_written",
    ["{cause}; a command that cannot be recorded is not executed", "{cause}；未写入审计日志的不执行"],
  ],
  ["command.changed", ["{cause} since the motion was checked", "检查之后{cause}"]],
  ["command.unsupported", ["{detail}", "{detail}"]],
  ["command.not_latched", ["{cause}, so a restart would forget a stop", "{cause}；重新启动后会忘记停止"]],
  ["stop.not_latched", ["stop {id} is not latched; no stop is", "停止 {id} 未锁定，目前没有锁定的停止"]],
  [
    "stop.other",
    [
      "RESET names stop {asked}, but stop {id} is latched ({by}: {reason}): remove the cause, then send RESET with stop_id {id}",
      "复位指定停止 {asked}，但锁定的是停止 {id}（{by}：{reason}）：请排除原因，再以 stop_id {id} 复位",
    ],
  ],
  [
    "stop.moving",
    [
      "the robot is still moving after stop {id}: wait until it has stopped, then send RESET",
      "停止 {id} 之后机器人仍在运动：请待其静止后再复位",
    ],
  ],
  [
    "stop.latched",
    [
      "stop {id} is latched ({by}: {reason}): remove the cause, then send RESET with stop_id {id}",
      "停止 {id} 已锁定（{by}：{reason}）：请排除原因，再以 stop_id {id} 复位",
    ],
  ],
  ["robot.read_only", ["this robot is read-only: {cause}", "此机器人只读：{cause}"]],
  ["robot.is_read_only", ["read-only: {cause}", "只读：{cause}"]],
  [
    "robot.no_stop_code",
    [
      'the codes in the site file have no stop for its controller: add the code of "COMMAND:stop", or of "COMMAND"',
      '站点文件的 codes 中没有此控制器的停止：请添加 "COMMAND:stop" 或 "COMMAND" 的代码',
    ],
  ],
  [
    "robot.stop_not_proven",
    [
      "its stop is not proven: test the stop unit on its controller (see docs/safety.md), then set stop_proven = true for this robot in the site file",
      "其停止命令未经验证：请在控制器上试验停止（见 docs/safety.md），再在站点文件中写入 stop_proven = true",
    ],
  ],
  ["robot.not_homed", ["the robot is not homed: home it first (HOME)", "机器人未回零：请先回零（HOME）"]],
  [
    "robot.homed_unknown",
    [
      'the controller does not report whether the robot is homed: home it first (HOME); for a controller that never reports it, set accept_unknown = ["homed"] in the site file',
      '控制器未告知是否已回零：请先回零（HOME）；若它从不告知，可在站点文件中写入 accept_unknown = ["homed"]',
    ],
  ],
  ["robot.moved", ["the robot has moved", "机器人已移动"]],
  ["robot.other_moved", ["{name} has moved, or has been commanded to move,", " {name} 已移动，或收到运动命令"]],
  [
    "robot.moves_stop",
    [
      "the robot is moving, or about to move: wait until it has stopped, or stop it",
      "机器人正在或即将运动：请待其静止，或停止它",
    ],
  ],
  [
    "robot.moves_home",
    [
      "the robot is moving, or about to move: wait until it has stopped, or send it home",
      "机器人正在或即将运动：请待其静止，或让其回零",
    ],
  ],
  ["link.down", ["the link to the controller is down ({cause})", "与控制器断开（{cause}）"]],
  [
    "link.silent",
    [
      "the controller is silent, so the robot's position is unknown ({cause})",
      "控制器无数据，机器人当前位置未知（{cause}）",
    ],
  ],
  ["link.connecting", ["connecting to {where}", "正在连接 {where}"]],
  ["link.connected", ["connected to {where}", "已连接 {where}"]],
  ["link.no_unit", ["connected to {where}, no unit yet", "已连接 {where}，尚未收到数据"]],
  ["link.failed", ["cannot connect to {where}: {detail}", "无法连接 {where}：{detail}"]],
  ["link.no_answer", ["{where} does not answer", "{where} 无应答"]],
  ["link.closed", ["the link was closed", "连接已关闭"]],
  ["link.lost", ["{where}: {detail}", "{where}：{detail}"]],
  ["link.refused", ["{where} refused the connection: {detail}", "{where} 拒绝连接：{detail}"]],
  ["link.no_data", ["{where} sends nothing", "{where} 无数据"]],
  ["link.reconnects", ["{where} sends nothing; connecting again", "{where} 无数据，正在重连"]],
  [
    "link.deluge",
    ["{where} sends far too much data: all of it is discarded", "{where} 发送的数据远超上限：全部未采用"],
  ],
  ["link.other_joints", ["{where} sends {detail}", "{where} 发送的关节数不符：{detail}"]],
  ["link.just_ended", ["the connection has just ended", "连接刚刚断开"]],
  ["link.broke", ["the connection broke while it was written", "写入时连接中断"]],
  ["link.clogged", ["the controller does not read; connecting again", "控制器不读取数据；正在重连"]],
  ["stop.sent", ["stop request {id} is on the controller's socket", "停止 {id} 已发送给控制器"]],
  ["stop.not_sent", ["stop request {id} is latched, but not sent: {cause}", "停止 {id} 已锁定，但未送达：{cause}"]],
  [
    "stop.read_only",
    [
      "stop request not sent, because the robot is read-only ({cause}): stop it at its own panel",
      "停止请求未发送：机器人只读，请在其面板上停止：{cause}",
    ],
  ],
  [
    "stop.sent_again",
    ["stop request {id} was sent to the controller when its link came back", "连接恢复后停止 {id} 已发送给控制器"],
  ],
  ["stop.unit_repeated", ["the stop unit was sent again", "已再次发送停止单元"]],
  [
    "stop.disobeyed",
    [
      "the robot moves although stop request {id} was sent: use the emergency stop there ({cause})",
      "停止 {id} 已发送，但机器人仍在运动：请使用现场急停（{cause}）",
    ],
  ],
  ["stop.sent_later", ["{cause}; it is sent as soon as the link is back", "{cause}；连接恢复后立即发送"]],
  [
    "controller.local",
    [
      "the controller is in local mode: switch it to remote at the controller",
      "控制器处于本地模式：请在控制器上切换为远程",
    ],
  ],
  [
    "controller.mode_unknown",
    [
      'the controller does not report whether it is in remote or local mode; for one that never does, set accept_unknown = ["mode"] in the site file',
      '控制器未告知是远程还是本地模式；若它从不告知，可在站点文件中写入 accept_unknown = ["mode"]',
    ],
  ],
  [
    "controller.stopped",
    ["the controller is stopped: remove the cause, then send RESET", "控制器已停止：请排除原因，再复位"],
  ],
  [
    "controller.fault",
    ["the controller has a fault ({fault}): clear it, then send RESET", "控制器故障（{fault}）：请排除，再复位"],
  ],
  [
    "controller.holding",
    ["a motion is on hold: RESUME it, or cancel it with RESET", "有运动处于保持：请继续，或以复位放弃"],
  ],
  ["controller.not_holding", ["nothing is on hold: there is no motion to resume", "没有处于保持的运动可继续"]],
  ["positions.stale", ["no joint positions for {seconds} s", "{seconds} 秒未收到关节位置"]],
  ["positions.unknown", ["the robot's position is unknown ({cause})", "机器人当前位置未知（{cause}）"]],
  ["positions.none", ["the controller has not reported joint positions", "控制器未告知关节位置"]],
  ["speed.missing", ["SPEED needs speed_percent, from 1 to 100", "SPEED 须带 speed_percent，1 至 100"]],
  ["speed.outside", ["speed {value} % is outside 1 to 100 %", "速度 {value} % 超出 1 至 100 %"]],
  [
    "joints.count",
    [
      "{count} joint positions, but the robot has {joints} joints ({names})",
      "给出 {count} 个关节位置，而机器人有 {joints} 个关节（{names}）",
    ],
  ],
  ["joints.outside", ["{cause}", "{cause}"]],
  ["joints.limit", ["joint {name} at {value} is beyond its limit {limit}", "关节 {name} 的 {value} 超出限位 {limit}"]],
  ["joints.not_finite", ["joint {name} at {value} is not a finite number", "关节 {name} 的 {value} 不是有限数值"]],
  ["joints.constraint", ["{terms} at {value} is beyond its limit {limit}", "{terms} 的 {value} 超出限位 {limit}"]],
  ["program.unreadable", ["{detail}", "{detail}"]],
  ["program.unreachable", ["{detail}", "{detail}"]],
  ["program.start_outside", ["at the start: {cause}", "起始位置：{cause}"]],
  ["program.line", ["line {line}: {cause}", "第 {line} 行：{cause}"]],
  ["program.too_long", ["a program has at most {kib} KiB", "程序不得超过 {kib} KiB"]],
  ["program.moved", ["the robot has moved since its program was checked", "程序检查之后机器人已移动"]],
  ["program.hold", ["HOLD arrived during its check: not started", "检查期间收到保持命令：未开始"]],
  [
    "program.asker_gave_up",
    [
      "its check did not finish before its sender's deadline: allow more time (not_after) and try again",
      "未在请求者的等待时间内完成检查：请延长等待（not_after）后重新发送",
    ],
  ],
  ["program.plan_too_slow", ["planning it takes longer than {seconds} s", "规划超过 {seconds} 秒，不再等待"]],
  ["program.stopped", ["stopped by {by}: {reason}", "{by} 请求停止：{reason}"]],
  ["program.stopped_by_number", ["stopped: stop request {id}", "已停止：停止请求 {id}"]],
  ["program.given_up", ["cancelled by RESET", "已以复位放弃"]],
  ["program.control_ended", ["control ended: {cause}", "控制权结束：{cause}"]],
  ["program.not_arrived", ["the robot came to rest before the target of the line", "机器人在到达该行目标之前停下"]],
  ["program.done", ["program {program} is done", "程序 {program} 已完成"]],
  ["program.ended", ["program {program} ended at line {line}: {cause}", "程序 {program} 中止于第 {line} 行：{cause}"]],
  ["program.failed", ["the gateway failed with an internal error: see its log", "网关执行程序时出错：详见其日志"]],
  ["check.below_floor", ["{one} goes {depth_mm} mm below the floor", "{one} 低于地面 {depth_mm} mm"]],
  ["check.touches", ["{one} touches {other}", "{one} 与 {other} 接触"]],
  [
    "check.nearer_than_stop",
    [
      "{one} comes within {distance_mm} mm of {other}, nearer than its stop distance of {limit_mm} mm",
      "{one} 距 {other} 仅 {distance_mm} mm，小于停止距离 {limit_mm} mm",
    ],
  ],
  [
    "check.nearer_than_warning",
    [
      "{one} comes within {distance_mm} mm of {other}, nearer than its warning distance of {limit_mm} mm",
      "{one} 距 {other} 仅 {distance_mm} mm，小于警告距离 {limit_mm} mm",
    ],
  ],
  [
    "check.tool_too_fast",
    [
      "the tool moves at {speed} mm/s, faster than the program's tool speed of {limit} mm/s",
      "工具速度 {speed} mm/s，承诺为 {limit} mm/s",
    ],
  ],
  [
    "check.nearly_singular",
    [
      "the arm is nearly singular: {value}, but motion along a line needs {limit}",
      "机械臂接近奇异：{value}，直线运动要求 {limit}",
    ],
  ],
  ["check.on_its_way", ["on its way {cause}", "途中{cause}"]],
  ["check.more", ["and {count} more", "另有 {count} 处"]],
  [
    "check.required",
    [
      'it cannot be checked, and this robot\'s site says check = "require": {cause}',
      '无法检查，而站点文件要求检查（check = "require"）：{cause}',
    ],
  ],
  ["check.skipped", ["not checked: {cause}", "未检查：{cause}"]],
  ["check.starting", ["the check is still starting: try again in a few seconds", "检查仍在准备：请几秒后再试"]],
  ["check.broken", ["the check does not work: {detail}", "检查无法工作：{detail}"]],
  ["check.failed", ["the check failed: {detail}", "检查失败：{detail}"]],
  ["check.impossible", ["{detail}", "{detail}"]],
  [
    "check.queued_too_long",
    ["the check waited longer than {seconds} s for other checks", "检查超过 {seconds} 秒：正在检查其他请求"],
  ],
  ["check.too_slow", ["the check took longer than {seconds} s", "检查超过 {seconds} 秒"]],
  ["check.no_position", ["its controller does not report the robot's position", "其控制器未告知机器人位置"]],
  [
    "check.held_way_unknown",
    [
      "the target of the held motion is unknown: cancel it (RESET), then send a new motion",
      "保持中的运动去向未知：请以复位放弃，再重新运动",
    ],
  ],
  ["check.others_unknown", ["unknown: {cause}", "未知：{cause}"]],
  ["check.other_unknown", ["the position or the target of {name} ({cause})", "{name} 的位置或去向（{cause}）"]],
  ["check.others_left_out", ["unknown, so not included: {cause}", "未知：{cause}"]],
  ["other.no_position", ["its controller does not report its position", "其控制器未告知其位置"]],
  ["other.moves", ["it is moving to an unknown target", "它正在运动，去向未知"]],
  ["other.not_served", ["this gateway does not serve it", "此网关不服务于它"]],
  [
    "check.no_shapes",
    ["no link in {name}'s description has a shape, so it cannot be checked", "{name} 的描述没有任何连杆形状，无法检查"],
  ],
  [
    "check.mesh_missing",
    ["{name} cannot be checked completely: mesh file not found: {files}", "{name} 无法完整检查：缺少网格文件 {files}"],
  ],
  [
    "check.link_without_shape",
    [
      "{name} cannot be checked completely: {links} moves and has no shape",
      "{name} 无法完整检查：{links} 会运动但没有形状",
    ],
  ],
  [
    "check.fixed_without_shape",
    ["not checked, because they have no shape: {links} of {name}", "{name} 的 {links} 没有形状，未检查"],
  ],
  ["audit.slow", ["the audit log's disk takes longer than {seconds} s", "审计日志所在磁盘超过 {seconds} 秒无响应"]],
  ["audit.not_writable", ["the audit log {file} cannot be written ({detail})", "审计日志 {file} 无法写入（{detail}）"]],
  ["audit.queue_full", ["{count} entries wait for the disk", "{count} 条记录等待写入磁盘"]],
  [
    "latch.slow",
    ["the latch file {name} takes longer than {seconds} s to write", "停止锁定文件 {name} 超过 {seconds} 秒未写入"],
  ],
  [
    "latch.closed",
    ["the latch file {name} is closed: its gateway is shutting down", "停止锁定文件 {name} 已关闭：其网关正在关闭"],
  ],
  [
    "latch.not_writable",
    ["the latch file {name} cannot be written ({detail})", "停止锁定文件 {name} 无法写入（{detail}）"],
  ],
  [
    "latch.not_allocated",
    ["the latch file {name} cannot be allocated ({detail})", "停止锁定文件 {name} 无法分配（{detail}）"],
  ],
  ["audit.last_of_many", ["{cause} (the last of many callers)", "{cause}（多个请求者中的最后一个）"]],
  ["audit.not_done", ["not done: {cause}", "未完成：{cause}"]],
  [
    "audit.searches",
    [
      "{count} searches of this log are already waiting: try again in a moment",
      "此日志已有 {count} 个搜索在等待：请稍后再试",
    ],
  ],
  ["audit.unreadable", ["{file} cannot be read: {detail}", "{file} 无法读取：{detail}"]],
  [
    "audit.too_many",
    ["most = {count} is too many: at most {most} entries are returned", "most = {count}：一次最多给出 {most} 条"],
  ],
  [
    "alarm.no_reason",
    [
      "the reason is missing: say why the alarm is shelved, as in 'switched off for service until noon'",
      "reason：请说明搁置原因，例如“停机维护至中午”",
    ],
  ],
  [
    "alarm.shelf_time",
    [
      "shelve_s is {seconds} s: it must be more than 0 and at most {most} (a day)",
      "shelve_s：{seconds} 秒：应大于 0 且不超过 {most}（一天）",
    ],
  ],
  ["alarm.not_shelved", ["alarm '{id}' is not shelved", "报警“{id}”未被搁置"]],
  ["alarm.none_named", ["the list of alarms is empty: name at least one alarm in `ids`", "ids：请至少指明一个报警"]],
  [
    "alarm.unknown",
    ["no alarm '{id}': it may have ended and been acknowledged", "没有报警“{id}”：它可能已结束并被查看"],
  ],
  [
    "inverse.task",
    [
      "task {task} is unknown: use POSE_6D or POSITION_AND_AXIS_5D",
      "task {task}：应为 POSE_6D 或 POSITION_AND_AXIS_5D",
    ],
  ],
  ["inverse.pose", ["{detail}", "{detail}"]],
  ["inverse.near", ["near: {detail}", "near（参考位置）：{detail}"]],
  [
    "check.start_unknown",
    ["the position of {robot} is unknown: give `start`", "start：{robot} 的当前位置未知；请给出"],
  ],
  [
    "joints.count_of_field",
    [
      "{field} has {count} values, but {robot} has {joints} joints ({names})",
      "{field}：给出 {count} 个，{robot} 有 {joints} 个关节（{names}）",
    ],
  ],
  ["mesh.unknown", ["no mesh '{name}'; {robot} has {meshes}", "没有网格“{name}”；{robot} 有 {meshes}"]],
  [
    "recording.name",
    [
      "name '{name}' is invalid: use at most 81 letters, digits, '_', '.' and '-', beginning with a letter or digit",
      "名称“{name}”：最多 81 个字母、数字、“_”、“.”和“-”，以字母或数字开头",
    ],
  ],
  ["recording.open", ["{robot} is already being recorded, as '{name}'", "{robot} 已在录制，名称为“{name}”"]],
  ["recording.not_open", ["{robot} is not being recorded", "{robot} 未在录制"]],
  ["recording.failed", ["{detail}", "{detail}"]],
  ["recording.unreadable", ["{detail}", "{detail}"]],
  ["recording.no_joints", ["{file} contains no joint states", "{file}：其中没有关节记录"]],
  [
    "recorder.busy",
    [
      "the recorder is busy: its recordings/{request} is not ready yet; try again",
      "录制服务忙：recordings/{request} 尚未就绪；请再试",
    ],
  ],
  [
    "recorder.flight_not_running",
    ["the flight recorder of {robot} is not running: is the disk full?", "{robot} 的飞行记录器未运行：磁盘是否已满？"],
  ],
  [
    "recorder.flight_none",
    [
      "the flight recorder is switched off: switch it on with [recorder] flight in the site file",
      "此处没有飞行记录器：站点文件的 [recorder] flight",
    ],
  ],
  ["replay.is_recorded", ["this is a replay of {file}, which is already a recording", "{file} 的回放：已是录制"]],
  [
    "replay.cannot_move",
    ["this is a replay of {file}; it cannot be commanded", "{file} 的回放：此处没有可运动的机器人"],
  ],
  [
    "replay.position",
    [
      "position {seconds} s is outside the recording: choose 0 to {most} s",
      "位置 {seconds} 秒：应在 0 至 {most} 秒之间",
    ],
  ],
  [
    "replay.speed",
    ["speed {speed} is out of range: choose {least} to {most}", "速度 {speed}：应在 {least} 至 {most} 之间"],
  ],
  [
    "replay.no_robot",
    [
      "{file} is not a recording of a robot: it has no topic robomesh/SITE/ROBOT/TOPIC",
      "{file}：不是机器人的录制：没有主题 robomesh/SITE/ROBOT/TOPIC",
    ],
  ],
  ["replay.too_many", ["{count} replays are already open: close one first", "已在播放 {count} 个录制：请先关闭一个"]],
  [
    "replay.session",
    [
      "session '{session}' is not present: give the id of a present alive/operator/<id>",
      "会话“{session}”不在线：应为请求者的 alive/operator/<id>",
    ],
  ],
  ["view.unknown", ["no view '{view}'; there are {views}", "没有视图“{view}”；现有 {views}"]],
  ["view.unknown_of", ["no view '{view}' of {robot}: there are {views}", "{robot} 没有视图“{view}”：现有 {views}"]],
  ["view.no_room", ["no capacity: {detail}", "没有余量：{detail}"]],
  ["view.invalid", ["{detail}", "{detail}"]],
  ["view.no_answer", ["the answer to {key}/views contains no view", "{key}/views 的应答中没有视图"]],
] as const);

/** A reason's sentence in the page's language; `text` where this page does not know the code. */
export function reasonText(reason: Reason | undefined, text = reason?.text ?? ""): string {
  return (reason && sentence(reason)) ?? text;
}

/** Reasons as one text; `text` where there are none. */
export function reasonsText(reasons: readonly Reason[] = [], text = ""): string {
  return reasons.length > 0 ? reasons.map((reason) => reasonText(reason)).join(t("list_separator")) : text;
}

/** Undefined: the code is unknown, or a parameter did not fit into the answer. */
function sentence({ code, values, causes }: Reason): string | undefined {
  const pair = SENTENCES.get(code);
  if (!pair) return undefined;
  const known = causes.map((cause) => reasonText(cause));
  const all = known.length > 0 && known.every(Boolean) ? { ...values, cause: known.join(t("list_separator")) } : values;
  const names = [...pair[0].matchAll(/\{(\w+)\}/g)].map((found) => found[1] ?? "");
  return names.every((name) => all[name]) ? inLanguage(pair, all) : undefined;
}
