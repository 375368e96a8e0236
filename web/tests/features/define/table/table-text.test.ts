// A D-H table as text of a spreadsheet, a data sheet or a paper, and the joints that it fills.

import { expect, test } from "vitest";
import { concise, type Description, empty } from "../../../../src/features/define/description/description";
import type { Convention } from "../../../../src/features/define/table/table-fill";
import { fillJoints, typesFrom } from "../../../../src/features/define/table/table-fill";
import type { Reading, TextTable } from "../../../../src/features/define/table/table-text";
import { nameOf, readText, readValues } from "../../../../src/features/define/table/table-text";
import { decimal, decimalSign, splitHeader } from "../../../../src/features/define/table/table-units";

const ORDER = ["a", "alpha", "d", "theta", "lower", "upper", "max_speed", "max_acceleration"] as const;

function readTable(text: string): TextTable {
  const table = readText(text);
  if ("refused" in table) throw new Error(table.refused);
  return table;
}
function fill(text: string, choices: Partial<Reading> = {}, into: Description = empty(), convention?: Convention) {
  const table = readTable(text);
  const reading = { decimal: table.decimal.sign, ...into.units, ...choices };
  const read = readValues(table, reading, into.units, typesFrom(into, 0));
  fillJoints(into, read, 0, convention ?? (table.modified ? "modified" : "standard"));
  return { ...read, sure: table.decimal.sure, of: into };
}
/** The numbers of each row, in the order of the page's table. */
const valuesOf = ({ rows }: Pick<ReturnType<typeof fill>, "rows">) =>
  rows.map(({ values }) => ORDER.flatMap((key) => values[key] ?? []));

const ROWS = [
  [25, -90, 400, 0, -185, 185, 156],
  [455.5, 0, 0, -90, -155, 35, 156],
];
const TSV = "a\tα\td\tθ\tmin\tmax\tspeed\n25\t−90\t400\t0\t-185\t185\t156\n455.5\t0\t0\t-90\t-155\t35\t156\n";
test.each([
  ["tabs", TSV],
  [
    "semicolons and decimal commas",
    "a (mm);alpha [deg];d (mm);θ;min;max;vmax (°/s)\r\n25;-90;400;0;-185;185;156\r\n455,5;0;0;-90;-155;35;156",
  ],
  [
    "commas and quotes",
    'a,alpha,d,theta,lower,upper,velocity\n25,-90,400,0,-185,185,156\n"455.5",0,0,-90,-155,35,156\n',
  ],
  [
    "SI units, π and ranges",
    '"a\n(m)"\t"α\n(rad)"\td / m\tθ in rad\tlimits\tspeed (rpm)\n0.025\t-pi/2\t0.4\t0\t±185°\t26\n0.4555\t0\t0\t-π/2\t-155°/35°\t26\n',
  ],
  ["no header", TSV.slice(TSV.indexOf("\n") + 1)],
  ["spaces and variables", "A1  25  -90  400  θ1  -185  185  156\nA2  455.5  0  0  θ2 - 90  -155  35  156\n"],
  [
    "Chinese, a title and a row of units",
    "Robot X\n连杆\t连杆长度\t扭角\t偏距\t关节角\t下限\t上限\t速度\n\tmm\t°\tmm\t°\n1\t25\t-90\t400\t0\t-185\t185\t156\n2\t455.5\t0\t0\t-90\t-155\t35\t156\nNote\n",
  ],
  [
    "a table of Markdown",
    "| a | alpha | d | theta | limits | speed |\n|---|:---:|---|---|---|---|\n| 25 | -90 | 400 | 0 | [-185, 185] | 156 |\n| 455.5 | 0 | 0 | -90 | -155 to 35 | 156 |\n",
  ],
])("one table is one robot: with %s", (_, text) => {
  const filled = fill(text);
  expect(valuesOf(filled)).toEqual(ROWS.map((row) => row.map((each) => expect.closeTo(each, 9))));
  expect(filled.problems).toEqual([]);
});

// The clipboard of LibreOffice Calc 7.4 with cells in the formats of two countries.
const CALC =
  "Joint\ta (mm)\tα (°)\td [m]\tθ\tmin\tmax\tspeed (°/s)\nA1\t25.50\t-90.00\t0.40\t0.00\t-185.00\t185.00\t1,156.25\nA2\t455.00\t0.00\t0.00\t-90.00\t-155.00\t35.00\t156.00\n";
