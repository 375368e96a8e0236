// Stalls of this page: gaps in which its timers did not run, because the browser or the machine was too slow.

const TICK_MS = 100;
const STALL_MS = 500;
const KEPT_MS = 4000; // as long as the longest lease
const SLOW_FOR_MS = 60_000; // after a stall

let slowUntil = 0;
let tickedAt = performance.now();
let stalls: { ms: number; endedAt: number }[] = [];

/** Measure stalls from now on. */
export function measureStalls(): void {
  setInterval(() => {
    const now = performance.now();
    const gap = now - tickedAt;
    tickedAt = now;
    if (gap <= STALL_MS) return;
    slowUntil = now + SLOW_FOR_MS;
    stalls = [...stalls.filter(({ endedAt }) => now - endedAt < KEPT_MS), { ms: gap, endedAt: now }];
  }, TICK_MS);
}

/** Return whether this page stalled within the last minute. */
export const isSlow = (): boolean => performance.now() < slowUntil;

/** Return whether this page stalled for most of a time that ends now, so that it caused a delay itself. */
export function wasStalled(durationMs: number): boolean {
  const now = performance.now();
  const recent = stalls.filter(({ endedAt }) => now - endedAt < durationMs);
  return recent.reduce((total, { ms }) => total + ms, now - tickedAt) > durationMs / 2;
}
