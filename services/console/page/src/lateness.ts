// How late a sample comes to this page: the same rule as in `bus/lateness.py`, for the page's own line.

interface Least {
  publisher: bigint;
  lag: number;
  last: number;
  at: number;
}
const least = new Map<string, Least>();

// The least lag may grow as fast as clocks part while one is being set, but not over a silence.
const DRIFT = 1e-3;
const MOST_GROWN_MS = 1000;
// Clocks that are set by NTP differ by less.
const AHEAD_MS = 1000;

/** How much longer [ms] a sample was on its way than its publisher's quickest; `arrived` on any monotonic clock. */
export function lateness(key: string, publisher: bigint, sourceTime: number, arrived: number): number {
  // A recording played back has the times of then; and some publishers tell none.
  if (sourceTime === 0 || key.includes("/replay-")) return 0;
  const lag = arrived - sourceTime;
  const before = least.get(key);
  if (before?.publisher !== publisher) {
    // The first alone is believed, for the second may have waited; but not one that our own clock has still to come to.
    const ahead = sourceTime > Date.now() + AHEAD_MS;
    least.set(key, { publisher, lag: ahead ? Infinity : lag, last: lag, at: arrived });
    return 0;
  }
  const grown = Math.min(Math.max(arrived - before.at, 0), MOST_GROWN_MS) * DRIFT;
  // A single sample dated ahead makes no other late.
  const now = { publisher, lag: Math.min(before.lag + grown, Math.max(lag, before.last)), last: lag, at: arrived };
  least.set(key, now);
  return Math.max(lag - now.lag, 0);
}