test.each([
  ["a point", CALC],
  ["a comma", CALC.replace(/[.,]/g, (sign) => (sign === "." ? "," : "."))],
])("the clipboard of a real spreadsheet is read with %s as decimal sign", (_, text) => {
  const filled = fill(text);
  expect(valuesOf(filled)).toEqual([
    [25.5, -90, 400, 0, -185, 185, 1156.25],
    [455, 0, 0, -90, -155, 35, 156],
  ]);
  expect([filled.sure, filled.of.joint.map(({ name }) => name)]).toEqual([true, ["A1", "A2"]]);
});

test("an unreadable cell is named, and what it would set stays as it is", () => {
  const { problems, of } = fill("a\talpha\td\ttype\n1\tabc\t3\tR\n4 kg\t5\td2\tP\n");
  expect(problems).toEqual([
    { row: 2, column: 1, text: "abc" },
    { row: 3, column: 0, text: "4 kg" },
  ]);
  expect(of.joint.map(({ type, a, alpha, d }) => [type, a, alpha, d])).toEqual([
    ["rotary", 1, 0, 3],
    ["prismatic", 0, 5, 0],
  ]);
});

test("a cell with a dash sets nothing, and is no problem", () => {
  const { problems, of } = fill("a\td\n-\t3\n5\tn/a\n");
  expect([problems, of.joint.map(({ a, d }) => [a, d])]).toEqual([
    [],
    [
      [0, 3],
      [5, 0],
    ],
  ]);
});

test.each([
  ["a\td\n1,250\t0\n", false, [[1.25, 0]]],
  ["a\td\n0,5\t1,250\n", true, [[0.5, 1.25]]],
  ["a\td\n1,250.5\t0\n", true, [[1250.5, 0]]],
])("a comma that may group thousands is a guess: %j", (text, sure, values) => {
  const filled = fill(text);
  expect([filled.sure, valuesOf(filled)]).toEqual([sure, values]);
});

test("a chosen decimal sign, and chosen units of columns without one, are used", () => {
  expect(valuesOf(fill("a\talpha\n1,250\t1\n", { decimal: ".", length: "m", angle: "rad" }))).toEqual([
    [1_250_000, expect.closeTo(57.29577951, 8)],
  ]);
});

test.each([
  ["too_many_rows", "1\t2\t3\n".repeat(10_000)],
  ["too_many_rows", "1\t2\n".repeat(71)],
  ["too_long", "x".repeat(100_001)],
  ["empty", "\t".repeat(9999)],
  ["one_column", "90"],
])("what is no table is refused: %s", (refused, text) => {
  expect(readText(text)).toMatchObject({ refused });
});

test("no text of the longest length takes long", { timeout: 60_000 }, () => {
  const parts = ["1 ", "1,2", "-\t", "θ", '"', "(", "±1/", "π/", "1..", "a (", "e1"];
  const began = performance.now();
  for (const part of parts)
    for (const text of [`${part.repeat(700)}\t1\n`.repeat(40), `${part.repeat(50_000).slice(0, 99_000)}\t1`]) {
      const table = readText(text.slice(0, 99_999));
      if (!("refused" in table)) fill(text.slice(0, 99_999));
    }
  // Together; the worst takes some tens of milliseconds.
  expect(performance.now() - began).toBeLessThan(20_000);
});

test("a table of 64 joints under titles is not refused", () => {
  expect(readTable(`Robot\na\td\n${"1\t2\n".repeat(64)}`).rows).toHaveLength(64);
});

test.each([
  ["±170", [-170, 170]],
  ["+/- 170", [-170, 170]],
  ["-130°/154°", [-130, 154]],
  ["90 .. -90", [-90, 90]],
  ["[-90, 90]", [-90, 90]],
  ["-170 - 170", [-170, 170]],
  ["-170~170", [-170, 170]],
  ["-170 至 170", [-170, 170]],
  ["-170", []],
])("limits written as %j are %j", (text, limits) => {
  expect(valuesOf(fill(`a\tlimits\n1\t${text}\n`))).toEqual([[1, ...limits]]);
});

test.each([
  ["d1", "prismatic", 0],
  ["d1 + 20", "prismatic", 20],
  ["20 + q1", "prismatic", 20],
  ["20", "rotary", 20],
])("%j in the column of d makes the joint %s, with its constant %i", (cell, type, d) => {
  const { of } = fill(`a\td\ttheta\n1\t${cell}\t0\n`);
  expect(of.joint.map((joint) => [joint.type, joint.d])).toEqual([[type, d]]);
});

