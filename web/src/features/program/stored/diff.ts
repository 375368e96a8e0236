// The difference of two texts: the fewest changed lines (Myers, 1986), as rows to show.

const MOST_CHANGES = 1000; // texts with more are one change, from the first changed line to the last
const CONTEXT = 3;

/** A line of both texts, of the old one, or of the new one; or a number of equal lines that are left out. */
export type Row =
  | { kind: "same"; old: number; new: number; text: string }
  | { kind: "old"; old: number; text: string }
  | { kind: "new"; new: number; text: string }
  | { kind: "gap"; count: number };

/** A row of the display side by side: a line of each text, or one of them. */
export interface Pair {
  old: Row | null;
  new: Row | null;
}

/** Return the rows of a difference, with three equal lines around each change; none: the texts are equal. */
export function diffRows(oldText: string, newText: string): readonly Row[] {
  if (oldText === newText) return [];
  const rows = allRows(linesOf(oldText), linesOf(newText));
  const shown = new Set<number>();
  rows.forEach(({ kind }, at) => {
    if (kind !== "same") for (let near = at - CONTEXT; near <= at + CONTEXT; near++) shown.add(near);
  });
  const kept: Row[] = [];
  for (let at = 0; at < rows.length; at++) {
    const row = rows[at] as Row;
    if (shown.has(at)) kept.push(row);
    else {
      const before = kept.at(-1);
      if (before?.kind === "gap") before.count++;
      else kept.push({ kind: "gap", count: 1 });
    }
  }
  return kept;
}

/** Return rows for a display side by side: removed lines next to the added ones that follow them. */
export function sideBySide(rows: readonly Row[]): readonly Pair[] {
  const pairs: Pair[] = [];
  for (const row of rows) {
    if (row.kind !== "new") {
      pairs.push({ old: row, new: row.kind === "old" ? null : row });
      continue;
    }
    const from = pairs.findLastIndex((pair) => pair.new !== null) + 1;
    const free = pairs[from];
    if (free) free.new = row;
    else pairs.push({ old: null, new: row });
  }
  return pairs;
}

/** The end of a text's last line is a separate line, so that a missing line end shows. */
const linesOf = (text: string): readonly string[] => (text === "" ? [] : text.split("\n"));

function allRows(old: readonly string[], now: readonly string[]): readonly Row[] {
  const most = Math.min(old.length, now.length);
  let begin = 0;
  while (begin < most && old[begin] === now[begin]) begin++;
  let same = 0;
  while (same < most - begin && old.at(-1 - same) === now.at(-1 - same)) same++;
  const inner = keptLines(old.slice(begin, old.length - same), now.slice(begin, now.length - same));
  const kept: (readonly [number, number])[] = [
    ...Array.from({ length: begin }, (_, i) => [i, i] as const),
    ...inner.map(([x, y]) => [begin + x, begin + y] as const),
    ...Array.from({ length: same }, (_, i) => [old.length - same + i, now.length - same + i] as const),
  ];
  const rows: Row[] = [];
  let [x, y] = [0, 0];
  for (const [keptX, keptY] of [...kept, [old.length, now.length] as const]) {
    for (; x < keptX; x++) rows.push({ kind: "old", old: x + 1, text: old[x] ?? "" });
    for (; y < keptY; y++) rows.push({ kind: "new", new: y + 1, text: now[y] ?? "" });
    if (x < old.length && y < now.length) rows.push({ kind: "same", old: ++x, new: ++y, text: old[keptX] ?? "" });
  }
  // Both end with a line end: there is no line after it.
  const last = rows.at(-1);
  if (last?.kind === "same" && last.text === "") rows.pop();
  return rows;
}

/** Return the indices of the lines that both lists keep; none if too many differ. */
function keptLines(old: readonly string[], now: readonly string[]): readonly (readonly [number, number])[] {
  const furthest = new Map<number, number>([[1, 0]]);
  const trace: ReadonlyMap<number, number>[] = [];
  for (let count = 0; count <= Math.min(old.length + now.length, MOST_CHANGES); count++) {
    trace.push(new Map(furthest));
    for (let diagonal = -count; diagonal <= count; diagonal += 2) {
      let x = beginOf(furthest, diagonal, count);
      while (x < old.length && x - diagonal < now.length && old[x] === now[x - diagonal]) x++;
      furthest.set(diagonal, x);
      if (x >= old.length && x - diagonal >= now.length) return wayBack(trace, old.length, now.length);
    }
  }
  return [];
}

/** Whether a diagonal is reached furthest by inserting a line, not by removing one. */
function isInsertion(furthest: ReadonlyMap<number, number>, diagonal: number, count: number): boolean {
  if (Math.abs(diagonal) === count) return diagonal === -count;
  return (furthest.get(diagonal - 1) ?? 0) < (furthest.get(diagonal + 1) ?? 0);
}

function beginOf(furthest: ReadonlyMap<number, number>, diagonal: number, count: number): number {
  return isInsertion(furthest, diagonal, count)
    ? (furthest.get(diagonal + 1) ?? 0)
    : (furthest.get(diagonal - 1) ?? 0) + 1;
}

function wayBack(trace: readonly ReadonlyMap<number, number>[], x: number, y: number): (readonly [number, number])[] {
  const kept: (readonly [number, number])[] = [];
  for (let count = trace.length - 1; count >= 0; count--) {
    const furthest = trace[count] as ReadonlyMap<number, number>;
    const inserted = isInsertion(furthest, x - y, count);
    const begin = beginOf(furthest, x - y, count);
    while (x > begin && y > 0) kept.push([--x, --y]);
    if (inserted) y--;
    else x--;
  }
  return kept.reverse();
}
