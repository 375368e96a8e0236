// The order of a robot's parts from base to tool, guessed from the names of their files and from which parts touch.

/** A file with the points of its surface, [m], all parts in one frame with z up. */
export interface UnorderedPart {
  path: string;
  points: readonly (readonly number[])[];
}

export interface PartOrder {
  paths: readonly string[];
  /** How it was guessed; "alphabet": neither names nor geometry say anything. */
  by: "names" | "geometry" | "both" | "alphabet";
  /** Paths that were placed by geometry, or, without one, after the others. */
  unnamed: readonly string[];
}

type Scheme = "base" | "number" | "word" | "end" | null;
interface Key {
  scheme: Scheme;
  /** Compared one by one. */
  rank: readonly number[];
}

const BASE_WORDS = /^(base|foot|pedestal|socle|socket|plinth|ground|stand|sockel|基座|底座)$/;
const END_WORDS: readonly RegExp[] = [
  /^(hand|flange|head|bracelet|法兰|手)$/,
  /^(tool|gripper|ee|effector|endeffector|tcp|工具|夹爪)$/,
  /^((left|right)?fingers?|jaw|tip|手指)$/,
];
const WORDS: readonly RegExp[] = [
  /^(column|waist|turret|swivel|carousel|carriage|rotating|turntable|karussell|立柱|腰部?|转台|转盘)$/,
  /^(shoulder|schulter|肩部?)$/,
  /^(upperarm|bigarm|arm|oberarm|大臂|上臂)$/,
  /^(elbow|ellbogen|肘部?)$/,
  /^(forearm|smallarm|unterarm|小臂|前臂)$/,
  /^(wrist|handgelenk|腕部?)$/,
];
const NUMBERED = /^(link|joint|j|l|a|axis|axe|ax|achse|arm|part|body|seg|segment|glied|member|关节|连杆|轴)$/;
const NATURAL = new Intl.Collator("en", { numeric: true, sensitivity: "base" });
/** Parts up to which every order is compared; more are taken one after the other. */
const MOST_COMPARED = 12;
const APART = 0.04; // of the robot's size: farther parts do not touch

/** Guess the order of parts, base first. */
export function guessOrder(parts: readonly UnorderedPart[]): PartOrder {
  const sorted = [...parts].sort((one, other) => NATURAL.compare(stemOf(one.path), stemOf(other.path)));
  const keys = keysOf(sorted.map(({ path }) => path));
  const named = sorted
    .map((part, index) => ({ part, key: keys[index] as Key }))
    .filter(({ key }) => key.scheme !== null)
    .sort((one, other) => compare(one.key.rank, other.key.rank))
    .map(({ part }) => part);
  const chain = keys.filter(({ scheme }) => scheme === "number" || scheme === "word").length;
  const others = sorted.filter((part) => !named.includes(part));
  const unnamed = others.map(({ path }) => path);
  const paths = (order: readonly UnorderedPart[]) => order.map(({ path }) => path);
  if (others.length === 0) return { paths: paths(named), by: "names", unnamed };
  const gaps = gapsOf(sorted);
  if (!gaps) {
    // Ends stay last.
    const ends = named.filter((part) => keys[sorted.indexOf(part)]?.scheme === "end");
    const before = named.filter((part) => !ends.includes(part));
    return { paths: paths([...before, ...others, ...ends]), by: named.length > 0 ? "names" : "alphabet", unnamed };
  }
  const index = (part: UnorderedPart) => sorted.indexOf(part);
  const first = named[0] && keys[index(named[0])]?.scheme === "base" ? named[0] : undefined;
  if (chain === 0) {
    const found = shortestPath(gaps, first ? index(first) : null, index(lowest(sorted)));
    const order = found.map((at) => sorted[at] as UnorderedPart);
    if (!first && isTool(order[0] as UnorderedPart, order.at(-1) as UnorderedPart)) order.reverse();
    return { paths: paths(order), by: first ? "both" : "geometry", unnamed };
  }
  const order = [...named];
  for (const part of others) order.splice(bestPlace(order.map(index), index(part), gaps), 0, part);
  return { paths: paths(order), by: "both", unnamed };
}

function compare(one: readonly number[], other: readonly number[]): number {
  const at = one.findIndex((value, index) => value !== other[index]);
  return at < 0 ? 0 : (one[at] as number) - (other[at] ?? 0);
}

