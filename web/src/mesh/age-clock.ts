// The clock by which ages are told: it goes on while the machine sleeps, as `performance.now` does not everywhere.

const SLEPT_MS = 1000;

let sleptMs = 0;
let apart = Date.now() - performance.now();

/** Time on this page [ms], never backwards.
 *
 * A clock that was set ahead looks like sleep: what is known is then old until it comes anew. */
export function ageClock(): number {
  const now = Date.now() - performance.now();
  if (now - apart > SLEPT_MS) sleptMs += now - apart;
  apart = now;
  return performance.now() + sleptMs;
}
