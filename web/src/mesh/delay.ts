// How late a sample comes to this page: the same rule as in `robomesh/delay.py`, for the page's own line.

interface Least {
  publisher: bigint;
  lag: number;
  last: number;
  at: number;
  alone: boolean;
}
const least = new Map<string, Least>();

// The least lag may grow as fast as clocks part while one is being set, but not over a silence.
const DRIFT = 1e-3;
const MOST_GROWN_MS = 1000;
// Nothing waits longer on its way: a second sample that is later tells that the first was dated ahead.
const MOST_WAITED_MS = 10_000;

/** How much longer [ms] a sample was on its way than its publisher's quickest; `arrived` on any monotonic clock. */
export function lateness(key: string, publisher: bigint, sourceTime: number, arrived: number): number {
  // A recording played back has the times of then; and some publishers tell none.
  if (sourceTime === 0 || key.includes("/replay-")) return 0;
  const lag = arrived - sourceTime;
  const before = least.get(key);
  if (before?.publisher !== publisher) {
    least.set(key, { publisher, lag, last: lag, at: arrived, alone: true });
    return 0;
  }
  const grown = Math.min(Math.max(arrived - before.at, 0), MOST_GROWN_MS) * DRIFT;
  const leastOfAll = before.lag + grown;
  // A single sample dated ahead makes no other late.
  const ofTwo = Math.max(lag, before.last);
  const datedAhead = before.alone && lag - leastOfAll > MOST_WAITED_MS;
  const now = {
    publisher,
    lag: datedAhead ? ofTwo : Math.min(leastOfAll, ofTwo),
    last: lag,
    at: arrived,
    alone: false,
  };
  least.set(key, now);
  return Math.max(lag - now.lag, 0);
}