/** Return a file's name without its folder and ending. */
export function stemOf(path: string): string {
  return path.replace(/^.*[/\\]/, "").replace(/(\.[^.]*){1,2}$/, "");
}

/** Return the words and numbers of a file's name: "gp8_link_04_r.stl" → gp, 8, link, 04, r. */
function tokensOf(path: string): string[] {
  return (
    stemOf(path)
      .normalize("NFKC")
      .replace(/(\p{Ll})(\p{Lu})/gu, "$1 $2")
      .toLowerCase()
      .match(/\d+|[a-z]+|\p{Script=Han}+/gu) ?? []
  );
}

function keysOf(paths: readonly string[]): Key[] {
  const all = paths.map(tokensOf);
  // What every name begins with is the robot's: its number is no joint's.
  let common = 0;
  const begins = (at: number) =>
    all.length > 1 && all.every((tokens) => tokens.length > at + 1 && tokens[at] === all[0]?.[at]);
  while (begins(common)) common++;
  const found = all.map((tokens) => keyOf(tokens.slice(common), tokens[common - 1] ?? ""));
  const numbers = found.filter(({ base, number }) => !base && number !== null).length;
  const words = found.filter(({ word }) => word !== null).length;
  const byNumber = numbers > words || (numbers === words && found.every(({ base, sure }) => base || sure));
  const forearm = all.some((tokens) => tokens.join("").includes("forearm"));
  return found.map(({ base, end, number, sure, word, part }): Key => {
    if (base) return { scheme: "base", rank: [0] };
    if (end !== null && !sure) return { scheme: "end", rank: [2, end, number?.[0] ?? 0] };
    const own = byNumber ? number : word === null ? null : [word, part, number?.[0] ?? 0];
    if (own) return { scheme: byNumber ? "number" : "word", rank: [1, ...armFirst(own, forearm)] };
    if (end !== null) return { scheme: "end", rank: [2, end] };
    return { scheme: null, rank: [] };
  });
}

/** An industrial arm's lower arm comes before its upper arm; where there is a forearm, the upper arm comes first. */
function armFirst(rank: readonly number[], forearm: boolean): readonly number[] {
  const [word = 0, part = 0, ...rest] = rank;
  return word === 2 && !forearm && part !== 0 ? [word, -part, ...rest] : rank;
}

interface Found {
  base: boolean;
  end: number | null;
  /** The number, and one for a letter after it: "3a". */
  number: readonly number[] | null;
  /** Whether a word such as "link" is before the number. */
  sure: boolean;
  word: number | null;
  /** -1: upper, 1: lower. */
  part: number;
}

function keyOf(tokens: readonly string[], before: string): Found {
  const two = tokens.map((token, index) => token + (tokens[index + 1] ?? ""));
  const rank = (words: readonly RegExp[]) => {
    const double = words.findIndex((word) => two.some((token) => word.test(token)));
    const single = words.findLastIndex((word) => tokens.some((token) => word.test(token)));
    const at = double >= 0 && tokens.length > 1 ? double : single;
    return at < 0 ? null : at;
  };
  const after = tokens.findIndex(
    (token, index) => /^\d+$/.test(token) && NUMBERED.test(tokens[index - 1] ?? (index === 0 ? before : "")),
  );
  const at = after >= 0 ? after : tokens.findIndex((token) => /^\d+$/.test(token));
  const letter =
    /^[a-z]$/.test(tokens[at + 1] ?? "") && at + 1 < tokens.length ? (tokens[at + 1]?.charCodeAt(0) ?? 0) : 0;
  const number = at < 0 ? null : [Number(tokens[at]), letter];
  const word = rank(WORDS);
  const end = END_WORDS.findIndex((words) => tokens.some((token) => words.test(token)));
  return {
    base: tokens.some((token) => BASE_WORDS.test(token)) || (word === null && number?.[0] === 0),
    end: end < 0 ? null : end,
    number,
    sure: after >= 0,
    word,
    part: tokens.includes("upper") || two.includes("upperarm") ? -1 : tokens.includes("lower") ? 1 : 0,
  };
}

/** Return the gap between each two parts, of the robot's size; null: their places say nothing, for each part is drawn
 * about its own origin, or one part has no surface. */
