// Texts of the wall, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  pictures: ["{count} pictures", "{count} 个画面"],
  picture: ["1 picture", "1 个画面"],
  choose: ["Choose pictures", "选择画面"],
  done: ["Done", "完成"],
  every: ["Of every robot:", "所有机器人："],
  nothing: ["Nothing", "清空"],
  chosen_kept: ["What is chosen stands in the address: keep it as a bookmark.", "所选画面保存在网址中，可加入书签。"],
  no_robots: [
    "No robot is on the mesh yet. Pictures appear here as soon as a gateway joins.",
    "网络上还没有机器人。网关接入后将显示画面。",
  ],
  keys: [
    "Arrow keys go from picture to picture, Enter opens the robot, F is full screen.",
    "方向键切换画面，回车打开机器人，F 键全屏。",
  ],
  leave_full: ["Leave full screen", "退出全屏"],
  waiting: ["Waiting for a picture", "等待图像"],
  hidden: ["Not on the screen: not watched", "不在屏幕上：未接收"],
  gone: ["This robot is not on the mesh now", "该机器人目前不在网络上"],
  replay_ended: ["This replay has ended", "此回放已结束"],
  remove: ["Take {robot}, {view} off the wall", "从视频墙移除 {robot}，{view}"],
  replay: ["replay", "回放"],
} as const;

/** Return a text of the wall in the page's language. */
export function w(name: keyof typeof TEXTS, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}
