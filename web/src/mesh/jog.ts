// A jog of the tool: from a press to its release, with keep-alives from this thread.
//
// The gateway holds the arm when no keep-alive arrives. So they are sent from the thread that shows the page and hears
// the release: if it freezes, they end. The next one follows the answer to the last, so a slow network ends the jog.

import type { MessageInitShape } from "@bufbuild/protobuf";
import type { JogSchema } from "../gen/robomesh_pb";
import { Jog_Axis as Axis, Jog_Frame as Frame, JogAnswerSchema, JogRequestSchema } from "../gen/robomesh_pb";
import { fixed, toDegrees } from "../i18n/format";
import { reasonText } from "../i18n/reasons";
import { t } from "../i18n/texts";
import { Command, command, newestCommand } from "./command";
import { AskError, ask } from "./connection";
import type { Notice } from "./control";
import { heldLease, reasonOf } from "./control";
import { whyFrozen } from "./sight";

export { Axis as JogAxis, Frame as JogFrame };
export type Jog = MessageInitShape<typeof JogSchema>;

const EVERY_MS = 40;
const ANSWERED_S = 0.5;
const MOST_UNANSWERED = 4;
const WATCH_MS = 20;

/** A jog that was pressed. */
export interface Pressed {
  release: () => void;
  /** Settles when the arm rests, or nothing was started. */
  over: Promise<void>;
}

/** Jog when an earlier jog is over, until `release`, a frozen picture, a dialog, or the gateway ends it; tell how far it is and why it ended. */
export function startJog(
  robotKey: string,
  jog: Jog,
  what: string,
  tell: (notice: Notice) => void,
  earlier?: Pressed | null,
): Pressed {
  let released = false;
  let wake = () => {};
  const release = () => {
    released = true;
    wake();
  };
  const pause = (ms: number) =>
    new Promise<void>((resolve) => {
      const timer = setTimeout(resolve, ms);
      if (released) return;
      wake = () => (clearTimeout(timer), resolve());
    });

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
      released ||= mine?.lease !== heldLease.value?.lease || whyFrozen(robotKey) !== "" || dialogIsOpen();
      try {
        const answer = await send();
        const distance = `${answer.rotary ? fixed(toDegrees(answer.moved), 1) : fixed(answer.moved * 1000, 1)}${answer.rotary ? "°" : "\u202fmm"}`;
        if (!answer.running) {
          const why = reasonText(answer.reason, answer.text);
          tell({ kind: "done", text: t("jog_ended", { what, distance, why }), ...(warning && { warning }) });
          return;
        }
        tell({ kind: "busy", text: t("jog_runs", { what, distance }) });
      } catch (error) {
        released = true;
        if (!(error instanceof AskError && error.noAnswer) || ++unanswered > MOST_UNANSWERED) {
          tell({ kind: "refused", text: t("jog_lost", { what, why: reasonOf(error) }) });
          return;
        }
      }
      await pause(Math.max(0, sentAt + EVERY_MS - performance.now()));
    }
  };
  return { release, over: run() };
}

const dialogIsOpen = () => document.querySelector("dialog[open]") !== null;
