// Texts of the page Cell, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  cell_of: ["Cell of {robot}", "{robot} 的单元"],
  cell_named: ["cell {cell}", "单元 {cell}"],
  no_cell_name: ["alone, without a cell", "单独，不属于任何单元"],
  to_robot: ["Robot", "机器人"],
  waiting: ["Waiting for the cell of {robot}…", "正在等待 {robot} 的单元…"],
  fixtures: ["Fixtures and floor", "固定物与地面"],
  numbers: ["Place and size", "位置与尺寸"],
  floor: ["Floor", "地面"],
  no_floor: ["none", "无"],
  lowest_base: ["lowest base", "最低基座"],
  has_floor: ["The cell has a floor", "单元有地面"],
  own_height: ["Height of its own", "自定高度"],
  height: ["Height", "高度"],
  add: ["Add", "添加"],
  add_box: ["Add box", "添加长方体"],
  add_cylinder: ["Add cylinder", "添加圆柱体"],
  add_sphere: ["Add sphere", "添加球体"],
  remove: ["Remove", "移除"],
  keep: ["Keep", "保留"],
  removed: ["removed", "已移除"],
  added: ["new", "新增"],
  changed: ["changed", "已更改"],
  name: ["Name", "名称"],
  position: ["Position in the site's frame", "在站点坐标系中的位置"],
  rotation: ["Rotation about the site's axes", "绕站点坐标轴的旋转"],
  size: ["Size", "尺寸"],
  radius: ["Radius", "半径"],
  cylinder_height: ["Height", "高度"],
  mesh: ["Mesh file", "网格文件"],
  box: ["box", "长方体"],
  cylinder: ["cylinder", "圆柱体"],
  sphere: ["sphere", "球体"],
  mesh_kind: ["mesh", "网格"],
  drag: ["Drag in 3-D", "在三维中拖动"],
  drag_off: ["Off", "关"],
  drag_move: ["Move", "移动"],
  drag_turn: ["Turn", "旋转"],
  preview: [
    "Blue is a preview. Motions are checked against the grey fixtures until the change is made.",
    "蓝色为预览。更改生效之前，运动检查仍使用灰色的固定物。",
  ],
  review: ["Review change…", "查看更改…"],
  discard: ["Discard", "放弃"],
  undo: ["Undo last change…", "撤销上次更改…"],
  review_title: ["Change this cell?", "更改此单元？"],
  review_text: [
    "The check of motions, live clearance, all pictures and {file} change together. No robot of the cell can be controlled during the change.",
    "运动检查、实时间距、所有画面和 {file} 将一起更改。更改期间不能控制单元内的任何机器人。",
  ],
  change: ["Change cell", "更改单元"],
  changing: ["The cell is being changed…", "正在更改单元…"],
  done: ["Changed: {changes}.", "已更改：{changes}。"],
  change_added: ["{name} is added", "添加 {name}"],
  change_removed: ["{name} is removed", "移除 {name}"],
  change_value: ["{name}: {key} {before} → {after}", "{name}：{key} {before} → {after}"],
  outdated: [
    "The cell has been changed meanwhile. Discard your change to see the present one.",
    "单元在此期间已被更改。放弃您的更改即可查看当前内容。",
  ],
  read_only: ["Read-only: {account} is no engineer.", "只读：{account} 不是工程师。"],
  cannot: ["The cell cannot be changed: {text}.", "无法更改单元：{text}。"],
  robots: ["Robots of the cell", "单元内的机器人"],
  needs_restart: [
    "These settings are in the site file. They change with a restart of the site's services.",
    "这些设置在站点文件中。重启站点服务后才会改变。",
  ],
  model: ["Model", "型号"],
  base: ["Base", "基座"],
  controller: ["Controller", "控制器"],
  check: ["Check", "检查"],
  clearance: ["Clearance: warning, stop", "间距：警告、停止"],
  stop_proven: ["Stop proven", "停止已验证"],
  yes: ["yes", "是"],
  no: ["no", "否"],
  choose_fixture: ["Choose a fixture to see its numbers.", "选择一个固定物以查看其数值。"],
  name_taken: [
    "This name is taken, or has other characters than a-z, 0-9, - and _.",
    "名称已被占用，或含有 a-z、0-9、-、_ 以外的字符。",
  ],
} as const;

export type CellText = keyof typeof TEXTS;

/** Return a text in the page's language. */
export function c(name: CellText, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}
