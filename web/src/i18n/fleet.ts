// Texts of Fleet, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

export const FLEET_TEXTS = {
  every_site: ["All sites", "所有站点"],
  site: ["Site", "站点"],
  state_counts: ["Robots by state", "各状态机器人数"],
  state: ["State", "状态"],
  any_state: ["All states", "所有状态"],
  needs_look: ["Needs a look", "需要关注"],
  faulty: ["Faults and stops", "故障与停止"],
  with_alarm: ["With alarms", "有报警"],
  sort: ["Order", "排序"],
  by_name: ["By name", "按名称"],
  by_urgency: ["Most urgent first", "最紧急优先"],
  no_match: [
    "No robot matches the filter. {count} are on the mesh.",
    "没有机器人符合筛选条件，网络上共有 {count} 台。",
  ],
  clear: ["Clear the filter", "清除筛选"],
  robots: ["{count} robots", "{count} 台机器人"],
  robot_one: ["1 robot", "1 台机器人"],
  services_all: ["{count} services", "{count} 项服务"],
  service_silent: ["{name} silent for {age}", "{name} 已 {age} 无数据"],
  services_silent: ["{count} services silent", "{count} 项服务无数据"],
  clock_off: ["clock of {host} off by {seconds} s", "{host} 时钟偏差 {seconds} s"],
  versions_differ: ["versions differ: {versions}", "版本不一致：{versions}"],
  health_stale: ["site's health: stale {age}", "站点状态：过期 {age}"],
  far: ["over the slow link", "经慢速链路"],
  loading: ["Loading…", "正在加载…"],
  far_hint: [
    "Another site than this console's: its picture comes over the slow link.",
    "不在本控制台所在站点：图像经慢速链路传输。",
  ],
  alarm_count: ["{count} alarms", "{count} 条报警"],
} as const;

export type FleetTextName = keyof typeof FLEET_TEXTS;

/** Return a text in the page's language. */
export function f(name: FleetTextName, values: Record<string, string | number> = {}): string {
  return inLanguage(FLEET_TEXTS[name], values);
}
