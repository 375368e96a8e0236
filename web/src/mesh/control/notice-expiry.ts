// End of a message: with its motion if it is about one, otherwise after a time.

import { useEffect, useRef } from "preact/hooks";
import { t } from "../../i18n/texts";
import { newestMotion } from "./command";
import type { Notice } from "./control";

const REACHED = 0.002; // rad or m: half of what the page displays
const START_TIMEOUT_MS = 1500;
const SHOWN_MS = { done: 8_000, refused: 30_000 };

/** The known state of the operator's motion. */
export interface Motion {
  /** A motion is running or on hold. */
  running: boolean;
  /** A stop or a fault ended it, and is shown itself. */
  stopped: boolean;
  /** Joint positions [rad] or [m]. */
  positions: readonly (number | undefined)[];
}

export function useNoticeExpiry(notice: Notice | null, tell: (notice: Notice | null) => void, motion: Motion): void {
  const ran = useRef<Notice | null>(null);
  const positions = useRef(motion.positions);
  positions.current = motion.positions;
  const { running, stopped } = motion;
  const overtaken = !!notice?.target && notice.target.id < newestMotion.value;
  useEffect(() => {
    if (!notice || notice.kind === "busy" || notice.kind === "lost") return;
    const { target, warning } = notice;
    const warned = warning ? { warning } : {};
    if (!target) {
      const timer = setTimeout(() => tell(null), SHOWN_MS[warning ? "refused" : notice.kind]);
      return () => clearTimeout(timer);
    }
    if (stopped) return tell(null);
    const isThere = () => target.positions.every((each, i) => Math.abs(each - (positions.current[i] ?? NaN)) < REACHED);
    // A later motion has begun: this one will not reach its target.
    if (overtaken)
      return tell(isThere() ? { kind: "done", text: t("motion_done", { what: target.what }), ...warned } : null);
    if (running) {
      ran.current = notice;
      return;
    }
    const end = () => {
      const there = isThere();
      const text = t(there ? "motion_done" : "motion_ended", { what: target.what });
      tell({ kind: there ? "done" : "refused", text, ...warned });
    };
    // The state that reports it may still be on its way.
    const timer = setTimeout(end, ran.current === notice ? 0 : START_TIMEOUT_MS);
    return () => clearTimeout(timer);
  }, [notice, running, stopped, overtaken]);
}
