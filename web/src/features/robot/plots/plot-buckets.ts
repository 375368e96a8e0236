// A value's last minutes in a constant number of intervals, and the columns that a plot draws from them.

/** Intervals of a span; the minimum and the maximum of each keep every peak. */
export const INTERVALS = 6000;

type Cell = number | null | undefined;
/** Columns of a plot: times, then the lowest and the highest of each value; null breaks its line. */
export type Columns = [number[], ...Cell[][]];

/** The newest `span` seconds of one value. Its size never changes. */
export class Buckets {
  readonly width: number;
  private numbers = new Float64Array(INTERVALS).fill(-Infinity);
  private lowest = new Float64Array(INTERVALS);
  private highest = new Float64Array(INTERVALS);

  constructor(readonly span: number) {
    this.width = span / INTERVALS;
  }

  /** Add a number, or the range of several, at a time [s]. Adding it again changes nothing. */
  take(at: number, low: number, high = low): void {
    const number = Math.floor(at / this.width);
    const i = index(number);
    const before = this.numbers[i] ?? -Infinity;
    if (before > number) return;
    if (before < number) {
      this.numbers[i] = number;
      this.lowest[i] = low;
      this.highest[i] = high;
      return;
    }
    if (low < (this.lowest[i] ?? 0)) this.lowest[i] = low;
    if (high > (this.highest[i] ?? 0)) this.highest[i] = high;
  }

  /** Add what others know, of a shorter span. */
  takeAll(others: Buckets): void {
    for (const [i, number] of others.numbers.entries())
      if (number > -Infinity) this.take((number + 0.5) * others.width, others.lowest[i] ?? 0, others.highest[i] ?? 0);
  }

  copy(): Buckets {
    const made = new Buckets(this.span);
    made.numbers = this.numbers.slice();
    made.lowest = this.lowest.slice();
    made.highest = this.highest.slice();
    return made;
  }

  /** Return the lowest and highest value of the newest interval before a time [s] that has data, not more than `back` s before it. */
  newest(at: number, back: number): { low: number; high: number } | null {
    const last = Math.floor(at / this.width);
    for (let number = last; number > last - Math.ceil(back / this.width); number--) {
      const i = index(number);
      if (this.numbers[i] === number) return { low: this.lowest[i] ?? 0, high: this.highest[i] ?? 0 };
    }
    return null;
  }

  /** Put the numbers from `first` on into columns of `count` intervals each.
   *
   * @param holds Data that are further apart are not connected [s]. */
  into(low: Cell[], high: Cell[], first: number, count: number, holds: number, factor: number): void {
    low.fill(undefined);
    high.fill(undefined);
    const apart = Math.max(1, holds / this.width);
    let before = -Infinity;
    for (let number = first; number < first + low.length * count; number++) {
      const i = index(number);
      if (this.numbers[i] !== number) continue;
      const column = Math.floor((number - first) / count);
      if (number - before > apart && before > -Infinity) {
        // Between the two; if they are in neighbouring columns, the gap is narrower than a pixel.
        const gap = Math.floor((before - first) / count) + 1;
        if (gap < column) low[gap] = high[gap] = null;
      }
      before = number;
      const least = (this.lowest[i] ?? 0) * factor;
      const most = (this.highest[i] ?? 0) * factor;
      const shown = low[column];
      if (shown === undefined || shown === null || least < shown) low[column] = least;
      const top = high[column];
      if (top === undefined || top === null || most > top) high[column] = most;
    }
  }
}

function index(number: number): number {
  return ((number % INTERVALS) + INTERVALS) % INTERVALS;
}

/** A value to draw. */
export interface Drawn {
  buckets: Buckets;
  holds: number;
  factor: number;
}

/** Return the columns of values of one span between two times, at most about `most`.
 *
 * @param reused Earlier columns: their arrays are filled again. */
export function columnsOf(drawn: readonly Drawn[], from: number, to: number, most: number, reused: Columns): Columns {
  const width = drawn[0]?.buckets.width ?? 1;
  const count = Math.max(1, Math.ceil((to - from) / width / Math.max(1, most)));
  const first = Math.floor(from / width / count) * count;
  const columns = Math.ceil((to / width - first) / count) + 1;
  const [times] = reused;
  times.length = columns;
  for (let i = 0; i < columns; i++) times[i] = (first + (i + 0.5) * count) * width;
  reused.length = 1;
  for (const { buckets, holds, factor } of drawn) {
    const low: Cell[] = new Array(columns);
    const high: Cell[] = new Array(columns);
    buckets.into(low, high, first, count, holds, factor);
    reused.push(low, high);
  }
  return reused;
}
