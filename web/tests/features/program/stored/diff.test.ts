// The difference of two versions of a program.

import { expect, test } from "vitest";
import type { Row } from "../../../../src/features/program/stored/diff";
import { diffRows, sideBySide } from "../../../../src/features/program/stored/diff";

/** "-3 wait" is removed, "+3 wait" added, " 3/4 wait" in both; "..2" means two equal lines. */
function written(row: Row | null): string {
  if (row === null) return "";
  if (row.kind === "gap") return `..${row.count}`;
  if (row.kind === "same") return ` ${row.old}/${row.new} ${row.text}`;
  return row.kind === "old" ? `-${row.old} ${row.text}` : `+${row.new} ${row.text}`;
}
const rows = (old: string, now: string) => diffRows(old, now).map(written);

test.each([
  ["equal texts", "a\nb\n", "a\nb\n", []],
  ["a changed line", "a\nb\nc\n", "a\nx\nc\n", [" 1/1 a", "-2 b", "+2 x", " 3/3 c"]],
  ["an inserted line", "a\nc", "a\nb\nc", [" 1/1 a", "+2 b", " 2/3 c"]],
  ["a removed line", "a\nb\nc", "a\nc", [" 1/1 a", "-2 b", " 3/2 c"]],
  ["all of a new text", "", "a\nb", ["+1 a", "+2 b"]],
  ["all of an old text", "a", "", ["-1 a"]],
  ["a missing line end", "a\n", "a", [" 1/1 a", "-2 "]],
  ["repeated lines", "a\na\nb", "a\nb\na", [" 1/1 a", "-2 a", " 3/2 b", "+3 a"]],
])("%s: %j and %j", (_, old, now, expected) => {
  expect(rows(old, now)).toEqual(expected);
});

test("three equal lines stay around a change, and the others are counted", () => {
  const lines = Array.from({ length: 20 }, (_, i) => `line ${i + 1}`);
  const changed = rows(lines.join("\n"), lines.with(9, "new").join("\n"));
  expect([changed[0], changed.at(-1)]).toEqual(["..6", "..7"]);
  expect(changed.slice(1, -1)).toEqual([
    ...[7, 8, 9].map((at) => ` ${at}/${at} line ${at}`),
    "-10 line 10",
    "+10 new",
    ...[11, 12, 13].map((at) => ` ${at}/${at} line ${at}`),
  ]);
});

test("each difference makes the new text of the old one, by the fewest lines", () => {
  let seed = 1;
  const random = (below: number) => (seed = (seed * 16807) % 2147483647) % below;
  const make = () => Array.from({ length: 1 + random(8) }, () => "abc"[random(3)]).join("\n");
  const common = (a: string[], b: string[]): number =>
    a.length && b.length
      ? a[0] === b[0]
        ? 1 + common(a.slice(1), b.slice(1))
        : Math.max(common(a.slice(1), b), common(a, b.slice(1)))
      : 0;
  for (let i = 0; i < 100; i++) {
    const [old, now] = [make(), make()];
    const all = diffRows(old, now);
    if (old === now || all.some(({ kind }) => kind === "gap")) continue;
    const side = (...kinds: string[]) =>
      all.flatMap((row) => (kinds.includes(row.kind) && "text" in row ? [row.text] : []));
    expect([side("same", "old").join("\n"), side("same", "new").join("\n")]).toEqual([old, now]);
    expect(side("same")).toHaveLength(common(old.split("\n"), now.split("\n")));
  }
});

test("texts that differ in thousands of lines are one change, at once", () => {
  const [old, now] = ["a", "b"].map((letter) => Array.from({ length: 1500 }, (_, i) => letter + i));
  const all = diffRows(["x", ...(old ?? []), "y"].join("\n"), ["x", ...(now ?? []), "y"].join("\n"));
  expect(all.map(({ kind }) => kind)).toEqual([
    "same",
    ...Array<string>(1500).fill("old"),
    ...Array<string>(1500).fill("new"),
    "same",
  ]);
});

test("side by side, removed lines are next to the added ones that follow them", () => {
  const pairs = sideBySide(diffRows("a\nb\nc\nd", "a\nx\nd\ne")).map((pair) => [written(pair.old), written(pair.new)]);
  expect(pairs).toEqual([
    [" 1/1 a", " 1/1 a"],
    ["-2 b", "+2 x"],
    ["-3 c", ""],
    [" 4/3 d", " 4/3 d"],
    ["", "+4 e"],
  ]);
});
