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
  not_signed_in: ["Not signed in: {text}", "未登录：{text}"],
  unreachable: ["the console does not answer: try again", "控制台无响应：请重试"],
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

  account: ["Account", "账户"],
  menu: ["Account: {account}, {role}", "账户：{account}，{role}"],
  role_monitor: ["monitor", "监视"],
  role_operator: ["operator", "操作员"],
  role_engineer: ["engineer", "工程师"],
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
  changing: ["Changing…", "正在更改…"],
  cancel: ["Cancel", "取消"],
  close: ["Close", "关闭"],

  monitor_only: [
    "{account} is a monitor’s account: it watches, and asks for no control. A stop request works all the same.",
    "{account} 是监视账户：只能监视，不能请求控制权，但可请求停止。",
  ],
  unlock_says: [
    "The right to command rests: nobody touched this page for half an hour, or the last password is twelve hours old. Give the password again to take control.",
    "控制权限已暂停：本页半小时无人操作，或上次输入密码已过十二小时。再次输入密码即可请求控制权。",
  ],
  unlocking: ["Checking the password…", "正在验证密码…"],
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

export function roleText(role: string): string {
  return `role_${role}` in TEXTS ? a(`role_${role}` as AccountText) : role;
}
