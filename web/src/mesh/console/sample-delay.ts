// Delay of a sample on its way to this page: the rule of `publications/delay.py`, for the page's own connection.

interface Least {
  publisher: bigint;
  lag: number;
  last: number;
  at: number;
  alone: boolean;
}
const least = new Map<string, Least>();

// The smallest lag may grow as fast as a clock is slewed, but not during a silence.
const DRIFT = 1e-3;
const MOST_GROWN_MS = 1000;
// No sample waits longer: a second, later one shows that the first was dated ahead.
const MOST_WAITED_MS = 10_000;

/** Return a sample's delay [ms] beyond its publisher's fastest; `arrived` is on any monotonic clock. */
export function sampleDelay(key: string, publisher: bigint, sourceTime: number, arrived: number): number {
  // Replays carry the recording's times, and some publishers give none.
  if (sourceTime === 0 || key.includes("/replay-")) return 0;
  const lag = arrived - sourceTime;
  const before = least.get(key);
  if (before?.publisher !== publisher) {
    least.set(key, { publisher, lag, last: lag, at: arrived, alone: true });
    return 0;
  }
  const grown = Math.min(Math.max(arrived - before.at, 0), MOST_GROWN_MS) * DRIFT;
  const leastOfAll = before.lag + grown;
  // A single sample dated ahead must not make the others late.
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
