// The program's text as the page parses it: points and syntax colours. The check parses the rest.

import type { Description, Description_Joint } from "../../../gen/robomesh_pb";
import { Description_Joint_Type as JointType } from "../../../gen/robomesh_pb";
import { jointUnit } from "../../../i18n/format";

/** A named point: joint positions, or a pose of the tool, in degrees and millimetres as written. */
export interface Point {
  /** From 1. */
  line: number;
  name: string;
  kind: "joints" | "pose";
  numbers: readonly number[];
}

export type Move = "move_joints" | "move_line";

const POINT = /^\s*point\s+(\S+)\s*=\s*(joints|pose)\b([^#]*)/;
const NAME = /^[a-z][a-z0-9_-]*$/;
const MOVES_TO = /^(\s*(?:move_joints|move_line)\s+)(\S+)/;
const KEYWORDS = new Set(
  "point home speed tool_speed move_joints move_line move_line_by wait trace repeat end".split(" "),
);
const SMALL = Math.PI / 6;

export const isName = (text: string): boolean => NAME.test(text);

export function pointsOf(text: string): readonly Point[] {
  return text.split("\n").flatMap((line, index) => {
    const [, name, kind, rest] = POINT.exec(line) ?? [];
    if (!name || !kind) return [];
    const numbers = (rest ?? "").trim().split(/\s+/).map(Number);
    return [{ line: index + 1, name, kind: kind as Point["kind"], numbers }];
  });
}

/** Return the lines (from 1) that move to a point. */
export function usesOf(text: string, name: string): readonly number[] {
  return text.split("\n").flatMap((line, index) => (MOVES_TO.exec(line)?.[2] === name ? [index + 1] : []));
}

/** Return the first free name of p1, p2, ... */
export function unusedName(text: string): string {
  const taken = new Set(pointsOf(text).map((point) => point.name));
  for (let number = 1; ; number++) if (!taken.has(`p${number}`)) return `p${number}`;
}

/** Add a point below the last one, and a move to it below the cursor's line; return the text and that line's number. */
export function insertPoint(text: string, name: string, value: string, move: Move, cursorLine: number) {
  const lines = text.split("\n");
  const last = pointsOf(text).at(-1)?.line;
  // Before the first statement, below the initial comments.
  const first = lines.findIndex((line) => line.trim() && !line.trim().startsWith("#"));
  const at = last ?? (first < 0 ? lines.length : first);
  const point = `point ${name} = ${value}`;
  const moveAfter = Math.max(cursorLine, at);
  const indent = /^\s*/.exec(lines[moveAfter - 1] ?? "")?.[0] ?? "";
  const deeper = /^\s*repeat\b/.test(lines[moveAfter - 1] ?? "") ? "  " : "";
  // Write on a blank last line.
  const blank = moveAfter > at && !(lines[moveAfter - 1] ?? "").trim() ? 1 : 0;
  lines.splice(moveAfter - blank, blank, `${indent}${deeper}${move} ${name}`);
  lines.splice(at, 0, point);
  return { text: lines.join("\n"), line: moveAfter - blank + 2 };
}

/** Rename a point in the whole text. */
export function renamePoint(text: string, from: string, to: string): string {
  return text
    .split("\n")
    .map((line) => {
      if (POINT.exec(line)?.[1] === from) return line.replace(/^(\s*point\s+)\S+/, `$1${to}`);
      return MOVES_TO.exec(line)?.[2] === from ? line.replace(MOVES_TO, `$1${to}`) : line;
    })
    .join("\n");
}

export function removeLine(text: string, line: number): string {
  return text
    .split("\n")
    .toSpliced(line - 1, 1)
    .join("\n");
}

/** Return the parts of a line with their kinds. */
export function highlightSyntax(line: string): readonly { text: string; is: "" | "keyword" | "comment" }[] {
  const at = line.indexOf("#");
  const code = at < 0 ? line : line.slice(0, at);
  const word = /^(\s*)(\S+)(.*)$/.exec(code);
  const known = word && KEYWORDS.has(word[2] ?? "");
  return [
    ...(known
      ? ([
          { text: word[1] ?? "", is: "" },
          { text: word[2] ?? "", is: "keyword" },
          { text: word[3] ?? "", is: "" },
        ] as const)
      : ([{ text: code, is: "" }] as const)),
    ...(at < 0 ? [] : [{ text: line.slice(at), is: "comment" } as const]),
  ].filter((part) => part.text);
}

/** Format joint positions [rad] or [m] as a program writes them. */
export function jointsText(joints: readonly Description_Joint[], positions: readonly number[]): string {
  const words = joints.map((joint, i) => short((positions[i] ?? 0) * jointUnit(joint).factor, joint));
  return `joints ${words.join(" ")}`;
}

/** Return a point's joint positions [rad] or [m]; null: it does not have one number a joint. */
export function jointsOf(joints: readonly Description_Joint[], point: Point): readonly number[] | null {
  if (point.numbers.length !== joints.length || point.numbers.some(Number.isNaN)) return null;
  return joints.map((joint, i) => (point.numbers[i] ?? 0) / jointUnit(joint).factor);
}

function short(value: number, joint: Description_Joint): string {
  const text = value.toFixed(joint.type === JointType.PRISMATIC ? 2 : 3);
  return String(Number(text)).replace(/^-0$/, "0");
}

/** Return an example program that the robot can run. */
export function example(description: Description, comment: string): string {
  const home = description.joints.map((joint) => joint.home);
  const side = description.joints.map((joint, i) => {
    if (i > 0) return joint.home;
    const by = Math.min(SMALL, (joint.upper - joint.lower) / 4);
    return joint.home + (joint.home + by <= joint.upper ? by : -by);
  });
  return [
    `# ${comment}`,
    `point ready = ${jointsText(description.joints, home)}`,
    `point side = ${jointsText(description.joints, side)}`,
    "",
    "home",
    "speed 50",
    "repeat 2",
    "  move_joints side",
    "  wait 0.5",
    "  move_joints ready",
    "end",
    "",
  ].join("\n");
}