function gapsOf(parts: readonly UnorderedPart[]): number[][] | null {
  if (parts.length < 2 || parts.some(({ points }) => points.length === 0)) return null;
  const all = parts.flatMap(({ points }) => points);
  const span = (axis: number) => {
    const values = all.map((point) => point[axis] ?? 0);
    return Math.max(...values) - Math.min(...values);
  };
  const size = Math.hypot(span(0), span(1), span(2)) || 1;
  const gaps = parts.map((one) => parts.map((other) => (one === other ? 0 : gap(one.points, other.points) / size)));
  if (parts.length === 2) return gaps;
  const apart = gaps.some((row) => row.some((value) => value > APART));
  // Every part must reach the base by parts that touch.
  const met = new Set([0]);
  for (const at of met) for (const next of parts.keys()) if ((gaps[at]?.[next] ?? 1) <= APART) met.add(next);
  return apart && met.size === parts.length ? gaps : null;
}

function gap(one: UnorderedPart["points"], other: UnorderedPart["points"]): number {
  let least = Number.POSITIVE_INFINITY;
  for (const [x = 0, y = 0, z = 0] of one) {
    for (const [u = 0, v = 0, w = 0] of other) {
      const square = (x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2;
      if (square < least) least = square;
    }
  }
  return Math.sqrt(least);
}

/** Return a part's lowest height, and its extent. */
function boundsOf({ points }: UnorderedPart): { low: number; extent: number } {
  const sides = [0, 1, 2].map((axis) => points.map((point) => point[axis] ?? 0));
  const extent = Math.hypot(...sides.map((values) => Math.max(...values) - Math.min(...values)));
  return { low: Math.min(...(sides[2] ?? [])), extent };
}

function lowest(parts: readonly UnorderedPart[]): UnorderedPart {
  return [...parts].sort((one, other) => boundsOf(one).low - boundsOf(other).low)[0] as UnorderedPart;
}

/** Return whether of a chain's two ends the first is the tool: the smaller if they differ much, else the higher. */
function isTool(first: UnorderedPart, last: UnorderedPart): boolean {
  const [one, other] = [boundsOf(first), boundsOf(last)];
  const ratio = one.extent / (other.extent || 1);
  return ratio < 0.67 || (ratio < 1.5 && one.low > other.low);
}

/** Return the order of all parts with the smallest gaps, the largest counting most.
 *
 * @param first The first part; null: any, or `low` where there are too many parts to compare every order. */
function shortestPath(gaps: readonly (readonly number[])[], first: number | null, low: number): number[] {
  const count = gaps.length;
  const cost = (one: number, other: number) => (gaps[one]?.[other] ?? 0) ** 2;
  if (count > MOST_COMPARED) {
    const order = [first ?? low];
    while (order.length < count) {
      const last = order.at(-1) as number;
      const left = [...gaps.keys()].filter((each) => !order.includes(each));
      order.push(left.sort((one, other) => cost(last, one) - cost(last, other))[0] as number);
    }
    return order;
  }
  interface Way {
    cost: number;
    order: number[];
  }
  // By the set of visited parts and the last of them; longer ways come after all shorter ones.
  const best = new Map<string, Way>();
  for (const each of first === null ? gaps.keys() : [first])
    best.set(`${1 << each} ${each}`, { cost: 0, order: [each] });
  let whole: Way | undefined;
  for (const [key, way] of best) {
    const visited = Number(key.split(" ")[0]);
    const last = way.order.at(-1) as number;
    if (way.order.length === count && (!whole || way.cost < whole.cost)) whole = way;
    for (let next = 0; next < count; next++) {
      if (visited & (1 << next)) continue;
      const to = `${visited | (1 << next)} ${next}`;
      const sum = way.cost + cost(last, next);
      const known = best.get(to);
      if (known && known.cost <= sum) continue;
      const found = { cost: sum, order: [...way.order, next] };
      if (known) Object.assign(known, found);
      else best.set(to, found);
    }
  }
  return whole?.order ?? [...gaps.keys()];
}

/** Return where a part lengthens the way through an order least; never before the first. */
function bestPlace(order: readonly number[], part: number, gaps: readonly (readonly number[])[]): number {
  const cost = (one: number | undefined, other: number | undefined) =>
    one === undefined || other === undefined ? 0 : (gaps[one]?.[other] ?? 0) ** 2;
  const places = order.map((before, index) => {
    const after = order[index + 1];
    return { at: index + 1, more: cost(before, part) + cost(part, after) - cost(before, after) };
  });
  return places.sort((one, other) => one.more - other.more)[0]?.at ?? order.length;
}