test.each([
  ["a (mm)", "a", "mm"],
  ["alpha [deg]", "alpha", "deg"],
  ["d / m", "d", "m"],
  ["θ in rad", "θ", "rad"],
  ["speed °/s", "speed", "°/s"],
  ["link in", "link in", undefined],
  ["α", "α", undefined],
])("the header %j names %j in %s", (head, name, unit) => {
  const split = splitHeader(head);
  expect([split.name, split.unit?.text]).toEqual([name, unit]);
});

test.each([
  ["1,234.5", ".", 1234.5],
  ["1.234,5", ",", 1234.5],
  ["1'234", ".", 1234],
  ["−5e-1", ".", -0.5],
  ["1,23", ".", null],
  ["1.2.3", ".", null],
  ["5 kg", ".", null],
  [",5", ",", 0.5],
] as const)("%j with the decimal sign %j is %j", (text, sign, value) => {
  expect(decimal(text, sign)).toBe(value);
});

test.each([
  [["1", "2"], ".", true],
  [["0,5"], ",", true],
  [["1,250"], ",", false],
  [["1,250", "0.5"], ".", true],
  [["1,2", "0.5"], ".", false],
])("of the numbers %j the decimal sign is %j, surely: %s", (texts, sign, sure) => {
  expect(decimalSign(texts)).toEqual({ sign, sure });
});

test.each([
  ["Joint 1", "Joint_1"],
  ["ａ１", "a1"],
  ["_x_", "x"],
  ["12", null],
  ["腰", null],
])("%j names a joint %j", (text, name) => {
  expect(nameOf(text)).toBe(name);
});

test("a table changes only the joints and values that it gives, and adds joints at the end", () => {
  const { of } = fill("a\td\n10\t1\n");
  fill("name\td\ttype\nelbow\t5\tR\n\t6\tP\nelbow\t7\tR\n", {}, of);
  expect(of.joint.map(({ name, type, a, d }) => [name, type, a, d])).toEqual([
    ["elbow", "rotary", 10, 5],
    ["joint2", "prismatic", 0, 6],
    ["joint3", "rotary", 0, 7],
  ]);
});

test("a joint's home position stays within new limits", () => {
  const { of } = fill("min\tmax\n10\t20\n");
  expect(of.joint[0]?.home).toBe(10);
});

const PANDA = `| Joint | a_{i-1} (m) | d_i (m) | α_{i-1} (rad) | θ_i (rad) |
|---|---|---|---|---|
| Joint 1 | 0 | 0.333 | 0 | θ1 |
| Joint 2 | 0 | 0 | -π/2 | θ2 |
| Joint 3 | 0.088 | 0 | π/2 | θ3 |
`;
test("the last row of a modified table ends in its joint", () => {
  const { of } = fill(PANDA);
  expect(of.joint.map(({ name, a, alpha, d }) => [name, a, alpha, d])).toEqual([
    ["Joint_1", 0, -90, 333],
    ["Joint_2", 88, 90, 0],
    ["Joint_3", 0, 0, 0],
  ]);
});

test("a modified table changes no cell that it does not give", () => {
  const { of } = fill("a\talpha\td\ttheta\n10\t90\t1\t0\n20\t45\t2\t0\n30\t-90\t3\t0", {}, empty(), "modified");
  fill("alpha\td\n5\t1\nabc\t2\n7\t3", {}, of, "modified");
  expect(of.base.pose).toEqual({ xyz: [10, 0, 0], rpy: [5, 0, 0] });
  expect(of.joint.map(({ a, alpha }) => [a, alpha])).toEqual([
    [20, 45],
    [30, 7],
    [0, 0],
  ]);
  fill("d\ttheta\n1\t2\n3\t4\n5\t6", {}, of, "modified");
  fill("alpha\td\n1\t1\n2\t2", {}, of, "modified");
  expect(of.joint.map(({ a, alpha, d }) => [a, alpha, d])).toEqual([
    [20, 2, 1],
    [30, 7, 2],
    [0, 0, 5],
  ]);
});

test("what is saved of a table has no defaults that the file omits", () => {
  const saved = concise(fill("a\n1\n2\n".replace(/^a$/m, "a\td").replace(/^(\d)$/gm, "$1\t0")).of) as Record<
    string,
    unknown
  >;
  expect(Object.keys(saved)).toEqual(["name", "units", "base", "joint", "tool"]);
});
