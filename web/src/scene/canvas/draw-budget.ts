// The share of time that 3-D may take, so that the rest of the page, and control, have enough on a slow machine.
//
// The rate gives way first, down to a few frames a second, then the quality, and at the lowest quality the rate again.
// Quality returns slowly.

const PAUSE_FACTOR = 3; // pause after a slow frame, in its durations
const LONGEST_PAUSE_MS = 360;
const LONGEST_COARSE_PAUSE_MS = 2000; // at the lowest quality
// The first frame, and the first after the page was hidden, are slow on every machine.
const MANY_SLOW_FRAMES = 3;
const SHORTEST_TRIAL_MS = 10_000;
const LONGEST_TRIAL_MS = 120_000;

/** A way to draw. */
export interface Quality {
  pixelRatio: number;
  shadows: boolean;
  /** Slower frames need a lower quality [ms]. */
  slowMs: number;
}

const SLOW_MS = 50; // a slower frame holds up the rest of the page
const TOO_SLOW_MS = LONGEST_PAUSE_MS / PAUSE_FACTOR; // a slower frame takes too much even at the lowest rate
const FINEST_PIXELS = 2;
const COARSER: readonly Quality[] = [1, 0.7, 0.5].map((pixelRatio) => ({
  pixelRatio,
  shadows: false,
  slowMs: TOO_SLOW_MS,
}));

/** Return the qualities of a machine, the best first; a software renderer spares shadows and extra pixels. */
export function qualities(software: boolean): readonly Quality[] {
  if (software) return COARSER;
  return [{ pixelRatio: Math.min(devicePixelRatio, FINEST_PIXELS), shadows: true, slowMs: SLOW_MS }, ...COARSER];
}

export class DrawBudget {
  private level = 0;
  private slowFrames = 0; // in a row
  private fastSince: number | null = null;
  private trialMs = SHORTEST_TRIAL_MS;
  private raisedAt = Number.NEGATIVE_INFINITY;

  /** `levels`: the best first, at least one. */
  constructor(private readonly levels: readonly Quality[]) {}

  get best(): Quality {
    return this.levels[0] as Quality;
  }

  get quality(): Quality {
    return this.levels[this.level] as Quality;
  }

  /** Take a frame's duration [ms] and the time of its end; return the pause that must follow it [ms]. */
  take(tookMs: number, at: number): number {
    this.slowFrames = tookMs < this.quality.slowMs ? 0 : this.slowFrames + 1;
    if (this.slowFrames >= MANY_SLOW_FRAMES) this.lower(at);
    // The next better quality draws about twice as many pixels.
    if (tookMs > SLOW_MS / 2) this.fastSince = null;
    else this.fastSince ??= at;
    if (this.fastSince !== null && at - this.fastSince > this.trialMs) this.raise(at);
    const longest = this.level + 1 === this.levels.length ? LONGEST_COARSE_PAUSE_MS : LONGEST_PAUSE_MS;
    return tookMs < SLOW_MS ? 0 : Math.min(PAUSE_FACTOR * tookMs, longest);
  }

  private lower(at: number): void {
    this.slowFrames = 0;
    if (this.level + 1 === this.levels.length) return;
    this.level++;
    // A better quality that was soon too slow is tried again later and later.
    const soon = at - this.raisedAt < this.trialMs;
    this.trialMs = soon ? Math.min(2 * this.trialMs, LONGEST_TRIAL_MS) : SHORTEST_TRIAL_MS;
  }

  private raise(at: number): void {
    this.fastSince = at;
    if (this.level === 0) return;
    this.level--;
    this.raisedAt = at;
  }
}
