// Names and values of signals in words; ones that the catalogues do not have are shown as they are.

import type { Description, Signal } from "../gen/robomesh_pb";
import { DASH, fixed, jointTitle } from "./format";
import { message, signalsText as sg } from "./texts";
import { shownUnit } from "./units";

// Groups in the order in which they are shown: what people look for first.
const GROUPS = ["safety", "robot", "program", "speed", "tool", "payload", "frame", "joint", "io", "counter", "cabinet"];

/** Return the group of a signal: the first word of its name. */
export function groupOf(name: string): string {
  return name.split(".", 1)[0] ?? "";
}

export function groupTitle(group: string): string {
  return message(`signal_group.${group}`) ?? group;
}

/** Return the place of a group among the others. */
export function groupRank(group: string): number {
  return GROUPS.indexOf(group) + 1 || 99;
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
  return ["joint", "io", name].includes(group) ? text : `${groupTitle(group)} ${text}`;
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
  return message(`signal_value.${text}`) ?? (/^[a-z_]+$/.test(text) ? text.replaceAll("_", " ") : text);
}

function word(part: string): string {
  return message(`signal_word.${part}`) ?? part.replaceAll("_", " ");
}
