// Texts of Program, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  choose: ["Program a robot", "机器人编程"],
  choose_words: [
    "Choose the robot that the program is for. The site stores its programs; a draft is kept in this browser.",
    "请选择要编程的机器人。程序存储在站点；草稿保存在此浏览器中。",
  ],
  program_of: ["Program of {robot}", "{robot} 的程序"],
  to_robot: ["Robot", "机器人"],

  file: ["File", "文件"],
  name: ["Program name", "程序名称"],
  default_name: ["program", "程序"],
  new: ["New", "新建"],
  new_hint: ["Begins anew with an example. Undo brings the text back.", "以示例重新开始。可用撤销恢复原文。"],
  open: ["Open file…", "打开文件…"],
  save: ["Save file", "保存文件"],
  save_hint: [
    "Downloads the program. The draft itself is kept in this browser as you type.",
    "下载程序文件。草稿会随输入保存在此浏览器中。",
  ],
  undo: ["Undo", "撤销"],
  redo: ["Redo", "重做"],
  replaced: ["A new program. Undo brings the old text back.", "已新建程序。可用撤销恢复原文。"],
  opened: ["{name} opened. Undo brings the old text back.", "已打开 {name}。可用撤销恢复原文。"],
  too_large: [
    "{name} is not opened: {size} KiB, and a program has at most 64 KiB.",
    "未打开 {name}：{size} KiB，程序最大 64 KiB。",
  ],
  no_text: ["{name} is not opened: it is no text.", "未打开 {name}：不是文本文件。"],
  not_kept: [
    "This browser does not keep the draft: {text}. Save it as a file.",
    "此浏览器无法保存草稿：{text}。请保存为文件。",
  ],
  example_comment: [
    "Joints in degrees (mm where they slide); the check says what it does.",
    "关节单位为度（移动关节为 mm）；检查会说明其动作。",
  ],

  text: ["Program text", "程序文本"],
  lines: ["{count} lines", "{count} 行"],
  one_line: ["1 line", "1 行"],
  line: ["line {line}", "第 {line} 行"],
  lines_to: ["lines {first} to {last}", "第 {first} 至 {last} 行"],

  check: ["Check", "检查"],
  check_again: ["Check now", "立即检查"],
  checking: ["Checking…", "正在检查…"],
  check_empty: ["Nothing to check yet: write a line, or choose New.", "尚无内容可检查：请输入一行，或选择新建。"],
  check_failed: ["Not checked: {text}", "未检查：{text}"],
  checked_at: ["from where the robot was at {time}", "以 {time} 的机器人位置为起点"],
  moved_since: [
    "from where the robot was; it has moved since: check again",
    "以当时位置为起点；机器人已移动，请重新检查",
  ],
  verdict_ok: ["Nothing in the way. Takes {duration}.", "无冲突，耗时 {duration}。"],
  verdict_alone: [
    "Only the arm itself was checked: no floor, no fixture. Takes {duration}.",
    "仅检查了机器人自身：无地面、无固定物，耗时 {duration}。",
  ],
  verdict_warns: [
    "Can run, with {count} to look at. Takes {duration}.",
    "可以运行，有 {count} 处需注意，耗时 {duration}。",
  ],
  verdict_one: ["1 violation. Takes {duration}.", "1 处违规，耗时 {duration}。"],
  verdict_many: ["{count} violations. Takes {duration}.", "{count} 处违规，耗时 {duration}。"],
  verdict_error: ["1 error in the text.", "文本中有 1 处错误。"],
  verdict_errors: ["{count} errors in the text.", "文本中有 {count} 处错误。"],
  violations: ["Violations", "违规"],
  notes: ["Notes", "备注"],
  assumed: ["What is assumed", "检查假设"],
  from_to: ["{from} to {to}", "{from} 至 {to}"],
  touch: ["touching", "接触"],
  kind_program: ["Error", "错误"],
  kind_limit: ["Limit", "限位"],
  kind_speed: ["Speed", "速度"],
  kind_singularity: ["Singularity", "奇异"],
  kind_collision: ["Collision", "碰撞"],
  kind_clearance: ["Clearance", "间距"],
  kind_unreachable: ["Unreachable", "不可达"],

  timeline: ["Checked motion", "已检查的运动"],
  moment: ["Moment of the checked motion", "已检查运动的时刻"],
  play: ["Play", "播放"],
  pause: ["Pause", "暂停"],
  hide_ghost: ["Hide ghost", "隐藏虚影"],
  scrub_hint: [
    "Drag to see the robot's ghost at a moment; nothing moves.",
    "拖动以查看某一时刻的虚影；机器人不会移动。",
  ],
  no_motion_yet: ["The motion appears here once the program is checked.", "程序检查后将在此显示运动。"],
  clearance: ["Clearance", "间距"],
  clearance_now: ["clearance {distance}", "间距 {distance}"],

  run: ["Run", "运行"],
  run_named: ["Run “{name}”", "运行“{name}”"],
  run_hint: [
    "The gateway checks it from where the robot is, then runs it step by step.",
    "网关将从当前位置检查，然后逐步运行。",
  ],
  run_empty: ["There is no program to run.", "没有可运行的程序。"],
  run_error: ["Cannot run: line {line}: {text}", "无法运行：第 {line} 行：{text}"],
  run_running: ["A program is running.", "程序正在运行。"],
  run_take: ["Take control to run it.", "取得控制权后可运行。"],
  asking_run: ["The gateway checks the program before it moves…", "网关正在运动前检查程序…"],
  is_running: ["Running", "运行中"],
  is_done: ["Done", "已完成"],
  is_ended: ["Ended early", "提前结束"],
  by_since: ["{name}, since {time}", "{name}，自 {time}"],
  progress: ["Progress", "进度"],
  step_of: ["step {step} of {steps}", "第 {step}/{steps} 步"],
  time_left: ["about {left} left of {all}", "共 {all}，剩余约 {left}"],

  teach: ["Teach", "示教"],
  move_with: ["Goes there by", "到达方式"],
  move_joints: ["joints", "关节"],
  move_line: ["line", "直线"],
  add_live: ["Add where the robot is", "添加当前位置"],
  begin_ghost: ["Pose a ghost", "摆放虚影"],
  end_ghost: ["Put ghost away", "收起虚影"],
  add_ghost: ["Add this pose", "添加此姿态"],
  set_by: ["Pose it by", "摆放方式"],
  by_joints: ["joints", "关节"],
  by_pose: ["pose", "位姿"],
  ghost_joint: ["{joint} of the ghost", "虚影的 {joint}"],
  moves_nothing: ["Only the ghost moves.", "仅虚影移动。"],
  gizmo: ["In the picture, drag to", "在三维视图中拖动以"],
  gizmo_translate: ["move", "移动"],
  gizmo_rotate: ["turn", "旋转"],
  x: ["x", "x"],
  y: ["y", "y"],
  z: ["z", "z"],
  roll: ["roll", "滚转"],
  pitch: ["pitch", "俯仰"],
  yaw: ["yaw", "偏航"],
  pose_keys: [
    "Keys: up and down by 1, Shift by 0.1, Page up and down by 10.",
    "键盘：上下键 1，Shift 0.1，翻页键 10。",
  ],
  points: ["Points", "点"],
  no_points: ["No points yet.", "尚无点。"],
  added: ["{name} added. Undo takes it back.", "已添加 {name}，可撤销。"],
  go_to: ["Show", "显示"],
  go_to_point: ["Show {name} with the ghost", "用虚影显示 {name}"],
  rename_point: ["Rename {name}", "重命名 {name}"],
  delete: ["Delete", "删除"],
  delete_point: ["Delete {name}", "删除 {name}"],
  deleted: ["{name} deleted. Undo brings it back.", "已删除 {name}，可撤销。"],
  deleted_used: [
    "{name} deleted; still used in line {lines}. Undo brings it back.",
    "已删除 {name}；第 {lines} 行仍在使用，可撤销。",
  ],
  name_wrong: [
    "“{name}” cannot be a name: lower-case letters, digits, “_” and “-”, beginning with a letter.",
    "“{name}”不能作为名称：仅限小写字母、数字、“_”“-”，且以字母开头。",
  ],
  name_taken: ["There is a point “{name}” already.", "已有名为“{name}”的点。"],
  point_wrong: ["{name} has not {count} numbers, one a joint.", "{name} 没有 {count} 个数值（每关节一个）。"],
} as const;

export type ProgramText = keyof typeof TEXTS;

/** A text that follows the page's language while it is shown. */
export type Words = () => string;
export const noWords: Words = () => "";

/** Return a text of Program in the page's language. */
export function p(name: ProgramText, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}
