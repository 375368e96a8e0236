// Texts of sign-in and accounts, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  sign_in: ["Sign in", "登录"],
  signing_in: ["Signing in…", "正在登录…"],
  to_site: ["Console of {site}", "{site} 的控制台"],
  name: ["Account", "账户"],
  password: ["Password", "密码"],
  show: ["Show", "显示"],
  hide: ["Hide", "隐藏"],
  wrong: ["The account or the password is wrong.", "账户或密码错误。"],
  wait: ["Too many tries. Again in {seconds} s.", "尝试次数过多，请在 {seconds} 秒后重试。"],
  busy: ["Many sign in at this moment. Try again.", "当前登录人数较多，请重试。"],
  unreachable: ["The console does not answer. Try again.", "控制台无响应，请重试。"],
  caps: ["Caps Lock is on.", "大写锁定已开启。"],
  forgotten: ["Forgotten? An administrator gives a new password.", "忘记密码？请管理员重设。"],
  no_stop: [
    "Stop requests from this page need a sign-in. Until then use the stop at the robot.",
    "登录后才能从本页请求停止。在此之前请使用机器人旁的停止按钮。",
  ],
  secure: ["Encrypted connection (TLS)", "连接已加密（TLS）"],
  this_machine: ["This machine only, not encrypted", "仅本机访问，未加密"],
  insecure: [
    "Not encrypted: others on the network can read the password. Do not use one that matters elsewhere.",
    "未加密：网络上的他人可读取密码。请勿使用在别处重要的密码。",
  ],
  insecure_signed_in: [
    "Insecure: what this page shows and sends is not encrypted.",
    "不安全：本页显示和发送的内容未加密。",
  ],

  out_signed_out: ["You have signed out.", "您已登出。"],
  out_expired: ["Signed out: a session lasts a week at most.", "已登出：会话最长一周。"],
  out_idle: ["Signed out: no page was open for an hour.", "已登出：一小时内没有打开的页面。"],
  out_disabled: ["Signed out: this account was disabled.", "已登出：该账户已停用。"],
  out_removed: ["Signed out: this account was removed.", "已登出：该账户已删除。"],
  out_password: ["Signed out: the password was changed.", "已登出：密码已更改。"],
  out_ended: ["Signed out by an administrator.", "已被管理员登出。"],
  out_replaced: ["Signed out here: this browser has signed in anew.", "已登出：此浏览器已重新登录。"],
  out_too_many: ["Signed out: the account is signed in at too many places.", "已登出：该账户登录的地点过多。"],
  out_restart: ["Signed out: the console was started anew.", "已登出：控制台已重新启动。"],
  out_nothing_live: [
    "What the page showed is gone, because nothing of it would be live.",
    "页面内容已清除，因为其中不再有实时数据。",
  ],

  menu: ["Account: {account}, {role}", "账户：{account}，{role}"],
  role_monitor: ["monitor", "监视"],
  role_operator: ["operator", "操作员"],
  role_admin: ["administrator", "管理员"],
  may_watch: ["Watches: asks for no control. Stop requests work.", "仅监视：不能请求控制权，可请求停止。"],
  may_command: ["May ask for control, as {operator}.", "可请求控制权，操作名 {operator}。"],
  rests: ["Watches until the password is given again.", "再次输入密码前仅监视。"],
  change_password: ["Change password", "更改密码"],
  sign_out: ["Sign out", "登出"],
  sign_out_everywhere: ["Sign out everywhere", "在所有地点登出"],
  settings: ["Settings", "设置"],

  old_password: ["Present password", "当前密码"],
  new_password: ["New password", "新密码"],
  new_again: ["New password again", "再次输入新密码"],
  new_hint: ["10 characters at least; a few words are good.", "至少 10 个字符，几个词语即可。"],
  differ: ["These are two different passwords.", "两次输入的密码不同。"],
  changed: ["Changed. Other places where you were signed in are signed out.", "已更改。其他登录地点均已登出。"],
  not_changed: ["Not changed: {text}", "未更改：{text}"],
  change: ["Change", "更改"],
  cancel: ["Cancel", "取消"],
  close: ["Close", "关闭"],

  refused_short: [
    "The password is too short: 10 characters at least, a few words are good.",
    "密码太短：至少 10 个字符，几个词语即可。",
  ],
  refused_long: ["The password is too long: 256 bytes at most.", "密码太长：最多 256 字节。"],
  refused_control: ["The password holds a control character: leave it out.", "密码含有控制字符，请去掉。"],
  refused_repeats: [
    "The password repeats a few characters: a few words are good.",
    "密码只重复少数几个字符：请用几个词语。",
  ],
  refused_run: ["The password is a run of neighbours: a few words are good.", "密码是连续或相邻的字符：请用几个词语。"],
  refused_common: [
    "The password is one that is tried first: a common word or a name, and digits. A few words are good.",
    "密码最容易被猜到（常用词或名称加数字）：请用几个词语。",
  ],
  refused_name: [
    "That cannot be an account’s name: small letters, digits, _ and -, beginning with a letter or digit, 32 at most.",
    "账户名不可用：请用小写字母、数字、_ 和 -，以字母或数字开头，最多 32 个字符。",
  ],
  refused_taken: ["There is an account of that name already.", "已有同名账户。"],
  refused_no_account: ["There is no such account any more.", "该账户已不存在。"],
  refused_last_admin: [
    "That is the last administrator who can sign in: make another one first.",
    "这是最后一个可登录的管理员：请先添加另一个。",
  ],
  refused_not_admin: ["Only an administrator may do that.", "只有管理员可以这样做。"],
  refused_resting: ["Give your password again first.", "请先再次输入密码。"],
  refused_sign_in: ["Sign in first.", "请先登录。"],
  refused_no_session: ["That session is over already.", "该会话已结束。"],

  monitor_only: [
    "{account} is a monitor’s account: it watches, and asks for no control. A stop request works all the same.",
    "{account} 是监视账户：只能监视，不能请求控制权，但可请求停止。",
  ],
  unlock_says: [
    "The right to command rests: nobody touched this page for half an hour, or the last password is twelve hours old. Give the password again to take control.",
    "控制权限已暂停：本页半小时无人操作，或上次输入密码已过十二小时。再次输入密码即可请求控制权。",
  ],
  unlock: ["Give the right back", "恢复权限"],
} as const satisfies Record<string, readonly [string, string]>;

export type AccountText = keyof typeof TEXTS;

export function a(name: AccountText, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}

/** Explain the end of a session by the server's code. */
export function endText(word: string): string {
  return `out_${word}` in TEXTS ? a(`out_${word}` as AccountText) : a("out_signed_out");
}

/** Explain a refusal by the server's code; empty: no text for it. */
export function refusedText(word: string): string {
  return `refused_${word}` in TEXTS ? a(`refused_${word}` as AccountText) : "";
}

export function roleText(role: string): string {
  return `role_${role}` in TEXTS ? a(`role_${role}` as AccountText) : role;
}
