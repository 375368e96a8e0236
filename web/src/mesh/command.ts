// Commands to the robot that this tab is in control of.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { signal } from "@preact/signals";
import { CommandRequest_Command as Command, CommandAnswerSchema, CommandRequestSchema } from "../gen/robomesh_pb";
import { reasonText } from "../i18n/reasons";
import { t } from "../i18n/texts";
import { ask } from "./connection";
import type { Notice } from "./control";
import { controlNotice, held, reasonOf } from "./control";

/** Values of a command beyond its name. */
export interface CommandValues {
  jointPositions?: number[];
  speedPercent?: number;
  stopId?: bigint;
  program?: string;
  programName?: string;
}

const VALID_MS = 1000;
const ANSWERED_S = 2;
// A program is checked before it is answered, and does not begin once nobody waits for the answer.
const CHECKED_S = 30;
const MOTIONS: readonly Command[] = [Command.HOME, Command.MOVE_ABSOLUTE, Command.MOVE_RELATIVE, Command.RUN_PROGRAM];

// It counts up under each lease, and so it may under all of them.
let lastId = 0n;
/** The newest motion that was accepted; those before it go nowhere any more. */
export const newestMotion = signal(0n);

/** Sends a command under the lease; what became of it, in words. Never sends without control.
 *
 * `positions`: where it leads the joints [rad] or [m], if anywhere. */
export async function command(
  robotKey: string,
  name: Command,
  what: string,
  values: CommandValues = {},
  tell: (notice: Notice) => void = (notice) => (controlNotice.value = notice),
  positions = name === Command.MOVE_ABSOLUTE ? values.jointPositions : undefined,
): Promise<boolean> {
  const mine = held.value;
  if (mine?.robotKey !== robotKey) {
    tell({ kind: "refused", text: t("not_sent", { text: t("take_first") }) });
    return false;
  }
  tell({ kind: "busy", text: t("sending", { what }) });
  const [validMs, withinS] = name === Command.RUN_PROGRAM ? [CHECKED_S * 1000, CHECKED_S] : [VALID_MS, ANSWERED_S];
  const request = {
    lease: mine.lease,
    id: ++lastId,
    notAfter: timestampFromMs(Math.floor(performance.now() + mine.clockMs + validMs)),
    command: name,
    ...values,
  };
  try {
    const key = `${robotKey}/command/${mine.operator}`;
    const answer = await ask(key, CommandRequestSchema, request, CommandAnswerSchema, withinS);
    const target = positions && { what, positions, id: request.id };
    if (answer.accepted && MOTIONS.includes(name)) newestMotion.value = request.id;
    // An earlier gateway has the warning in its sentence alone.
    const mind = reasonText(answer.warning, answer.text.split("; mind: ")[1]);
    if (answer.accepted)
      tell({ kind: "done", text: t("sent", { what }), ...(mind && { mind }), ...(target && { target }) });
    else tell({ kind: "refused", text: t("not_sent", { text: answer.text }) });
    return answer.accepted;
  } catch (error) {
    tell({ kind: "refused", text: t("not_sent", { text: ended(reasonOf(error)) }) });
    return false;
  }
}

/** A sentence with its full stop. */
const ended = (text: string): string => (/[.。]$/.test(text) ? text : t("sentence", { text }));

export { Command };
