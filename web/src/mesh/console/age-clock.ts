// Clock for ages. Unlike `performance.now` in some browsers, it advances while the machine sleeps.

const SLEPT_MS = 1000;

let sleptMs = 0;
let apart = Date.now() - performance.now();

/** Return this page's time [ms]; it never decreases.
 *
 * A clock that is set ahead looks like sleep: data is then stale until the next message. */
export function ageClock(): number {
  const now = Date.now() - performance.now();
  if (now - apart > SLEPT_MS) sleptMs += now - apart;
  apart = now;
  return performance.now() + sleptMs;
}
