// Names and values of signals in words, in English and Chinese; unknown ones are shown as they are.

import type { Description, Signal } from "../gen/robomesh_pb";
import { DASH, fixed, jointTitle } from "./format";
import { inLanguage, language } from "./texts";
import { shownUnit } from "./value-names";

type Pair = readonly [english: string, chinese: string];

// Groups in the order in which they are shown: what people look for first.
const GROUPS: Record<string, Pair> = {
  safety: ["Safety", "安全"],
  robot: ["Robot", "机器人"],
  program: ["Program", "程序"],
  speed: ["Speed", "速度"],
  tool: ["Tool", "工具"],
  payload: ["Payload", "负载"],
  frame: ["User frame", "用户坐标系"],
  joint: ["Joints", "关节"],
  io: ["Inputs and outputs", "输入和输出"],
  counter: ["Counters", "计数器"],
  cabinet: ["Cabinet", "控制柜"],
};

const WORDS: Record<string, Pair> = {
  analog_in: ["analog input", "模拟输入"],
  analog_out: ["analog output", "模拟输出"],
  configurable_in: ["configurable input", "可配置输入"],
  configurable_out: ["configurable output", "可配置输出"],
  current: ["current", "电流"],
  cycle: ["cycle", "循环方式"],
  digital_in: ["digital input", "数字输入"],
  digital_out: ["digital output", "数字输出"],
  emergency_stop: ["emergency stop", "急停"],
  enabling_device: ["enabling device", "使能装置"],
  force: ["force", "力"],
  line: ["line", "行"],
  load: ["load", "负载率"],
  mass: ["mass", "质量"],
  mode: ["mode", "模式"],
  name: ["name", "名称"],
  number: ["number", "编号"],
  offset: ["offset", "偏移"],
  override: ["override", "倍率"],
  power: ["power", "电源"],
  power_on_time: ["time with power", "通电时间"],
  protective_stop: ["protective stop", "保护性停止"],
  register: ["register", "寄存器"],
  safeguard_stop: ["safeguard stop", "安全防护停止"],
  scaling: ["scaling", "缩放"],
  servo: ["servo", "伺服"],
  servo_on_time: ["time with servo", "伺服时间"],
  state: ["state", "状态"],
  step: ["step", "步"],
  target_torque: ["target torque", "目标力矩"],
  temperature: ["temperature", "温度"],
  tool_analog_in: ["tool analog input", "工具模拟输入"],
  tool_in: ["tool input", "工具输入"],
  tool_out: ["tool output", "工具输出"],
  torque: ["torque", "力矩"],
  voltage: ["voltage", "电压"],
};

// The usual modes and states; others are the vendor's words.
const VALUES: Record<string, string> = {
  automatic: "自动",
  backdrive: "反向驱动",
  booting: "启动中",
  disconnected: "未连接",
  fault: "故障",
  idle: "空闲",
  normal: "正常",
  paused: "已暂停",
  pausing: "暂停中",
  play: "再现",
  playing: "运行中",
  power_off: "断电",
  power_on: "已通电",
  protective_stop: "保护性停止",
  recovery: "恢复",
  reduced: "缩减",
  remote: "远程",
  resuming: "恢复中",
  robot_emergency_stop: "机器人急停",
  running: "运行",
  safeguard_stop: "安全防护停止",
  stopped: "已停止",
  stopping: "停止中",
  system_emergency_stop: "系统急停",
  teach: "示教",
  violation: "违规",
};

const TEXTS = {
  signals: ["Signals", "信号"],
  on: ["on", "开"],
  off: ["off", "关"],
  group: ["{group} ({count})", "{group}（{count}）"],
} as const;

/** Return a text of the signals in the page's language. */
export function sg(name: keyof typeof TEXTS, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}

/** Return the group of a signal: the first word of its name. */
export function groupOf(name: string): string {
  return name.split(".", 1)[0] ?? "";
}

export function groupTitle(group: string): string {
  return inLanguage(GROUPS[group] ?? [group, group], {});
}

/** Return the place of a group among the others. */
export function groupRank(group: string): number {
  return Object.keys(GROUPS).indexOf(group) + 1 || 99;
}

/** Return a signal's name in words, without its group; a joint has its title. */
export function signalText(name: string, description: Description | undefined): string {
  const [group = "", ...rest] = name.split(".");
  if (group === "joint" && rest.length > 1) {
    const quantity = rest.pop() ?? "";
    const joint = description?.joints.find((each) => each.name === rest.join("."));
    return `${joint ? jointTitle(joint) : rest.join(".")} ${word(quantity)}`;
  }
  return rest.map(word).join(" ") || name;
}

/** Return a signal's name in words, with its group where the others would be ambiguous. */
export function fullSignalText(name: string, description: Description | undefined): string {
  const group = groupOf(name);
  const text = signalText(name, description);
  return group === "joint" || group === "io" ? text : `${groupTitle(group)} ${text}`;
}

/** Return a signal's value in words, and its unit. */
export function signalValue({ value, unit }: Signal): { text: string; unit: string } {
  switch (value.case) {
    case "on":
      return { text: sg(value.value ? "on" : "off"), unit: "" };
    case "text":
      return { text: valueText(value.value), unit: "" };
    case "number": {
      const shown = shownUnit(unit);
      const whole = unit === "" && Number.isInteger(value.value);
      return {
        text: whole ? String(value.value) : fixed(value.value * shown.factor, shown.decimals),
        unit: shown.unit,
      };
    }
    default:
      return { text: DASH, unit: "" };
  }
}

function valueText(text: string): string {
  if (language.value === "zh" && VALUES[text]) return VALUES[text];
  return /^[a-z_]+$/.test(text) ? text.replaceAll("_", " ") : text;
}

function word(part: string): string {
  const text = part.replaceAll("_", " ");
  return inLanguage(WORDS[part] ?? [text, text], {});
}
