// A program's text: its points, their names, and the lines that the page writes.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import {
  example,
  highlightSyntax,
  insertPoint,
  isName,
  jointsOf,
  jointsText,
  pointsOf,
  removeLine,
  renamePoint,
  unusedName,
  usesOf,
} from "../../../../src/features/program/draft/program-text";
import { DescriptionSchema, Description_Joint_Type as Type } from "../../../../src/gen/robomesh_pb";

const TEXT = `# start
point p1 = joints 10 -20.5 # over the table
  point p10 = pose 1 2 3 4 5 6
point broken =
home
move_joints p1
  move_line p10 # not p1
move_line_by p1
# move_joints p1`;
const JOINTS = create(DescriptionSchema, {
  joints: [
    { name: "waist", lower: -1, upper: 1, home: 0.9 },
    { name: "rail", type: Type.PRISMATIC, lower: 0, upper: 2, home: 0.5 },
  ],
});

test("points are those with a name and a kind, and comments are no numbers", () => {
  expect(pointsOf(TEXT)).toEqual([
    { line: 2, name: "p1", kind: "joints", numbers: [10, -20.5] },
    { line: 3, name: "p10", kind: "pose", numbers: [1, 2, 3, 4, 5, 6] },
  ]);
});

test.each([
  ["p1", [6]],
  ["p10", [7]],
  ["p", []],
])("the lines that move to %s are %j, without comments and names that only begin so", (name, lines) => {
  expect(usesOf(TEXT, name)).toEqual(lines);
});

test("a renamed point is renamed where it is defined and used, and nowhere else", () => {
  expect(renamePoint(TEXT, "p1", "table").split("\n")).toEqual(
    TEXT.split("\n").with(1, "point table = joints 10 -20.5 # over the table").with(5, "move_joints table"),
  );
});

test.each([
  ["a-1_b", true],
  ["A", false],
  ["1a", false],
  ["a b", false],
  ["", false],
])("%j is a name: %s", (text, expected) => {
  expect(isName(text)).toBe(expected);
});

test("a new point gets the first free name", () => {
  expect([unusedName(""), unusedName(TEXT), unusedName("point p2 = joints 1\npoint p1 = joints 1")]).toEqual([
    "p1",
    "p2",
    "p3",
  ]);
});

test.each([
  ["an empty program", "", 1, "\npoint p = V\nmove_line p", 3],
  ["below the comments, before the first statement", "# a\nhome\n", 2, "# a\npoint p = V\nhome\nmove_line p\n", 4],
  ["below the last point", "point a = joints 1\nhome", 2, "point a = joints 1\npoint p = V\nhome\nmove_line p", 4],
  ["inside a block", "home\nrepeat 2\nend", 2, "point p = V\nhome\nrepeat 2\n  move_line p\nend", 4],
  ["indented as its neighbour", "repeat 2\n  home\nend", 2, "point p = V\nrepeat 2\n  home\n  move_line p\nend", 4],
])("a point is inserted in %s", (_, text, cursorLine, expected, line) => {
  expect(insertPoint(text, "p", "V", "move_line", cursorLine)).toEqual({ text: expected, line });
});

test("a removed line takes only itself", () => {
  expect(removeLine("a\nb\nc", 2)).toBe("a\nc");
});

test.each([
  ["  move_joints p1 # go", ["  |", "move_joints|keyword", " p1 |", "# go|comment"]],
  ["# home", ["# home|comment"]],
  ["homes", ["homes|"]],
  ["", []],
])("%j is coloured by its parts", (line, parts) => {
  expect(highlightSyntax(line).map(({ text, is }) => `${text}|${is}`)).toEqual(parts);
});

test("joint positions are written in degrees and millimetres, and read as they were", () => {
  const positions = [-Math.PI / 2, 0.12345];
  const text = jointsText(JOINTS.joints, positions);
  expect([text, jointsText(JOINTS.joints, [-1e-9, 0])]).toEqual(["joints -90 123.45", "joints 0 0"]);
  const [point] = pointsOf(`point p = ${text}`);
  expect(point && jointsOf(JOINTS.joints, point)).toEqual(positions);
});

test.each(["joints 1", "joints 1 2 3", "joints 1 x"])("%s is no position of two joints", (text) => {
  const [point] = pointsOf(`point p = ${text}`);
  expect(point && jointsOf(JOINTS.joints, point)).toBeNull();
});

test("the example begins at home, and moves the first joint to its farther side within its limits", () => {
  const [ready, side] = pointsOf(example(JOINTS, "hello"));
  expect(ready?.numbers).toEqual([51.566, 500]);
  expect(side?.numbers).toEqual([expect.closeTo(51.566 - 90 / Math.PI, 3), 500]);
  const roomy = create(DescriptionSchema, { joints: [{ lower: -3, upper: 3, home: 0 }] });
  expect(pointsOf(example(roomy, ""))[1]?.numbers).toEqual([30]);
});
