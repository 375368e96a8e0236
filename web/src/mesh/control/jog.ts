// A jog of the tool: from a press to its release, with keep-alives from this thread.
//
// The gateway holds the arm when no keep-alive arrives. So they are sent from the thread that shows the page and hears
// the release: if it freezes, they end. The next one follows the answer to the last, so a slow network ends the jog.

import type { MessageInitShape } from "@bufbuild/protobuf";
import type { JogSchema } from "../../gen/robomesh_pb";
import { Jog_Axis as Axis, Jog_Frame as Frame, JogAnswerSchema, JogRequestSchema } from "../../gen/robomesh_pb";
import { fixed, toDegrees } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import { t } from "../../i18n/texts";
import { AskError, ask, reasonOf } from "../console/connection";
import { Command, command, newestCommand } from "./command";
import type { Notice } from "./control";
import { heldLease } from "./control";
import { frozenCause } from "./display-freshness";

export { Axis as JogAxis, Frame as JogFrame };
export type Jog = MessageInitShape<typeof JogSchema>;

const EVERY_MS = 40;
const ANSWERED_S = 0.5;
const MOST_UNANSWERED = 4;
const WATCH_MS = 20;
const LATE_MS = 75; // a shorter delay ends no jog
/** Ends of which this page may know more than the gateway. */
const RELEASED = "jog.released";
const NOT_ALIVE = "jog.not_alive";

/** A jog that was pressed. */
export interface Pressed {
  /** End it; `why` in words, empty: the operator let go. */
  release: (why: string) => void;
  /** Settles when the arm rests, or nothing was started. */
  over: Promise<void>;
}

/** Jog when an earlier jog is over, until `release`, a frozen picture, or the gateway ends it; show how far it is and why it ended. */
export function startJog(
  robotKey: string,
  jog: Jog,
  what: string,
  tell: (notice: Notice) => void,
  earlier?: Pressed | null,
): Pressed {
  let released = false;
  let ended = ""; // why, as far as this page knows
  let wake = () => {};
  const release = (why: string) => {
    if (!released) ended = why;
    released = true;
    wake();
  };
  const pause = (ms: number) =>
    new Promise<void>((resolve) => {
      const timer = setTimeout(resolve, ms);
      if (released) return;
      wake = () => (clearTimeout(timer), resolve());
    });

  const delays = new Delays();
  const run = async () => {
    await earlier?.over;
    if (released) return;
    const mine = heldLease.value;
    let begun: boolean | null = null;
    let warning: string | undefined;
    const starting = command(robotKey, Command.JOG, what, { jog }, (notice) => {
      warning = notice.warning ?? warning;
      if (notice.kind === "refused") tell(notice);
    });
    const id = newestCommand();
    void starting.then((accepted) => {
      begun = accepted;
      wake();
    });
    let sequence = 0n;
    const send = () => {
      const request = { lease: mine?.lease ?? "", jog: id, sequence: ++sequence, release: released };
      return ask(`${robotKey}/jog/${mine?.operator}`, JogRequestSchema, request, JogAnswerSchema, ANSWERED_S);
    };
    // A release during the check of the way takes the start back.
    while (begun === null && !released) await pause(WATCH_MS);
    if (begun === null) await send().catch(() => {});
    if (!(await starting)) return;

    let unanswered = 0;
    for (;;) {
      const sentAt = performance.now();
      const why = mine?.lease === heldLease.value?.lease ? frozenCause(robotKey) : t("jog_no_control");
      if (why) release(why);
      try {
        const answer = await send().finally(() => delays.answered(sentAt));
        if (answer.reason?.code === NOT_ALIVE) release(delays.text());
        const distance = `${answer.rotary ? fixed(toDegrees(answer.moved), 1) : fixed(answer.moved * 1000, 1)}${answer.rotary ? "°" : "\u202fmm"}`;
        if (!answer.running) {
          const known = [RELEASED, NOT_ALIVE].includes(answer.reason?.code ?? "") ? ended : "";
          const why = known || reasonText(answer.reason, answer.text);
          tell({ kind: "done", text: t("jog_ended", { what, distance, why }), ...(warning && { warning }) });
          return;
        }
        tell({ kind: "busy", text: t("jog_runs", { what, distance }) });
      } catch (error) {
        released = true;
        if (!(error instanceof AskError && error.noAnswer) || ++unanswered > MOST_UNANSWERED) {
          tell({ kind: "refused", text: t("jog_lost", { what, why: ended || reasonOf(error) }) });
          return;
        }
      }
      await pause(Math.max(0, sentAt + EVERY_MS - performance.now()));
    }
  };
  return { release, over: run().finally(() => delays.stop()) };
}

/** Delays of the newest keep-alives: of their answers, and of this browser's own timers. */
class Delays {
  private waitsMs = [0, 0];
  private stallsMs = [0, 0];
  private stallMs = 0;
  private tickedAt = performance.now();
  private readonly timer = setInterval(() => this.tick(), WATCH_MS);

  answered(sentAt: number): void {
    this.tick();
    this.waitsMs = [performance.now() - sentAt, this.waitsMs[0] ?? 0];
    this.stallsMs = [this.stallMs, this.stallsMs[0] ?? 0];
    this.stallMs = 0;
  }

  /** Return which of both was late, and by how much; empty: neither. */
  text(): string {
    const [lateMs, busyMs] = [Math.max(...this.waitsMs) - EVERY_MS, Math.max(...this.stallsMs) - WATCH_MS];
    const worstMs = Math.max(lateMs, busyMs);
    if (worstMs < LATE_MS) return "";
    return t(busyMs > worstMs / 2 ? "jog_busy" : "jog_late", { seconds: fixed(worstMs / 1000, 1) });
  }

  stop(): void {
    clearInterval(this.timer);
  }

  private tick(): void {
    const now = performance.now();
    this.stallMs = Math.max(this.stallMs, now - this.tickedAt);
    this.tickedAt = now;
  }
}
