// Why a request is refused, control ended or a motion is not checked: reasons of the mesh in the page's language.

import { SENTENCES_OF_KINDS } from "../gen/reasons-of-kinds";
import type { Reason } from "../gen/robomesh_pb";
import { isSaid } from "./stop-words";
import { inLanguage, language, t } from "./texts";

/** Sentences by code, English and Chinese, with the parameters of robomesh/reason_codes.py; {cause}: the causes. */
const SENTENCES: ReadonlyMap<string, readonly [english: string, chinese: string]> = new Map([
  ...SENTENCES_OF_KINDS,
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
  ["request.invalid", ["{cause}", "{cause}"]],
  ["other", ["{detail}", "{detail}"]],
  ["several", ["{cause}", "{cause}"]],
  [
    "request.wildcard",
    ["{key} has a wildcard: ask one {request} by its whole key", "{key} 含通配符：请以完整键请求一个 {request}"],
  ],
  ["request.no_right", ["{cause}", "{cause}"]],
  ["right.key", ["{name} has the role {role}: it may not use {key}", "{name} 的角色是 {role}：无权使用 {key}"]],
  [
    "right.role",
    [
      "{name} has the role {role}: it may not {act} {topic}; only {roles} may",
      "{name} 的角色是 {role}：无权{act} {topic}；有权的角色：{roles}",
    ],
  ],
  [
    "right.name",
    [
      "{name} has the role {role}: it may not {act} {topic}, which carries another name; it may {act} {own}",
      "{name} 的角色是 {role}：无权{act} {topic}，因为它带有另一名称；有权{act} {own}",
    ],
  ],
  [
    "right.site",
    [
      "{name} has the role {role}: it may not {act} {topic} at site {site}, which is another site",
      "{name} 的角色是 {role}：无权{act}另一站点 {site} 的 {topic}",
    ],
  ],
  [
    "right.robot",
    [
      "{name} has the role {role}: it may not {act} {topic} of {robot}; its robots are {robots}",
      "{name} 的角色是 {role}：无权{act} {robot} 的 {topic}；其机器人为 {robots}",
    ],
  ],
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
  ["request.needs_text", ["the field '{field}' is missing or is not a text", "字段“{field}”缺失或不是文本"]],
  ["request.needs_object", ["the field '{field}' is missing or is not an object", "字段“{field}”缺失或不是对象"]],
  ["request.too_large", ["the request is larger than {bytes} bytes", "请求超过 {bytes} 字节"]],
  ["request.half_character", ["the request contains an unpaired surrogate", "请求中含有不成对的代理字符"]],
  [
    "request.no_answer",
    [
      "no answer to {key} within {seconds} s: is its service running?",
      "{seconds} 秒内 {key} 无应答：其服务是否在运行？",
    ],
  ],
  [
    "request.no_answer_or_revoked",
    ["{cause} Or was the certificate of {name} revoked?", "{cause}或者 {name} 的证书已被吊销？"],
  ],
  [
    "request.broken_answer",
    ["{key}: {bytes} of {total} bytes arrived, then {cause}", "{key}：收到 {total} 字节中的 {bytes} 字节，随后{cause}"],
  ],
  ["piece.none", ["no further piece within {seconds} s", "{seconds} 秒内没有后续数据"]],
  ["piece.dropped", ["its owner no longer kept it: repeat the request", "对方已不再保留：请重新请求"]],
  ["request.not_asked", ["{key} could not be asked: {detail}", "无法请求 {key}：{detail}"]],
  [
    "request.no_service",
    [
      "no {services} runs for {place}: check the name, and that the service is running",
      "{place} 没有正在运行的 {services}：请检查名称以及该服务是否在运行",
    ],
  ],
  [
    "presence.unknown",
    [
      "the router did not list the live services within {seconds} s: try again",
      "路由器在 {seconds} 秒内未列出在线服务：请再试一次",
    ],
  ],
  ["request.abandoned", ["the client has disconnected", "客户端已断开"]],
  [
    "request.unknown_field",
    ["{request} has no field '{field}'; it takes {fields}", "{request} 没有字段“{field}”；可用：{fields}"],
  ],
  ["request.not_finite", ["{value} is not finite", "{value} 不是有限数值"]],
  ["request.not_message", ["{count} bytes are not a {message}: {detail}", "{count} 字节不是 {message}：{detail}"]],
  ["request.not_json_message", ["the JSON does not fit {message}: {detail}", "JSON 不符合 {message}：{detail}"]],
  ["request.not_lease_request", ["this is no LeaseRequest", "这不是 LeaseRequest"]],
  ["request.field_not_one_of", ["{field}: '{value}' is not one of {names}", "{field}：“{value}”无效；可用：{names}"]],
  ["request.field_unset", ["{field}: set one of {names}", "{field}：请设为下列之一：{names}"]],
  ["request.field_not_finite", ["{field}: {value} is not finite", "{field}：{value} 不是有限数值"]],
  [
    "request.field_time",
    ["{field}: {seconds} s and {nanos} ns is not a valid time", "{field}：{seconds} 秒 {nanos} 纳秒不是有效时间"],
  ],
  ["request.unknown", ["no request '{name}'; there are {names}", "没有请求“{name}”；现有 {names}"]],
  ["key.topic_unknown", ["no topic '{name}'; there are {names}", "没有主题“{name}”；现有 {names}"]],
  [
    "key.name",
    [
      "{what} '{name}' cannot be used: lower-case letters, digits, '_' and '-', beginning with a letter or digit, at most {most}",
      "{what}“{name}”不可用：须为小写字母、数字、“_”和“-”，以字母或数字开头，最多 {most} 个字符",
    ],
  ],
  [
    "key.chunk",
    [
      "{what} '{name}' cannot be used: letters, digits, '_', '.' and '-', beginning with a letter or digit, at most {most} characters",
      "{what}“{name}”不可用：须为字母、数字、“_”、“.”和“-”，以字母或数字开头，最多 {most} 个字符",
    ],
  ],
  [
    "key.other",
    [
      "'{key}' is not a key of the mesh: robomesh/<site>/<robot>/<topic>",
      "“{key}”不是网络的键：robomesh/<site>/<robot>/<topic>",
    ],
  ],
  [
    "key.not_presence",
    [
      "'{key}' is not a presence key: robomesh/<site>/<robot>/alive/<service>/<id>",
      "“{key}”不是在线键：robomesh/<site>/<robot>/alive/<service>/<id>",
    ],
  ],
  [
    "key.operator_reserved",
    ["operator '{name}' cannot be used: it is the name of a request", "操作员“{name}”不可用：这是一个请求的名称"],
  ],
  [
    "key.operator_too_long",
    ["operator {name}: a name has at most {most} characters", "操作员 {name}：名称最多 {most} 个字符"],
  ],
  ["fault.unknown", ["fault '{name}' is unknown; there are {names}", "没有故障“{name}”；现有 {names}"]],
  [
    "fault.times",
    [
      "fault '{given}': must be NAME@BEGIN+LENGTH, both in seconds, as in {name}@2.5+10",
      "故障“{given}”：应为 NAME@BEGIN+LENGTH，均以秒为单位，例如 {name}@2.5+10",
    ],
  ],
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
    "page.needs_engineer",
    ["{account} is a {role}: {what} needs an engineer", "{account} 的角色是 {role}：{what} 需要工程师"],
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
  [
    "page.too_many_pages",
    ["this session already has {count} open pages: close a page first", "该会话已打开 {count} 个页面：请先关闭一个"],
  ],
  ["page.text", ["this connection takes binary messages only", "此连接只接受二进制消息"]],
  ["page.not_a_message", ["not a message of a page: {detail}", "不是页面的消息：{detail}"]],
  [
    "page.reads_too_slowly",
    ["more than {bytes} bytes are waiting for a page that does not read", "超过 {bytes} 字节等待一个不读取的页面"],
  ],
  [
    "page.asks_too_much",
    [
      "this page has sent more than the console reads from one page for more than {seconds} s: send less",
      "本页发送的请求超过控制台对一个页面的读取限度已逾 {seconds} 秒：请减少请求",
    ],
  ],
  ["page.stops_only", ["this connection takes requests for a stop only", "此连接只接受停止请求"]],
  [
    "page.too_many_keys",
    ["this page already watches {count} keys: unwatch one first", "本页已在监视 {count} 个键：请先取消一个"],
  ],
  [
    "page.watch_wildcard",
    [
      "'{key}' cannot be watched: name the view; '*' may replace the site and the robot only",
      "不能监视“{key}”：请写明视图；“*”只可代替站点和机器人",
    ],
  ],
  [
    "page.watch_video",
    ["'{key}' cannot be watched: name the site and the robot of a video", "不能监视“{key}”：请写明视频的站点和机器人"],
  ],
  [
    "page.watch_no_right",
    ["'{key}' cannot be watched: the console has no right to {topic}", "不能监视“{key}”：控制台无权订阅 {topic}"],
  ],
  ["page.cannot_watch", ["'{key}' cannot be watched: {cause}", "不能监视“{key}”：{cause}"]],
  ["request.worker_gave_up", ["aborted: {cause}", "已放弃：{cause}"]],
  ["worker.too_slow", ["no answer within {seconds} s", "{seconds} 秒内没有应答"]],
  ["worker.not_started", ["{module} could not be started: {detail}", "{module} 无法启动：{detail}"]],
  ["worker.start_too_slow", ["{module} did not start within {seconds} s", "{module} 未在 {seconds} 秒内启动"]],
  ["worker.crashed", ["{module} crashed (status {status})", "{module} 崩溃（状态 {status}）"]],
  [
    "worker.answer_too_long",
    ["{module}: its answer has {count} bytes: {most} at most", "{module}：其应答有 {count} 字节：最多 {most}"],
  ],
  ["worker.answer_invalid", ["{module}: its answer is invalid: {detail}", "{module}：其应答无效：{detail}"]],
  [
    "http.host",
    [
      "host '{host}' is not this console's: use its address, or name it in the console's hosts",
      "主机名“{host}”不属于此控制台：请使用其地址，或在控制台的 hosts 中列出该名称",
    ],
  ],
  ["http.origin", ["origin '{origin}' is not this page's: {host}", "来源“{origin}”不是本页的来源：{host}"]],
  ["http.other_page", ["the request comes from another page", "请求来自另一个页面"]],
  [
    "http.two_lengths",
    [
      "the request has a content-length and a transfer-encoding: send one of them",
      "请求同时含有 content-length 和 transfer-encoding：请只发送其一",
    ],
  ],
  ["http.body", ["a {method} request has no body", "{method} 请求不应有正文"]],
  ["http.no_path", ["there is no {path}", "没有 {path}"]],
  ["http.method", ["{path} does not take {method}", "{path} 不接受 {method}"]],
  ["account.sign_in", ["no account is signed in: sign in first", "没有账户登录：请先登录"]],
  ["account.wrong", ["the account or the password is wrong", "账户或密码错误"]],
  ["account.password_wrong", ["the current password is wrong", "当前密码错误"]],
  ["account.wait", ["too many attempts: try again in {seconds} s", "尝试次数过多：请在 {seconds} 秒后重试"]],
  ["account.busy", ["too many passwords wait to be verified: try again in a moment", "等待验证的密码过多：请稍后重试"]],
  ["account.not_admin", ["{account} is not an administrator", "{account} 不是管理员"]],
  ["account.no_session", ["session '{session}' has ended", "会话“{session}”已结束"]],
  [
    "account.name",
    [
      "account name '{name}' is invalid: use at most {most} lower-case letters, digits, '_' and '-', beginning with a letter or digit",
      "账户名“{name}”不可用：请用最多 {most} 个小写字母、数字、“_”和“-”，以字母或数字开头",
    ],
  ],
  ["account.taken", ["there is an account {name} already", "已有账户 {name}"]],
  ["account.no_account", ["there is no account '{name}': there are {accounts}", "没有账户“{name}”：现有 {accounts}"]],
  [
    "account.last_admin",
    [
      "{name} is the last administrator who can sign in: make another administrator first",
      "{name} 是最后一个可登录的管理员：请先添加另一个管理员",
    ],
  ],
  ["account.role", ["role '{role}' is unknown: there are {roles}", "未知角色“{role}”：现有 {roles}"]],
  ["account.action", ["action '{action}' is unknown: there are {actions}", "未知操作“{action}”：现有 {actions}"]],
  ["account.failed", ["{detail}", "{detail}"]],
  [
    "token.unknown",
    [
      "the token in this address is unknown: ask an administrator for a new address",
      "此网址中的令牌未知：请向管理员索取新网址",
    ],
  ],
  [
    "token.revoked",
    [
      "token {token} of this address is revoked: ask an administrator for a new address",
      "此网址的令牌 {token} 已吊销：请向管理员索取新网址",
    ],
  ],
  [
    "token.expired",
    [
      "token {token} of this address has expired: ask an administrator for a new address",
      "此网址的令牌 {token} 已过期：请向管理员索取新网址",
    ],
  ],
  [
    "token.other_view",
    ["token {token} opens only the view {view} of {robot}", "令牌 {token} 只能打开 {robot} 的视图 {view}"],
  ],
  [
    "account.short",
    [
      "the password is too short: use at least {least} characters; a few words are good",
      "密码太短：请用至少 {least} 个字符，几个词语即可",
    ],
  ],
  ["account.long", ["the password is too long: use at most {most} bytes", "密码太长：最多 {most} 字节"]],
  [
    "account.control",
    ["the password contains a control character: leave this character out", "密码含有控制字符：请去掉该字符"],
  ],
  [
    "account.repeats",
    ["the password repeats a few characters: a few words are good", "密码只重复少数几个字符：请用几个词语"],
  ],
  [
    "account.run",
    ["the password is a run of neighbouring characters: a few words are good", "密码是连续或相邻的字符：请用几个词语"],
  ],
  [
    "account.common",
    [
      "the password is easy to guess, because it is a common word or a name with digits: a few words are good",
      "密码容易被猜到，因为它是常用词或名称加数字：请用几个词语",
    ],
  ],
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
  ["lease.ended.hidden", ["{name}'s page was hidden or closed", "{name} 的页面被隐藏或关闭"]],
  ["lease.ended.no_right", ["{name} is a monitor now", "{name} 现在仅有监视权限"]],
  ["lease.ended.signed_out", ["{name} was signed out", "{name} 已被登出"]],
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
  ["lease.ended.unknown", ["no reason given", "未说明原因"]],
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
    "command.deadline_far",
    [
      "its not_after is {seconds} s ahead of the gateway's time; {command} may wait {most} s: use the gateway's time (`now` in each lease answer)",
      "其 not_after 比网关时间晚 {seconds} 秒；{command} 最多可等待 {most} 秒：请使用网关时间（见每次控制权应答中的 now）",
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
  ["command.not_there", ["this controller has no {command}", "此控制器没有 {command}"]],
  ["command.held", ["HOLD arrived before it could be sent", "保持命令先到，未发送"]],
  ["command.control_ended", ["control ended", "控制权已结束"]],
  ["command.control_ended_meanwhile", ["control ended before the command was sent", "命令发出前控制权已结束"]],
  ["command.broken_off", ["it was cancelled while it was being written to the audit log", "写入审计日志时中断"]],
  [
    "command.not_written",
    ["{cause}; a command that cannot be recorded is not executed", "{cause}；未写入审计日志的不执行"],
  ],
  ["command.changed", ["{cause} since the motion was checked", "检查之后{cause}"]],
  ["command.unsupported", ["{cause}", "{cause}"]],
  ["command.not_a_unit", ["cannot be sent: {detail}", "无法发送：{detail}"]],
  ["command.values", ["{count} values for {joints} joints", "给出 {count} 个值，而关节为 {joints} 个"]],
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
  [
    "recover.not_there",
    ["this controller has no {recovery}: it has: {known}", "此控制器没有 {recovery}；它有：{known}"],
  ],
  [
    "recover.not_allowed",
    [
      "the site file does not allow {recovery} for this robot: add it to the robot's `recover`, or do it at the robot",
      "站点文件不允许对此机器人执行 {recovery}：请将其加入该机器人的 `recover`，或在机器人处操作",
    ],
  ],
  ["recover.reason", ["a recovery needs a reason: type why it is sent", "恢复操作需要原因：请填写原因"]],
  [
    "recover.looked",
    [
      "no person at the robot has looked: confirm it after a person at the robot has found the cause",
      "尚未有人在机器人旁查看：请在有人到场查明原因后再确认",
    ],
  ],
  [
    "recover.moves",
    ["the robot moves, or is not known to rest: wait until it rests", "机器人在运动，或未知是否静止：请待其静止"],
  ],
  [
    "recover.held",
    [
      "a motion is on hold, and could go on: discard it (RESET), or stop the robot",
      "有运动处于保持状态，可能会继续：请复位以放弃该运动，或停止机器人",
    ],
  ],
  [
    "recover.program",
    [
      "programs and old client programs may not recover a controller: an operator sends RECOVER, as the only command of the request",
      "程序和旧客户端程序不得恢复控制器：须由操作员发送 RECOVER，且请求中只有这一个命令",
    ],
  ],
  [
    "recover.sent",
    ["{by} has sent {recovery} to the controller: {reason}", "{by} 已向控制器发送 {recovery}：{reason}"],
  ],
  [
    "recover.answered",
    [
      'the controller answers {recovery} with "{detail}": what became of it shows in the robot\'s state',
      "控制器对 {recovery} 的回答为“{detail}”：结果以机器人的状态为准",
    ],
  ],
  ["recover.refused", ['the controller refuses {recovery}: "{detail}"', "控制器拒绝 {recovery}：“{detail}”"]],
  [
    "recover.unknown",
    [
      "it is unknown whether the controller has done {recovery}: {detail}: look at the robot's state; it is not sent again",
      "控制器是否已执行 {recovery} 未知：{detail}。请查看机器人的状态；不会再次发送",
    ],
  ],
  [
    "robot.homed_by_nature",
    [
      "its encoders are absolute: it is always homed: move it to its home position",
      "其编码器为绝对式，始终已回零：请将其移到原位",
    ],
  ],
  [
    "gateway.twice",
    [
      "another gateway ({id}) also serves robot {robot}, so nobody knows which of them grants control: stop one of the two",
      "另有网关（{id}）也在服务机器人 {robot}，无法确定由哪一个授予控制权：请停止其中之一",
    ],
  ],
  ["robot.read_only", ["this robot is read-only: {cause}", "此机器人只读：{cause}"]],
  ["robot.is_read_only", ["read-only: {cause}", "只读：{cause}"]],
  [
    "robot.motion_off",
    [
      "its site file does not let the gateway move it: move it from its own panel; motion with {protocol} is an experiment (see docs/controllers.md)",
      "站点文件不允许网关移动它：请在其自身的示教器上移动；通过 {protocol} 运动属于试验功能（见 docs/controllers.md）",
    ],
  ],
  [
    "robot.reads_only",
    [
      "the driver of its controller only reads: move it from its own panel",
      "其控制器的驱动只读：请在其自身的示教器上移动",
    ],
  ],
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
  [
    "robot.experimental",
    [
      "motion by the protocol {protocol} was never tried on a real controller: set experimental = true for this robot in the site file to try it",
      "协议 {protocol} 的运动从未在真实控制器上试验：如要试用，请在站点文件中为此机器人写入 experimental = true",
    ],
  ],
  [
    "robot.stop_proof_short",
    [
      'stop_proven does not say what was tried: name driver = "{driver}", means = "{means}", software and date (see docs/safety.md)',
      'stop_proven 未说明试验内容：请写明 driver = "{driver}"、means = "{means}"、software 和 date（见 docs/safety.md）',
    ],
  ],
  [
    "robot.stop_other_means",
    [
      "its stop was proven by {before}, and is sent by {now}: test it again (see docs/safety.md)",
      "其停止以 {before} 验证，而现以 {now} 发送：请重新试验（见 docs/safety.md）",
    ],
  ],
  [
    "robot.stop_other_software",
    [
      "its stop was proven with the software {before} of its controller, which is {now} now: test it again (see docs/safety.md)",
      "其停止以控制器软件 {before} 验证，现为 {now}：请重新试验（见 docs/safety.md）",
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
  ["link.lost", ["{where}: {cause}", "{where}：{cause}"]],
  ["link.closed_there", ["the controller closed the connection", "控制器关闭了连接"]],
  ["link.refused", ["{where} refused the connection: {detail}", "{where} 拒绝连接：{detail}"]],
  ["link.no_data", ["{where} sends nothing", "{where} 无数据"]],
  ["link.reconnects", ["{where} sends nothing; connecting again", "{where} 无数据，正在重连"]],
  [
    "gateway.occupied",
    [
      "{work} occupied the gateway's event loop for {seconds} s: everything else waited, also stops",
      "{work} 占用网关事件循环 {seconds} 秒：其间其他一切（包括停止）都在等待",
    ],
  ],
  [
    "link.deluge",
    ["{where} sends far too much data: all of it is discarded", "{where} 发送的数据远超上限：全部未采用"],
  ],
  ["link.other_joints", ["{where} sends {cause}", "{where} 发送的关节数不符：{cause}"]],
  ["joints.values", ["{count} joint values, the description has {joints}", "{count} 个关节值，而描述中有 {joints} 个"]],
  ["joints.no_number", ["no finite number for joint {name}", "关节 {name} 的值不是有限数"]],
  [
    "joints.far",
    [
      "joint {name} at {value}, far beyond its limits {lower} to {upper}",
      "关节 {name} 位于 {value}，远超其限位 {lower} 至 {upper}",
    ],
  ],
  [
    "joints.leap",
    [
      "joint {name} at {after} only {seconds} s after {before}: no drive is that fast",
      "关节 {name} 从 {before} 到 {after} 仅用 {seconds} 秒：任何驱动都达不到",
    ],
  ],
  ["link.just_ended", ["the connection has just ended", "连接刚刚断开"]],
  ["link.broke", ["the connection broke while it was written", "写入时连接中断"]],
  ["link.clogged", ["the controller does not read; connecting again", "控制器不读取数据；正在重连"]],
  ["stop.control_ended", ["dead-man: {cause}", "控制结束，自动停止：{cause}"]],
  [
    "stop.gateway_killed",
    [
      "dead-man: the gateway was killed while {holder} had control, and the robot still moves",
      "自动停止：{holder} 控制期间网关异常终止，机器人仍在运动",
    ],
  ],
  [
    "stop.link_lost",
    ["the link was lost during a motion of {holder}: {detail}", "{holder} 的运动期间连接中断：{detail}"],
  ],
  [
    "stop.went_local",
    ["the controller changed to local control during a motion of {holder}", "{holder} 的运动期间，控制器转为本地控制"],
  ],
  ["stop.fate_unknown", ["the fate of a motion is unknown: {cause}", "运动的结果未知：{cause}"]],
  [
    "stop.would_not_arrive",
    [
      "a stop could not be sent now, because its connection to the controller is missing: restore the connection that the event link.channel_lost names",
      "发送停止所需的连接已断开，此时无法停止机器人：请恢复事件 link.channel_lost 指出的连接",
    ],
  ],
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
  [
    "joints.axes_extra",
    [
      "axis {axes} of its controller belongs to no joint of the model: put it into the model, or name its number in other_axes of the site file if it neither carries nor moves the arm",
      "控制器的轴 {axes} 不属于模型的任何关节：请将其加入模型；若该轴既不承载也不移动机械臂，请将其编号写入站点文件的 other_axes",
    ],
  ],
  [
    "recover.unchanged",
    ["tool, payload and frame are as they were: there is nothing to confirm", "工具、负载和坐标系与原先相同，无需确认"],
  ],
  ["recover.confirmed", ["{by} has confirmed {changes}: {reason}", "{by} 已确认 {changes}：{reason}"]],
  [
    "check.tool_changed",
    [
      "tool, payload or frame were changed at the controller: {changes}: set them back there, or confirm that they are right",
      "控制器上的工具、负载或坐标系已更改：{changes}：请在控制器上改回，或确认其正确",
    ],
  ],
  [
    "joints.not_verified",
    [
      "its joints are unproven: they were never compared with the pose that its controller computes: run robomesh robot verify {robot} --out FILE, then set verified = FILE for this robot in the site file",
      "其关节未经核对：从未与控制器计算的位姿比较：请运行 robomesh robot verify {robot} --out FILE，再在站点文件中为此机器人写入 verified = FILE",
    ],
  ],
  [
    "joints.of_other_robot",
    [
      "its joints are unproven: the comparison was made with {other}: run robomesh robot verify {robot} --out FILE",
      "其关节未经核对：该次比较属于 {other}：请运行 robomesh robot verify {robot} --out FILE",
    ],
  ],
  [
    "joints.disagree",
    [
      "its joints are unproven: model and controller differ by the comparison of {time}: change the model or the site file as the comparison says, then make it again",
      "其关节未经核对：据 {time} 的比较，模型与控制器不一致：请按比较结果修改模型或站点文件，再重新比较",
    ],
  ],
  [
    "joints.other_model",
    [
      "its joints are unproven: the comparison of {time} was made with another model, or with other keys of the site file: run robomesh robot verify again",
      "其关节未经核对：{time} 的比较使用了另一模型或站点文件的其他设置：请重新运行 robomesh robot verify",
    ],
  ],
  [
    "joints.other_software",
    [
      "its joints are unproven: its controller's software is {now}, the comparison was made with {before}: run robomesh robot verify again",
      "其关节未经核对：控制器软件现为 {now}，而比较时为 {before}：请重新运行 robomesh robot verify",
    ],
  ],
  ["joints.invalid", ["its joints cannot be right ({cause})", "其关节值不可能正确（{cause}）"]],
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
  [
    "joints.beyond",
    ["joint {name} at {value}, limits {lower} to {upper}", "关节 {name} 为 {value}，限位 {lower} 至 {upper}"],
  ],
  [
    "joints.shape",
    [
      "joint positions of shape {shape}: this robot takes ({joints},), one value per joint",
      "关节位置的形状为 {shape}：此机器人应为 ({joints},)，每个关节一个值",
    ],
  ],
  ["joints.constraint", ["{terms} at {value} is beyond its limit {limit}", "{terms} 的 {value} 超出限位 {limit}"]],
  ["program.unreadable", ["{cause}", "{cause}"]],
  ["program.unreachable", ["{cause}", "{cause}"]],
  ["program.empty", ["the program has no statement that does anything", "程序中没有任何有作用的语句"]],
  ["program.bytes", ["the program has {count} bytes; up to {most} are read", "程序有 {count} 字节；最多读取 {most}"]],
  ["program.lines", ["the program has {count} lines; up to {most} are read", "程序有 {count} 行；最多读取 {most}"]],
  [
    "program.steps",
    ["the program has more than {most} steps here, including repeats", "程序到此处超过 {most} 步（含重复）"],
  ],
  [
    "program.steps_of_lines",
    [
      "the program has more than {most} steps here, including those that lines are cut into",
      "程序到此处超过 {most} 步（含直线的分段）",
    ],
  ],
  [
    "program.statement_near",
    ["'{word}' is not a statement; did you mean '{near}'?", "“{word}”不是语句；是否为“{near}”？"],
  ],
  ["program.statement_unknown", ["'{word}' is not a statement; there are {names}", "“{word}”不是语句；可用：{names}"]],
  [
    "program.point_form",
    [
      "write a definition as 'point NAME = joints ...' or 'point NAME = pose ...'",
      "请将定义写成“point NAME = joints ...”或“point NAME = pose ...”",
    ],
  ],
  [
    "program.point_name",
    [
      "'{name}' is not a valid point name: small letters, digits, _ and -, a letter first, up to {most}",
      "“{name}”不是有效的点名：须为小写字母、数字、_ 和 -，以字母开头，最多 {most} 个字符",
    ],
  ],
  [
    "program.point_reserved",
    ["'{name}' is a statement and not a valid point name: choose another", "“{name}”是语句，不能作为点名：请另选"],
  ],
  ["program.point_twice", ["point '{name}' is already defined in line {line}", "点“{name}”已在第 {line} 行定义"]],
  [
    "program.point_near",
    ["{word}: there is no point '{name}'; did you mean '{near}'?", "{word}：没有点“{name}”；是否为“{near}”？"],
  ],
  [
    "program.point_unknown",
    ["{word}: there is no point '{name}'; there are {names}", "{word}：没有点“{name}”；现有 {names}"],
  ],
  [
    "program.point_none",
    ["{word}: there is no point '{name}'; none is defined", "{word}：没有点“{name}”；尚未定义任何点"],
  ],
  [
    "program.frame_form",
    [
      "'move_line_by' needs tool, base or site first, not {given}: write for example 'move_line_by tool X Y Z ROLL PITCH YAW'",
      "“move_line_by”须写明坐标系，而不是 {given}：请写“move_line_by tool X Y Z ROLL PITCH YAW”，坐标系可为 tool、base 或 site",
    ],
  ],
  ["program.line_at_limit", ["joint {name} is at its limit there", "关节 {name} 在该处到达限位"]],
  [
    "program.line_ends",
    [
      "the arm reaches no farther on this line without another posture: move single joints",
      "机械臂不改变构型无法沿此直线继续：请移动单个关节",
    ],
  ],
  [
    "program.line_roll",
    [
      "with five joints, a straight line cannot set the roll about the tool's axis: move a joint instead",
      "五关节机械臂的直线运动不约束工具绕自身轴线的转角：请改为移动关节",
    ],
  ],
  ["program.trace_form", ["'trace' takes on or off, not {given}", "“trace”须为 on 或 off，而不是 {given}"]],
  ["program.repeat_not_closed", ["'repeat' has no 'end'", "“repeat”没有“end”"]],
  ["program.repeat_not_whole", ["'repeat' takes a whole number, not {given}", "“repeat”须为整数，而不是 {given}"]],
  ["program.repeat_too_deep", ["'repeat' is nested more than {most} deep", "“repeat”嵌套超过 {most} 层"]],
  ["program.end_without_repeat", ["'end' without an open 'repeat' above", "“end”之前没有未结束的“repeat”"]],
  ["program.not_a_number", ["'{word}': '{given}' is not a number", "“{word}”：“{given}”不是数字"]],
  [
    "program.joint_numbers",
    [
      "'{word}' takes {count} numbers ({names}: degrees, mm of a prismatic joint), not {given}",
      "“{word}”须有 {count} 个数（{names}：度，移动关节为 mm），而不是 {given} 个",
    ],
  ],
  [
    "program.pose_numbers",
    [
      "'{word}' takes {count} numbers ({names}: mm and degrees), not {given}",
      "“{word}”须有 {count} 个数（{names}：mm 和度），而不是 {given} 个",
    ],
  ],
  [
    "program.number_too_large",
    [
      "'{word}': {name} is {given}; must be between -{most} and {most}",
      "“{word}”：{name} 为 {given}；须在 -{most} 与 {most} 之间",
    ],
  ],
  [
    "program.one_number",
    ["'{word}' takes one number ({unit}), not {given}", "“{word}”须有一个数（{unit}），而不是 {given}"],
  ],
  [
    "program.number_outside",
    [
      "'{word}' is {given}; must be between {least} and {most} {unit}",
      "“{word}”为 {given}；须在 {least} 与 {most} {unit}之间",
    ],
  ],
  ["program.no_argument", ["'{word}' takes no argument, not '{given}'", "“{word}”不带参数，而不是“{given}”"]],
  ["program.point_unreachable", ["point {name} cannot be reached: {cause}", "点 {name} 无法到达：{cause}"]],
  [
    "program.pose_unreachable",
    ["the pose at {place} mm cannot be reached: {cause}", "位于 {place} mm 的位姿无法到达：{cause}"],
  ],
  ["program.line_not_followed", ["the line cannot be followed: {cause}", "无法沿直线运动：{cause}"]],
  [
    "program.line_not_followed_beyond",
    [
      "the line cannot be followed beyond {done_mm} of its {length_mm} mm: {cause}",
      "沿直线运动 {done_mm} mm 后无法继续（全长 {length_mm} mm）：{cause}",
    ],
  ],
  ["program.line_end", ["its end cannot be reached: {cause}", "其终点无法到达：{cause}"]],
  [
    "program.line_jump",
    [
      "the arm would have to jump to another posture there, with joint {name} moving most",
      "机械臂须在此处跳到另一姿态，其中关节 {name} 变化最大",
    ],
  ],
  ["program.line_away", ["the tool stays {distance_mm} mm away from it", "工具与它相距 {distance_mm} mm"]],
  [
    "program.line_bent",
    [
      "the arm cannot keep its tool's axis within {limit_deg}° of a uniform rotation there",
      "机械臂在此处无法使工具轴保持在均匀转动的 {limit_deg}° 以内",
    ],
  ],
  ["program.start_outside", ["at the start: {cause}", "起始位置：{cause}"]],
  ["program.line", ["line {line}: {cause}", "第 {line} 行：{cause}"]],
  ["program.too_long", ["a program has at most {kib} KiB", "程序不得超过 {kib} KiB"]],
  [
    "programs.name",
    [
      "'{name}' is not a valid name: use 1 to {most} letters, digits, spaces and signs except / \\ : * ? \" < > |, without a full stop at the begin or end",
      '“{name}”不是有效的名称：请使用 1 至 {most} 个字母、数字、空格及符号（不含 / \\ : * ? " < > |），首尾不得为句点',
    ],
  ],
  [
    "programs.name_taken",
    [
      "{robot} already has a program named '{name}': choose another name, or open it",
      "{robot} 已有名为“{name}”的程序：请换一个名称，或打开该程序",
    ],
  ],
  [
    "programs.robot",
    ["site {site} has no robot {robot}: check the name", "站点 {site} 没有机器人 {robot}：请检查名称"],
  ],
  [
    "programs.unknown",
    ["{robot} has no stored program {id}: list its programs", "{robot} 没有已存程序 {id}：请查看其程序列表"],
  ],
  [
    "programs.version",
    [
      "program '{name}' has no version {version}: choose one from 1 to {newest}",
      "程序“{name}”没有版本 {version}：请选择 1 至 {newest}",
    ],
  ],
  [
    "programs.text",
    [
      "no program of {robot} with SHA-256 {sha256} is stored: it was refused, or it is too old",
      "未存储 {robot} 的 SHA-256 为 {sha256} 的程序：它曾被拒绝，或已过旧",
    ],
  ],
  [
    "programs.changed",
    [
      "{author} has changed program '{name}' meanwhile: its version is {version} now: look at that version, then try again",
      "{author} 已在此期间更改程序“{name}”：现为版本 {version}：请先查看该版本，再重试",
    ],
  ],
  ["layouts.unknown", ["the site has no layout '{name}': look at the list", "站点没有布局“{name}”：请查看列表"]],
  [
    "layouts.name_taken",
    [
      "the site already has a layout '{name}', by {author}: choose another name, or replace it",
      "站点已有布局“{name}”（{author}）：请另选名称，或替换它",
    ],
  ],
  [
    "layouts.text",
    [
      "a layout is the part of an address after its '?', at most {most} characters without spaces",
      "布局是网址中“?”之后的部分，最多 {most} 个字符，不含空格",
    ],
  ],
  [
    "layouts.full",
    [
      "a site keeps at most {most} layouts and {most_kib} KiB of them: delete one that nobody needs",
      "站点最多保存 {most} 个布局，共 {most_kib} KiB：请删除无人使用的布局",
    ],
  ],
  [
    "layouts.damaged",
    [
      "the stored layouts cannot be read ({detail}): the damaged file is layouts.damaged; restore layouts.json from a backup and restart the store",
      "无法读取已保存的布局（{detail}）：损坏的文件是 layouts.damaged；请从备份恢复 layouts.json 并重启存储服务",
    ],
  ],
  ["note.written", ["{author} noted: {text}", "{author} 的备注：{text}"]],
  ["note.withdrawn", ["{by} withdrew the note of {author}: {text}", "{by} 撤回了 {author} 的备注：{text}"]],
  [
    "notes.text",
    ["a note has 1 to {most} characters: this one has {count}", "备注须为 1 至 {most} 个字符：此备注有 {count} 个"],
  ],
  [
    "notes.id",
    [
      "'{id}' cannot be the id of a note: use 8 to 64 letters, digits and '-'",
      "“{id}”不能用作备注的编号：请用 8 至 64 个字母、数字和“-”",
    ],
  ],
  [
    "notes.id_taken",
    ["{robot} already has another note {id}: choose another id", "{robot} 已有另一条备注 {id}：请换一个编号"],
  ],
  [
    "notes.range",
    ["the note ends {seconds} s before it begins: swap its times", "备注的结束比开始早 {seconds} 秒：请对调两个时间"],
  ],
  [
    "notes.future",
    [
      "the note is on a time {seconds} s in the future: choose a past time, or check the clocks of both machines",
      "备注的时间在 {seconds} 秒之后：请选择过去的时间，或检查两台机器的时钟",
    ],
  ],
  ["notes.unknown", ["{robot} has no note {id}: list its notes", "{robot} 没有备注 {id}：请查看其备注"]],
  [
    "notes.author",
    [
      "{author} wrote this note, so only {author} or an administrator may withdraw it",
      "此备注由 {author} 所写，只有 {author} 或管理员可以撤回",
    ],
  ],
  [
    "notes.full",
    [
      "the site's notes already take {most_mib} MiB, all that [programs] notes_mib allows: raise it in the site file",
      "站点的备注已占用 {most_mib} MiB，达到 [programs] notes_mib 的上限：请在站点文件中调高",
    ],
  ],
  [
    "notes.damaged",
    [
      "{count} lines of {file} cannot be read as notes: they stay in the file; restore it from a backup and restart the store",
      "{file} 中有 {count} 行不是可读的备注：它们保留在文件中；请从备份恢复并重启存储服务",
    ],
  ],
  [
    "page.needs_administrator",
    [
      "only the account of an administrator may do this, and this console has no accounts",
      "只有管理员账户可以这样做，而此控制台没有账户",
    ],
  ],
  ["programs.reason", ["a program is deleted only with a reason: write why", "删除程序必须说明原因：请填写"]],
  [
    "programs.not_text",
    ["the program contains a NUL character: choose a text file", "程序含有 NUL 字符：请选择文本文件"],
  ],
  [
    "programs.full",
    [
      "the site's programs already take {most_mib} MiB, all that [programs] most_mib allows: raise it in the site file",
      "站点的程序已占用 {most_mib} MiB，达到 [programs] most_mib 的上限：请在站点文件中调高",
    ],
  ],
  [
    "programs.too_many",
    [
      "{robot} already has {most} programs, the most that a robot may have, with deleted ones",
      "{robot} 已有 {most} 个程序（含已删除的），达到每个机器人的上限",
    ],
  ],
  [
    "programs.versions",
    [
      "program '{name}' already has {most} versions, the most that a program may have: save it under another name",
      "程序“{name}”已有 {most} 个版本，达到每个程序的上限：请以另一名称保存",
    ],
  ],
  [
    "programs.disk",
    [
      "the store cannot write to its disk, so nothing has changed: {detail}",
      "程序存储服务无法写入磁盘，因此未作任何更改：{detail}",
    ],
  ],
  [
    "programs.saved",
    ["{author} saved program '{name}', version {version}", "{author} 保存了程序“{name}”，版本 {version}"],
  ],
  [
    "programs.aside",
    [
      "{author} saved program '{name}' on an older version: kept as version {version}, not as the current one",
      "{author} 基于较旧的版本保存了程序“{name}”：保留为版本 {version}，不作为当前版本",
    ],
  ],
  ["programs.renamed", ["{author} renamed program '{old}' to '{name}'", "{author} 将程序“{old}”重命名为“{name}”"]],
  [
    "programs.restored",
    [
      "{author} restored version {from_version} of program '{name}' as version {version}",
      "{author} 将程序“{name}”的版本 {from_version} 恢复为版本 {version}",
    ],
  ],
  [
    "programs.deleted",
    [
      "{author} deleted program '{name}' ({reason}); it can be restored",
      "{author} 删除了程序“{name}”（{reason}）；可以恢复",
    ],
  ],
  [
    "cell.changes",
    [
      "{operator} is changing the cell of {robot}: no control and no motion until it is done: try again in a moment",
      "{operator} 正在更改 {robot} 所在的单元，完成之前不能控制也不能运动：请稍后再试",
    ],
  ],
  [
    "cell.disagrees",
    [
      "kinematics shows other fixtures or another floor for {robot} than motions are checked against: wait, or restart kinematics",
      "运动学服务所显示的 {robot} 的固定物或地面与运动检查所用的不同：请等待，或重启运动学服务",
    ],
  ],
  [
    "cell.not_followed",
    [
      "kinematics cannot show the cell of {robot}: {cause}: correct the cause, then restart kinematics",
      "运动学服务无法显示 {robot} 的单元：{cause}：请消除原因，然后重启运动学服务",
    ],
  ],
  [
    "cell.controlled",
    [
      "{holder} has control of {robot}: the cell can be changed when control is released",
      "{holder} 正在控制 {robot}：释放控制权后才能更改单元",
    ],
  ],
  [
    "cell.moves",
    [
      "{robot} moves: wait until every robot of the cell rests, or stop it",
      "{robot} 正在运动：请等待单元内所有机器人静止，或将其停止",
    ],
  ],
  [
    "cell.unknown",
    [
      "it is not known whether {robot} rests, because its controller reports no position: connect its controller first",
      "{robot} 的控制器没有报告位置，无法确定它是否静止：请先连接其控制器",
    ],
  ],
  [
    "cell.outdated",
    [
      "the cell of {robot} has changed meanwhile: load it again and repeat the change",
      "{robot} 的单元在此期间已被更改：请重新载入后再更改",
    ],
  ],
  ["cell.same", ["nothing would change in the cell of {robot}", "{robot} 的单元没有任何变化"]],
  [
    "cell.no_file",
    [
      "the gateway of {robot} runs without a site file in which a change could be saved: write one and start the site with it",
      "{robot} 的网关没有可以保存更改的站点文件：请编写一个站点文件并用它启动站点",
    ],
  ],
  [
    "cell.no_cell",
    [
      "{robot} has no cell, so it can have no fixture: give it a `cell` in the site file and restart the site's services",
      "{robot} 不属于任何单元，因此不能有固定物：请在站点文件中为它设置 `cell`，然后重启站点服务",
    ],
  ],
  [
    "cell.other_gateway",
    [
      "{robot} is of the same cell and has another gateway: one gateway must serve all robots of a cell that is changed",
      "{robot} 属于同一单元，但由另一个网关服务：要更改的单元内所有机器人必须由同一个网关服务",
    ],
  ],
  [
    "cell.read_only",
    [
      "the gateway may not write {file} or its folder: mount the folder writable, or change the file by hand and restart the site's services",
      "网关不能写入 {file} 或其文件夹：请将文件夹挂载为可写，或手动修改文件后重启站点服务",
    ],
  ],
  [
    "cell.file_changed",
    [
      "{file} was changed on disk after the gateway read it: restart the site's services, then repeat the change",
      "网关读取 {file} 之后，该文件在磁盘上已被修改：请重启站点服务，然后重新更改",
    ],
  ],
  [
    "cell.file_form",
    [
      "{file} writes this part in a form that cannot be changed without touching other lines: write fixtures as [[fixture]] and robots as [[robot]] tables, or change the file by hand",
      "{file} 中这一部分的写法使得更改必然触及其他行：请将固定物写成 [[fixture]] 表、将机器人写成 [[robot]] 表，或手动修改文件",
    ],
  ],
  ["cell.disk", ["{file} cannot be read or written: {detail}", "{file} 无法读取或写入：{detail}"]],
  ["cell.fixture", ["fixture '{name}': {detail}", "固定物“{name}”：{detail}"]],
  ["cell.content", ["{detail}", "{detail}"]],
  [
    "cell.too_many",
    [
      "a cell that is changed by request has at most {most} {what}, not {count}: combine some in one mesh, or edit the site file by hand and restart",
      "通过请求更改的单元最多有 {most} 个{what}，而不是 {count} 个：请将若干合并为一个网格，或手动修改站点文件并重启",
    ],
  ],
  [
    "cell.mesh",
    [
      "fixture '{name}': the site file names no mesh '{file}': a new mesh file is named in the site file first",
      "固定物“{name}”：站点文件中没有网格“{file}”：新的网格文件须先写入站点文件",
    ],
  ],
  [
    "cell.no_kinematics",
    [
      "the kinematics service of {robot} does not take the change, so nothing has changed: {cause}",
      "{robot} 的运动学服务不接受更改，没有任何更改：{cause}",
    ],
  ],
  [
    "cell.check_failed",
    [
      "motions cannot be checked against the changed cell, so nothing has changed: {cause}",
      "无法按更改后的单元进行检查，没有任何更改：{cause}",
    ],
  ],
  [
    "cell.taken_back",
    [
      "the change was taken back: the kinematics service of {robot} did not show it within {seconds} s: look whether that service runs, then try again",
      "更改已撤回：{robot} 的运动学服务未在 {seconds} 秒内显示它：请检查该服务是否在运行，然后再试",
    ],
  ],
  [
    "cell.stuck",
    [
      "the change failed ({cause}), and the old cell could not be restored: {detail}: restart the gateway and the kinematics service of {robot}",
      "更改失败（{cause}），且无法恢复旧单元：{detail}：请重启 {robot} 的网关和运动学服务",
    ],
  ],
  [
    "cell.changed",
    ["{operator} changed the cell of {robot}: {summary}", "{operator} 更改了 {robot} 的单元：{summary}"],
  ],
  ["cell.accepted", ["{summary}", "{summary}"]],
  ["cell.not_changed", ["the cell was not changed: {cause}", "单元未更改：{cause}"]],
  [
    "programs.damaged",
    [
      "a stored program cannot be read ({detail}): restore the file from a backup and restart the store",
      "一个已存程序无法读取（{detail}）：请从备份恢复该文件，然后重启程序存储服务",
    ],
  ],
  [
    "programs.run_lost",
    ["the text of program '{name}', which ran, is not kept: {detail}", "运行过的程序“{name}”的文本未能保留：{detail}"],
  ],
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
  ["program.control_ended", ["control ended: {cause}", "控制权已结束：{cause}"]],
  [
    "jog.missing",
    [
      "JOG without a direction: send `jog` with frame, axis and speed",
      "点动缺少方向：请在 `jog` 中给出坐标系、轴和速度",
    ],
  ],
  [
    "jog.frame",
    [
      "the frame of a jog is missing: choose TOOL, BASE, SITE or JOINT",
      "点动缺少坐标系：请选择 TOOL、BASE、SITE 或 JOINT",
    ],
  ],
  [
    "jog.axis",
    [
      "the axis of a jog is missing: choose X, Y, Z, ROLL, PITCH or YAW",
      "点动缺少轴：请选择 X、Y、Z、ROLL、PITCH 或 YAW",
    ],
  ],
  ["jog.joint", ["there is no joint {number}: choose 1 to {joints}", "没有关节 {number}：请选择 1 至 {joints}"]],
  [
    "jog.speed",
    [
      "the speed of a jog, {speed} {unit}, is 0 or outside ±{most} {unit}: choose another speed",
      "点动速度 {speed} {unit} 为 0 或超出 ±{most} {unit}：请选择其他速度",
    ],
  ],
  [
    "jog.forbidden",
    [
      "the site file forbids jogging this robot (jog_speed = 0): use steps",
      "站点文件禁止点动该机器人（jog_speed = 0）：请使用步进",
    ],
  ],
  [
    "jog.no_driver",
    [
      "this controller cannot be jogged: its driver does not say that a motion on hold can be cancelled: use steps",
      "该控制器不能点动：其驱动未声明可以取消已保持的运动：请使用步进",
    ],
  ],
  [
    "jog.no_state",
    [
      "this controller cannot be jogged: it does not report whether it moves or is on hold: use steps",
      "该控制器不能点动：它不报告是否在运动或保持：请使用步进",
    ],
  ],
  [
    "jog.too_fast",
    [
      "the controller's lowest speed, {percent} %, moves the tool at {tool_mm_s} mm/s here: choose a higher speed, or move single joints",
      "控制器的最低速度 {percent} % 在此处使工具以 {tool_mm_s} mm/s 运动：请选择更高速度，或移动单个关节",
    ],
  ],
  ["jog.runs", ["a jog runs: release it, and try again when the arm rests", "正在点动：请松开，待机械臂静止后重试"]],
  ["jog.unknown", ["no jog {id} runs", "没有正在进行的点动 {id}"]],
  [
    "jog.sequence",
    [
      "keep-alive {sequence} of the jog is not new: the last one was {last}: count up",
      "点动的保活信号 {sequence} 不是新的：上一个为 {last}：请递增",
    ],
  ],
  ["jog.released", ["released", "已松开"]],
  [
    "jog.not_alive",
    ["no keep-alive for {ms} ms: use a faster computer or network", "{ms} 毫秒内没有保活信号：请使用更快的电脑或网络"],
  ],
  ["jog.not_held_down", ["no keep-alive came: nothing has moved", "没有收到保活信号：未发生运动"]],
  ["jog.commanded", ["the operator commanded {names}", "操作员发出了命令 {names}"]],
  ["jog.not_moving", ["the robot does not move: check the controller", "机器人没有运动：请检查控制器"]],
  ["jog.failed", ["the gateway failed with an internal error: see its log", "网关执行点动时出错：详见其日志"]],
  ["jog.ended", ["jog {name} ended after {distance}: {cause}", "点动 {name} 在 {distance} 后结束：{cause}"]],
  [
    "stop.jog_not_held",
    ["the robot still moves {seconds} s after the hold of a jog", "点动保持 {seconds} 秒后机器人仍在运动"],
  ],
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
  ["check.starting", ["the check is still starting: it is ready in a few seconds", "检查仍在准备：几秒后就绪"]],
  ["check.broken", ["the check does not work: {cause}", "检查无法工作：{cause}"]],
  ["check.failed", ["the check failed: {cause}", "检查失败：{cause}"]],
  ["check.impossible", ["{cause}", "{cause}"]],
  [
    "check.nothing",
    ["its description has no link with a shape, so nothing can be checked", "其描述中没有任何连杆有形状，无法检查"],
  ],
  [
    "check.queued_too_long",
    ["the check waited longer than {seconds} s for other checks", "检查超过 {seconds} 秒：正在检查其他请求"],
  ],
  [
    "check.too_slow",
    [
      "the check takes longer than {seconds} s (the slowest of the last ones took {slowest} s): try again with a later not_after, or when the gateway's machine is less busy",
      "检查超过 {seconds} 秒（最近最慢的一次用了 {slowest} 秒）：请以更晚的 not_after 重试，或待网关所在的计算机不忙时重试",
    ],
  ],
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
  [
    "check.interpolation",
    [
      "joint moves: straight between the joint positions, all joints in phase, jerk-limited, from rest to rest; lines: joint moves that keep the tool within {line_mm} mm and {line_deg}° of the line, each from rest to rest; home: a joint move at half of the greatest speeds",
      "关节运动：在关节位置之间走直线，各关节同相，限制加加速度，由静止到静止；直线：由关节运动组成，工具偏离直线不超过 {line_mm} mm 和 {line_deg}°，每段由静止到静止；回零：以最大速度的一半作关节运动",
    ],
  ],
  [
    "check.note.no_shape",
    ["not checked for collisions, because they have no shape: {links}", "未作碰撞检查，因为没有形状：{links}"],
  ],
  [
    "check.note.pending",
    [
      "links whose hulls touch are not studied yet; until then they are checked as hulls",
      "凸包相接触的连杆尚未研究完；在此之前按凸包检查",
    ],
  ],
  ["check.note.left_out", ["{name} is left out: its position is unknown", "未计入 {name}：其位置未知"]],
  [
    "check.note.only_floor",
    [
      "only the floor around the arm: its cell has no fixture and no other robot",
      "机械臂周围只有地面：其单元没有固定物，也没有其他机器人",
    ],
  ],
  [
    "check.note.alone",
    [
      "no obstacle around the arm: its cell has no fixture, no floor and no other robot",
      "机械臂周围没有障碍物：其单元没有固定物、地面和其他机器人",
    ],
  ],
  ["check.note.more_violations", ["{count} more violations are not listed", "另有 {count} 处违反未列出"]],
  ["check.note.more_problems", ["{count} more problems are not listed", "另有 {count} 个问题未列出"]],
  [
    "check.note.ends",
    ["nothing after line {line} is checked: the program cannot get there", "第 {line} 行之后未检查：程序无法到达那里"],
  ],
  [
    "check.note.bent",
    [
      "line {lines}: between its ends the tool's axis is up to {angle_deg}° from a uniform rotation: this arm cannot follow it",
      "第 {lines} 行的两端之间，工具轴偏离均匀旋转最多 {angle_deg}°：此机械臂无法跟随",
    ],
  ],
  [
    "check.floor_advice",
    [
      "if the floor is lower than {height_mm} mm, write floor = {below_mm}.0 for the robot in the site file; if there is none, floor = false",
      "如果地面低于 {height_mm} mm，请在站点文件中为该机器人写入 floor = {below_mm}.0；如果没有地面，请写 floor = false",
    ],
  ],
  ["recording.killed", ["its recorder was killed: readable up to that point", "录制服务被强制结束：此前的部分可读"]],
  ["recording.disk_full", ["ended: no space left on the disk", "已结束：磁盘没有剩余空间"]],
  ["recording.disk_failed", ["ended: {detail}", "已结束：{detail}"]],
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
  [
    "check.limits_doubtful",
    [
      "limits of {name} are doubtful: {joints} ({detail}): state their limits and max_speed in robot.toml or the site file, or correct the URDF",
      "{name} 的关节限位可疑：{joints}（{detail}）：请在 robot.toml 或站点文件中写明其 limits 和 max_speed，或更正 URDF",
    ],
  ],
  ["audit.slow", ["the audit log's disk takes longer than {seconds} s", "审计日志所在磁盘超过 {seconds} 秒无响应"]],
  ["audit.not_writable", ["the audit log {file} cannot be written ({cause})", "审计日志 {file} 无法写入（{cause}）"]],
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
    ["the latch file {name} cannot be written ({cause})", "停止锁定文件 {name} 无法写入（{cause}）"],
  ],
  [
    "latch.not_allocated",
    ["the latch file {name} cannot be allocated ({cause})", "停止锁定文件 {name} 无法分配（{cause}）"],
  ],
  ["disk.full", ["{detail}: make space on its disk", "{detail}：请清理其磁盘空间"]],
  ["disk.fault", ["{detail}: check its disk", "{detail}：请检查其磁盘"]],
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
    "alarm.forgotten",
    [
      "the saved alarms cannot be read, so acknowledgements are lost: {detail}",
      "已保存的报警无法读取，确认记录已丢失：{detail}",
    ],
  ],
  [
    "alarm.not_saved",
    ["alarms cannot be saved; a restart would lose them: {detail}", "报警无法保存，重启后将丢失：{detail}"],
  ],
  [
    "gateway.silent",
    [
      "the gateway of {robot} has reported nothing for more than {seconds} s",
      "{robot} 的网关已超过 {seconds} 秒没有数据",
    ],
  ],
  [
    "controller.stopped_itself",
    ["the controller has stopped the arm by itself, or its drives are off", "控制器自行停止了机械臂，或其驱动已断电"],
  ],
  ["controller.fault_reported", ["the controller has a fault: {fault}", "控制器报告故障：{fault}"]],
  ["stop.latched_by", ["stop {id} is latched by {by}: no reason given", "停止 {id} 由 {by} 锁定，未说明原因"]],
  ["stop.latched_why", ['stop {id} is latched by {by}: reason "{reason}"', "停止 {id} 由 {by} 锁定，原因：{reason}"]],
  ["mesh.site_twice", ["the name of site {site} is used twice: {names}", "站点名称 {site} 被使用了两次：{names}"]],
  [
    "mesh.service_twice",
    ["robot {robot} has {count} {service} services: {names}", "机器人 {robot} 有 {count} 个 {service} 服务：{names}"],
  ],
  [
    "service.cannot_listen",
    [
      "{what} cannot listen on {address}: {detail}: it is tried again; end the program that uses the port, or choose another address",
      "{what} 无法监听 {address}：{detail}：将会重试；请结束占用该端口的程序，或选择其他地址",
    ],
  ],
  [
    "service.address_absent",
    [
      "{what} does not listen on {address} yet: this machine has no such address now: it is tried again; bring its network up",
      "{what} 尚未监听 {address}：本机现在没有该地址：将会重试；请启用其网络",
    ],
  ],
  ["service.problem", ["{name}: {cause}", "{name}：{cause}"]],
  ["service.missing", ["{name} has not started", "{name} 未启动"]],
  ["service.gone", ["{name} is gone", "{name} 已离线"]],
  [
    "service.silent",
    [
      "{name} is present but has reported nothing for more than {seconds} s",
      "{name} 在线，但已超过 {seconds} 秒没有报告",
    ],
  ],
  [
    "site.gone",
    ["site {other} is gone: {site} does not see any of its services", "站点 {other} 失联：{site} 看不到其任何服务"],
  ],
  [
    "clock.ahead",
    [
      "the clock of {host} is {seconds} s ahead of that of {watch} (the watch's)",
      "{host} 的时钟比 {watch}（监视服务所在）快 {seconds} 秒",
    ],
  ],
  [
    "clock.behind",
    [
      "the clock of {host} is {seconds} s behind that of {watch} (the watch's)",
      "{host} 的时钟比 {watch}（监视服务所在）慢 {seconds} 秒",
    ],
  ],
  ["mesh.versions", ["versions differ: {versions}", "版本不一致：{versions}"]],
  [
    "mesh.loss",
    [
      "{name} lost {percent} % of the messages for it within a minute",
      "{name} 在一分钟内丢失了发给它的 {percent} % 的消息",
    ],
  ],
  [
    "router.unlinked",
    [
      "{name} reaches {count} of the {wanted} routers that it should link to",
      "{name} 应连接 {wanted} 个路由器，目前只连接 {count} 个",
    ],
  ],
  ["certificate.expires", ["the certificate of {name} expires on {date} UTC", "{name} 的证书将于 {date}（UTC）到期"]],
  ["certificate.expired", ["the certificate of {name} expired on {date} UTC", "{name} 的证书已于 {date}（UTC）到期"]],
  [
    "inverse.task",
    [
      "task {task} is unknown: use POSE_6D or POSITION_AND_AXIS_5D",
      "task {task}：应为 POSE_6D 或 POSITION_AND_AXIS_5D",
    ],
  ],
  ["inverse.pose", ["{cause}", "{cause}"]],
  ["inverse.near", ["near: {cause}", "near（参考位置）：{cause}"]],
  ["inverse.limits", ["limits: found only with {cause}", "限位：只有超出限位的解：{cause}"]],
  [
    "inverse.too_far",
    [
      "out of reach: {distance} from the first joint; the tool reaches at most {reach}",
      "够不到：距第一关节 {distance}；工具最远到达 {reach}",
    ],
  ],
  [
    "inverse.gap",
    [
      "out of reach: within its limits the tool stays at least {distance} from this position",
      "够不到：在限位之内，工具与此位置至少相距 {distance}",
    ],
  ],
  [
    "inverse.orientation",
    [
      "not this orientation: at this position, the tool's orientation is at least {angle} off",
      "姿态不可达：在此位置，工具的姿态至少偏差 {angle}",
    ],
  ],
  [
    "inverse.axis",
    [
      "not this orientation: at this position, the tool's axis is at least {angle} off",
      "姿态不可达：在此位置，工具的轴至少偏差 {angle}",
    ],
  ],
  [
    "pose.not_numbers",
    [
      "the pose takes 16 numbers, 4 rows of 4, tool to base in metres",
      "位姿须为 16 个数，4 行 4 列，工具到基座，以米为单位",
    ],
  ],
  [
    "pose.size",
    ["the pose has {count} numbers; it must have 16, 4 rows of 4", "位姿有 {count} 个数；应为 16 个，4 行 4 列"],
  ],
  [
    "pose.shape",
    [
      "the pose has numbers of shape {shape}; it must have 16, 4 rows of 4",
      "位姿的形状为 {shape}；应为 16 个数，4 行 4 列",
    ],
  ],
  ["pose.not_finite", ["the pose holds {value}; every number must be finite", "位姿含有 {value}；每个数须为有限数值"]],
  ["pose.last_row", ["the pose has the last row {row}; it must be 0 0 0 1", "位姿的最后一行为 {row}；应为 0 0 0 1"]],
  [
    "pose.too_far",
    [
      "the pose is {distance_m} m away; it must be less than {limit_m} m",
      "位姿远在 {distance_m} m 处；应小于 {limit_m} m",
    ],
  ],
  [
    "pose.no_rotation",
    [
      "the pose has no rotation in its first 3 rows and columns: the rows must have length 1 and be at right angles, these have the lengths {lengths}",
      "位姿的前 3 行 3 列不是旋转：各行长度须为 1 且互相垂直，而其长度为 {lengths}",
    ],
  ],
  [
    "pose.mirrored",
    [
      "the pose is mirrored: the determinant of its first 3 rows and columns is -1; it must be 1",
      "位姿是镜像：前 3 行 3 列的行列式为 -1；应为 1",
    ],
  ],
  [
    "pose.near_not_finite",
    [
      "the pose was requested near {positions}, which has a number that is not finite",
      "所给的参考位置 {positions} 含有非有限数值",
    ],
  ],
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
  [
    "mesh.changed",
    [
      "{key} has SHA-256 {sha256}, not {wanted}, because the robot's description has changed: load the page again",
      "{key} 的 SHA-256 是 {sha256}，不是 {wanted}，因为机器人的描述已更改：请重新加载页面",
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
  ["recording.failed", ["{cause}", "{cause}"]],
  ["recording.unreadable", ["{cause}", "{cause}"]],
  [
    "recording.unknown",
    [
      "no recording '{name}' here: use a file name from recordings/list",
      "此处没有录制“{name}”：请使用 recordings/list 中的文件名",
    ],
  ],
  ["recording.file", ["{file}: cannot be read: {detail}", "{file}：无法读取：{detail}"]],
  ["recording.not_writable", ["{file}: cannot be written: {detail}", "{file}：无法写入：{detail}"]],
  [
    "recording.empty",
    ["{file} is empty: the disk was full, or the recorder was killed", "{file} 为空：磁盘已满，或录制服务被强行结束"],
  ],
  [
    "recording.cut",
    [
      "{file}: not a readable recording: it ends before its first message",
      "{file}：不是可读的录制：在第一条消息之前结束",
    ],
  ],
  [
    "recording.not_mcap",
    ["{file}: not an MCAP file: its first bytes are wrong", "{file}：不是 MCAP 文件：开头的字节不符"],
  ],
  ["recording.damaged", ["{file}: damaged near byte {byte}", "{file}：第 {byte} 字节附近损坏"]],
  ["recording.chunk", ["a chunk has {mib} MiB: the limit is {most} MiB", "一个数据块有 {mib} MiB：上限为 {most} MiB"]],
  ["recording.ends", ["{file}: it ends before byte {byte}", "{file}：在第 {byte} 字节之前结束"]],
  ["recording.no_byte", ["{file}: no byte {byte}: it has {total}", "{file}：没有第 {byte} 字节：共 {total} 字节"]],
  [
    "recording.no_attachment",
    ["{file} has no attachment '{name}': there are {attachments}", "{file} 没有附件“{name}”：现有 {attachments}"],
  ],
  [
    "recording.no_topic",
    ["{file} has no topic '{topic}': there are {topics}", "{file} 没有主题“{topic}”：现有 {topics}"],
  ],
  [
    "recording.no_value",
    ["{file} has no value '{name}': there are {topics}", "{file} 没有数值“{name}”：现有 {topics}"],
  ],
  ["recording.changed", ["{file} changed during the fetch: fetch it again", "{file} 在获取期间已更改：请重新获取"]],
  [
    "recording.not_found",
    ["no recording '{name}' on the mesh: there are {recordings}", "网络上没有录制“{name}”：现有 {recordings}"],
  ],
  [
    "recording.span",
    [
      "{file} is {seconds} s long, and the part is not within it, or ends before it begins: choose a begin and an end, in seconds since its start",
      "{file} 的所选部分不在其 {seconds} 秒之内：请选择自起点起的开始与结束秒数",
    ],
  ],
  [
    "recording.zip",
    [
      "a ZIP cannot have {count} recordings: choose 1 to {most}",
      "一个 ZIP 不能有 {count} 个录制：请选择 1 至 {most} 个",
    ],
  ],
  [
    "recording.video_long",
    [
      "the part is longer than {most} min: choose a shorter one, or use robomesh recordings export",
      "所选部分长于 {most} 分钟：请选择更短的部分，或使用 robomesh recordings export",
    ],
  ],
  [
    "recording.video_space",
    [
      "the console's machine has no {mib} MiB free for the video: make room there",
      "控制台所在机器没有 {mib} MiB 可用空间来生成视频：请在那里腾出空间",
    ],
  ],
  [
    "recording.video_busy",
    ["{count} videos are being made or wait already: try again later", "已有 {count} 个视频正在生成或等待：请稍后再试"],
  ],
  [
    "recording.video_gone",
    [
      "this video is no longer kept (at most {minutes} min): render it again",
      "该视频已不再保留（最多 {minutes} 分钟）：请重新生成",
    ],
  ],
  [
    "recording.ambiguous",
    ["several recordings have the name '{name}': name the file: {files}", "多个录制名为“{name}”：请指定文件：{files}"],
  ],
  [
    "recording.too_many_values",
    ["{count} values are too many: request at most {most}", "{count} 个数值过多：最多请求 {most} 个"],
  ],
  [
    "recording.too_long",
    [
      "the range is too long to read at once: request at most {hours} h, with start and end",
      "时间范围过长，无法一次读取机器人的数值：请给出开始和结束时间，最长 {hours} 小时",
    ],
  ],
  ["recording.times", ["the range ends before it begins", "时间范围的结束早于开始"]],
  [
    "recording.outside",
    [
      "{file}: nothing from {start} to {end}: it goes from {first} to {last}",
      "{file}：{start} 至 {end} 没有数据：录制从 {first} 到 {last}",
    ],
  ],
  [
    "recording.several_robots",
    [
      "{file} is merged from recordings of several robots: {robots}: use the recording of one of them",
      "{file} 由多台机器人的录制合并而成：{robots}：请使用其中一台的录制",
    ],
  ],
  ["recording.no_joints", ["{file} contains no joint states", "{file}：其中没有关节记录"]],
  ["recording.range", ["{range}: {file} has {bytes} bytes", "{range}：{file} 有 {bytes} 字节"]],
  [
    "recording.too_many_downloads",
    ["{count} recordings are being sent already: try again soon", "已有 {count} 个录制正在发送：请稍后重试"],
  ],
  [
    "recording.title",
    [
      "'{name}' is not a valid name of a recording: use 1 to {most} letters, digits, spaces and signs except / \\ : * ? \" < > |, without a full stop at the begin or end",
      '“{name}”不是有效的录制名称：请使用 1 至 {most} 个字母、数字、空格或符号，不能含 / \\ : * ? " < > |，且首尾不能是句点',
    ],
  ],
  ["recording.note", ["the note has {count} characters: use at most {most}", "备注有 {count} 个字符：最多 {most} 个"]],
  [
    "recording.tag",
    [
      "'{tag}' is not a valid tag: use 1 to {most} letters, digits and signs except commas",
      "“{tag}”不是有效的标签：请使用 1 至 {most} 个字母、数字或符号，不能含逗号",
    ],
  ],
  ["recording.tags", ["{count} tags are too many: use at most {most}", "{count} 个标签过多：最多 {most} 个"]],
  ["recording.reason", ["a recording is deleted only with a reason: write why", "删除录制必须说明原因：请填写"]],
  [
    "recording.conflict",
    [
      "{author} has changed '{name}' meanwhile: look at its name, note and tags, then try again",
      "{author} 在此期间更改了“{name}”：请查看其名称、备注和标签后再试",
    ],
  ],
  [
    "recording.changes",
    ["'{name}' was already changed {most} times, the most possible", "“{name}”已更改 {most} 次，达到上限"],
  ],
  [
    "recording.labels_damaged",
    [
      "name, note and tags of a recording cannot be read ({detail}): the damaged file ends with .changes.damaged; restore the .changes.json from a backup",
      "无法读取某个录制的名称、备注和标签（{detail}）：损坏的文件以 .changes.damaged 结尾；请从备份恢复 .changes.json",
    ],
  ],
  [
    "recording.disk",
    [
      "the recorder cannot write to its disk, so nothing has changed: {detail}",
      "录制服务无法写入磁盘，因此未作任何更改：{detail}",
    ],
  ],
  ["recording.written", ["'{name}' is still being recorded: stop it first", "“{name}”仍在录制：请先停止"]],
  ["recording.indexed", ["'{name}' is being indexed: try again soon", "“{name}”正在建立索引：请稍后再试"]],
  [
    "recording.played",
    [
      "'{name}' is being played, or opened by another robomesh program: close it there first",
      "“{name}”正在播放，或已被另一 robomesh 程序打开：请先在那里关闭",
    ],
  ],
  [
    "recording.fetched",
    [
      "{who} is downloading '{name}': wait for the end, or try again in {seconds} s",
      "{who} 正在下载“{name}”：请等待完成，或 {seconds} 秒后再试",
    ],
  ],
  ["recording.renamed", ["{author} renamed recording '{old}' to '{name}'", "{author} 将录制“{old}”重命名为“{name}”"]],
  ["recording.noted", ["{author} changed the note of recording '{name}'", "{author} 更改了录制“{name}”的备注"]],
  ["recording.tagged", ["{author} tagged recording '{name}': {tags}", "{author} 为录制“{name}”设置标签：{tags}"]],
  ["recording.untagged", ["{author} removed all tags of recording '{name}'", "{author} 删除了录制“{name}”的所有标签"]],
  [
    "recording.deleted",
    [
      "{author} deleted recording '{name}' ({reason}): {file}, {bytes} bytes, SHA-256 {sha256}",
      "{author} 删除了录制“{name}”（{reason}）：{file}，{bytes} 字节，SHA-256 {sha256}",
    ],
  ],
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
  ["view.no_room", ["no capacity: {cause}", "没有余量：{cause}"]],
  [
    "view.too_many",
    [
      "{count} requested views exist, and {most} are possible (most_views in the site file's [renderer]): retry when some of them have ended",
      "已有 {count} 个请求的视图，最多 {most} 个（站点文件 [renderer] 的 most_views）：请在其中一些结束后再试",
    ],
  ],
  [
    "view.too_costly_now",
    [
      "{width} x {height} at {fps} a second counts for {megapixels} million pixels a second: {left_megapixels} of {most_megapixels} million are left for requested views; request a smaller or slower one",
      "{width} x {height}、每秒 {fps} 帧相当于每秒 {megapixels} 百万像素：请求的视图还剩 {left_megapixels}，共 {most_megapixels} 百万；请求更小或更慢的视图",
    ],
  ],
  ["view.invalid", ["{cause}", "{cause}"]],
  [
    "view.too_costly",
    [
      "{width} x {height} at {fps} a second counts for {megapixels} million pixels a second: requested views may have {most_megapixels} million together; {possible} a second is possible, more with a larger size, fps or most_views in the site file's [renderer]",
      "{width} x {height}、每秒 {fps} 帧相当于每秒 {megapixels} 百万像素：请求的视图合计最多 {most_megapixels} 百万；每秒可有 {possible} 帧，在站点文件 [renderer] 中增大 size、fps 或 most_views 可更多",
    ],
  ],
  [
    "view.or_of",
    [
      "a view request needs either `view`, a camera, or `of`, a view's name",
      "视图请求须有 `view`（相机）或 `of`（视图名称）之一",
    ],
  ],
  [
    "view.size",
    [
      "size {width} x {height}: must be even numbers from {least} to {most}, with at most as many pixels as 1920 x 1080",
      "尺寸 {width} x {height}：须为 {least} 至 {most} 的偶数，像素总数不超过 1920 x 1080",
    ],
  ],
  [
    "view.value",
    [
      "{field} {value}: must be from {least} to {most}, or 0 for the default",
      "{field} {value}：须在 {least} 至 {most} 之间，0 为默认值",
    ],
  ],
  [
    "view.ghost",
    [
      "the ghost has {count} joint positions: the robot has {joints} joints",
      "虚影有 {count} 个关节位置：机器人有 {joints} 个关节",
    ],
  ],
  ["view.path", ["the path has {count} points: at most {most} are drawn", "路径有 {count} 个点：最多绘制 {most} 个"]],
  ["view.not_finite", ["the ghost or path has a number that is not finite", "虚影或路径含有非有限数值"]],
  [
    "camera.no_direction",
    [
      "eye and target are both at ({place}) m: they must be different points",
      "eye 与 target 都位于 ({place}) m：须为不同的点",
    ],
  ],
  [
    "camera.height",
    ["height {value} m: must be from {least} to {most}", "height {value} m：须在 {least} 至 {most} 之间"],
  ],
  [
    "camera.angle",
    [
      "field_of_view {value} rad: must be from {least} to {most} ({least_deg}° to {most_deg}°)",
      "field_of_view {value} rad：须在 {least} 至 {most} 之间（{least_deg}° 至 {most_deg}°）",
    ],
  ],
  [
    "camera.mount",
    [
      "mount '{mount}' is not a link or frame of the robot; use {names}",
      "mount“{mount}”不是机器人的连杆或坐标系；可用 {names}",
    ],
  ],
  [
    "camera.vector",
    [
      "{field} ({numbers}): numbers must be from -{most} to {most}",
      "{field} ({numbers})：各数须在 -{most} 至 {most} 之间",
    ],
  ],
  ["view.no_answer", ["the answer to {key}/views contains no view", "{key}/views 的应答中没有视图"]],
  [
    "view.no_renderer",
    [
      "no renderer answers for {robot}: check that its name is right and that its renderer runs",
      "{robot} 没有渲染服务应答：请检查其名称是否正确、渲染服务是否运行",
    ],
  ],
  ["view.no_picture", ["no picture of {view} arrived within {seconds} s", "{seconds} 秒内没有收到 {view} 的画面"]],
  ["view.not_a_picture", ["{key} is not a picture", "{key} 不是图像"]],
  ["view.picture_unreadable", ["the newest picture cannot be read: {detail}", "无法读取最新画面：{detail}"]],
  [
    "view.no_png",
    ["this console has no PyAV to make PNG: request .jpg instead", "此控制台没有 PyAV，无法生成 PNG：请改用 .jpg"],
  ],
  [
    "view.parameter",
    ["the parameter '{name}' is unknown: use width, height and fps", "未知参数“{name}”：请用 width、height 和 fps"],
  ],
  ["view.not_a_number", ["{name}='{value}' is not a number", "{name}=“{value}”不是数字"]],
  ["view.not_pixels", ["{name}='{value}' is not a number of pixels", "{name}=“{value}”不是像素数"]],
  [
    "view.too_many_stills",
    ["{count} stills are being made: try again in a moment", "正在生成 {count} 张静止画面：请稍后重试"],
  ],
  [
    "view.too_many_streams",
    ["{count} video streams are open already: close one first", "已打开 {count} 个视频流：请先关闭一个"],
  ],
  [
    "view.too_many_streams_of",
    [
      "{address} has {count} open video streams already: close one first",
      "{address} 已打开 {count} 个视频流：请先关闭一个",
    ],
  ],
  ["define.unreadable", ["{detail}", "{detail}"]],
  ["define.no_robot", ["there is no robot '{name}' here", "此处没有机器人“{name}”"]],
  ["define.model_gone", ["this mesh is no longer stored: load the page again", "该网格已不再保存：请重新加载页面"]],
  [
    "define.file_gone",
    ["{files}: no longer stored: drop the files on the page again", "{files}：已不再保存：请重新拖入文件"],
  ],
  [
    "define.path",
    [
      "'{path}' is not the path of a robot's file: use a path below the robot's folder, like meshes/base.wrl",
      "“{path}”不是机器人文件的路径：请用机器人文件夹下的路径，例如 meshes/base.wrl",
    ],
  ],
  ["define.path_too_long", ["'{path}' is too long for a file name", "“{path}”作为文件名太长"]],
  ["define.files", ["`files` must give each path the SHA-256 of its file", "`files` 应为每个路径给出其文件的 SHA-256"]],
  ["define.file_not_given", ["'{file}' is not one of the given files", "“{file}”不在给出的文件中"]],
  ["define.file_is_folder", ["a file's name is another file's folder", "一个文件的名称是另一个文件的文件夹"]],
  ["define.file_too_large", ["the file is larger than {megabytes} MB", "文件超过 {megabytes} MB"]],
  ["define.too_many_files", ["{count} files: at most {most} are possible", "{count} 个文件：最多 {most} 个"]],
  [
    "define.files_too_large",
    [
      "{count} files of {megabytes} MB: at most {most} MB are possible",
      "{count} 个文件共 {megabytes} MB：最多 {most} MB",
    ],
  ],
  [
    "define.uploads",
    ["{count} files are being sent already: try again in a moment", "已有 {count} 个文件正在上传：请稍后重试"],
  ],
  ["define.not_zip", ["the file is not a readable zip archive: {detail}", "文件不是可读取的 zip 压缩包：{detail}"]],
  [
    "define.zip_too_large",
    [
      "the archive contains {count} files of {megabytes} MB: at most {most} files and {most_megabytes} MB are possible",
      "压缩包含 {count} 个文件，共 {megabytes} MB：最多 {most} 个文件、{most_megabytes} MB",
    ],
  ],
  ["define.not_urdf", ["{file} is not a robot's URDF", "{file} 不是机器人的 URDF"]],
  [
    "define.joints",
    [
      "`joints` must have one finite number for each joint, {count} in total",
      "`joints` 应为每个关节给出一个有限数值，共 {count} 个",
    ],
  ],
  [
    "define.problems",
    [
      "the robot is not saved, because its description has problems ({count}): correct them first",
      "机器人未保存，因为其描述有问题（{count}）：请先更正",
    ],
  ],
  ["define.exists", ["there is a robot {name} in {folder} already", "{folder} 中已有机器人 {name}"]],
  [
    "define.changed",
    [
      "{name} in {folder} was changed after it was opened: a save over it loses these changes",
      "{folder} 中的 {name} 在打开后已被更改：覆盖将丢失这些更改",
    ],
  ],
  ["define.too_slow", ["this took more than {seconds} s and was stopped", "此操作超过 {seconds} 秒，已停止"]],
  [
    "define.crashed",
    [
      "this crashed the worker process twice: it may be damaged, or need too much memory ({detail})",
      "此操作使工作进程两次崩溃：文件可能已损坏，或需要过多内存（{detail}）",
    ],
  ],
  ["define.memory", ["reading it takes more than {gigabytes} GB of memory", "读取需要超过 {gigabytes} GB 内存"]],
  ["define.nested", ["it is nested too deeply to read", "嵌套太深，无法读取"]],
  ["define.disk", ["the console cannot write to its disk: {detail}", "控制台无法写入磁盘：{detail}"]],
  [
    "define.site_has",
    [
      "the site {site} has a robot {name} already: save yours under another name",
      "站点 {site} 已有机器人 {name}：请用另一名称保存",
    ],
  ],
  [
    "define.no_supervisor",
    [
      'no supervisor runs here (robomesh up). Add this to the site file and restart the site\'s services:\n\n[[robot]]\nname = "{name}"\nmodel = "{model}"\ncontroller = "simulated"',
      '此处没有运行监管进程（robomesh up）。请将以下内容加入站点文件并重启站点的服务：\n\n[[robot]]\nname = "{name}"\nmodel = "{model}"\ncontroller = "simulated"',
    ],
  ],
  ["define.runs", ["{name} runs already: it restarts whenever it is saved", "{name} 已在运行：每次保存后自动重启"]],
  ["define.in_site_file", ["{name} is in the site file: remove it there", "{name} 在站点文件中：请在那里删除"]],
  ["define.not_started", ["{name} was not started from the page", "{name} 不是从本页启动的"]],
  [
    "define.started_unreadable",
    [
      "the list of started robots is invalid ({detail}): repair or remove it",
      "已启动机器人的列表无效（{detail}）：请修复或删除",
    ],
  ],
] as const);

const OF_KINDS: ReadonlySet<string> = new Set(SENTENCES_OF_KINDS.map(([code]) => code));

/** Return whether only one kind of controllers has a code. */
export const isOfKind = (code: string): boolean => OF_KINDS.has(code);

/** Chinese for parameters that are words of a program. */
const WORDS: Readonly<Record<string, string>> = {
  "act:publish": "发布",
  "act:read": "读取",
  "act:answer": "应答",
  "act:ask": "请求",
  "what:name": "名称",
  "what:site": "站点",
  "what:robot": "机器人",
  "what:fixture": "固定物",
  "what:fixtures": "固定物",
  "what:ignored links": "忽略的连杆",
  "what:account": "账户",
  "what:operator": "操作员",
  "what:view": "视图",
  "what:mesh": "网格",
  "what:service": "服务",
  "what:chunk": "键的一段",
  "what:id": "标识",
  "given:nothing": "空",
  "unit:percent": "%",
  "unit:seconds": "秒",
  "unit:times": "次",
};

/** A reason's sentence in the page's language; `text` where this page does not know the code. */
export function reasonText(reason: Reason | undefined, text = reason?.text ?? ""): string {
  return (reason && sentence(reason)) ?? text;
}

/** Reasons as one text; `text` where there are none. */
export function reasonsText(reasons: readonly Reason[] = [], text = ""): string {
  return reasons.length > 0 ? reasons.map((reason) => reasonText(reason)).join(t("list_separator")) : text;
}

const STOPPED = "program.stopped";
const STOPPED_WITHOUT_REASON = ["stopped by {by}", "由 {by} 停止"] as const;

/** Undefined: the code is unknown, or a parameter did not fit into the answer. */
function sentence({ code, values, causes }: Reason): string | undefined {
  const pair = code === STOPPED && !isSaid(values.reason) ? STOPPED_WITHOUT_REASON : SENTENCES.get(code);
  if (!pair) return undefined;
  const known = causes.map((cause) => reasonText(cause));
  const shown = Object.fromEntries(Object.entries(values).map(([name, value]) => [name, word(name, value)]));
  const all = known.length > 0 && known.every(Boolean) ? { ...shown, cause: known.join(t("list_separator")) } : shown;
  const names = [...pair[0].matchAll(/\{(\w+)\}/g)].map((found) => found[1] ?? "");
  return names.every((name) => all[name]) ? inLanguage(pair, all) : undefined;
}

const NEGATIVE = /^-(?=\d+(\.\d+)?( ?(°|%|mm|m|rad|s))?$)/;

/** Return a parameter in the page's language; a number has the page's minus sign. */
const word = (name: string, value: string): string =>
  (language.value === "zh" && WORDS[`${name}:${value}`]) || value.replace(NEGATIVE, "−");
